// SPDX-License-Identifier: Apache-2.0
// What execute*.cpp share: the run-time side of passes, resources and one frame.
#pragma once

#include "graph/execute.hpp"
#include "graph/execute_keys.hpp"

#include "image/image.hpp"
#include "scene/made_surfaces.hpp"

#include <heddle/pieces.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <exception>
#include <set>

namespace heddle::graph {

/// A value port's bytes on the CPU, and where shaders see them: as a uniform block, and as a storage buffer behind 16
/// bytes of header (so that `.length()` is right for empty lists). Those are filled when a shader first asks: what only
/// the CPU reads never gets to the device.
struct Value {
  std::vector<std::byte> bytes;
  std::uint64_t block_bytes = 0;  // least size of the uniform block: zeros beyond `bytes`
  bool is_set = false, is_uniform_new = false, is_storage_new = false;
  vulkan::Buffer uniform, storage;
  std::uint64_t revision = 0;  // of what a scene's components made; 0: of something else
};

/// Pieces of artifacts (execute_pieces.cpp), all of a technique in one file: scenes have thousands.
struct PiecePack {
  struct Piece {
    std::vector<std::byte> bytes;
    std::uint32_t age = 0;  // runs in which nobody asked for it; 0: somebody has in this one
  };
  std::map<std::string, Piece, std::less<>> pieces;  // by key
  bool is_changed = false;
};

/// What a pass made of surfaces, and what the host makes of that in a submission.
struct SurfacesState {
  scene::MadeSurfaces surfaces;
  scene::PlacedBatches placed;  // valid while is_placed
  bool is_placed = false;
  vulkan::Buffer instances;  // HeddleInstance of those that the scene places
  scene::Snapshot snapshot;  // of the version's triangles and all beneath
};

/// Run-time side of a Resource. Later versions of images and buffers point to their first version by `root`.
struct ResourceState {
  ResourceIndex root = kNoIndex;
  vulkan::Heap own_heap;  // only while memory is poisoned: of a resource outside of the shared heap
  vulkan::Image image;
  vulkan::Buffer buffer;
  vulkan::Buffer poison;  // over the bytes of a transient image or buffer, while memory is poisoned
  Value value;
  VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;    // now; tracked while recording
  std::uint32_t appended = 0;                          // list: how often shaders have, as counted last
  bool is_adopted = false;                             // holds what an earlier plan left
  std::optional<std::array<double, 4>> uniform_value;  // of every texel, where this frame's commands say so
  std::unique_ptr<SurfacesState> made;                 // surfaces that a pass made; null: it has set no batches yet
};

struct ShaderState {
  const Shader* shader = nullptr;
  std::uint32_t stage = 0;
  vulkan::CompiledShader compiled;
  std::vector<PassIndex> owners;  // parallel to compiled.bindings: whose port or parameters each is
  vulkan::Constants values;       // that the pipelines were made with
  vulkan::RasterState raster;
  /// With the vertices of meshes, or of a technique's own program.
  struct Behind {
    vulkan::SurfaceProgram program;  // that the pipelines were made with
    std::vector<vulkan::Binding> bindings;
    vulkan::Pipeline pipeline;
    vulkan::Pipeline masked;  // depth-only surface shaders: batches with alpha masks
  };
  vulkan::Pipeline pipeline;
  vulkan::Pipeline masked;
  std::map<std::string, Behind, std::less<>> behind;  // surface programs, by the pass that has one
};

/// A technique's own program of vertices, as this plan has it.
struct ProgramState {
  PassIndex pass = kNoIndex;
  vulkan::CompiledShader compiled;
  std::vector<PassIndex> owners;  // parallel to compiled.bindings
  vulkan::SurfaceProgram program;
  VkDescriptorSetLayout layout = VK_NULL_HANDLE;  // of set 3
  ShaderState evaluation;                         // vertices into a buffer; empty until a snapshot asks for it
};

/// Copies of an image or buffer on the host, for a stage with latency: as many as frames are between, and one that is
/// being made.
struct ReadBackRing {
  PassIndex pass = kNoIndex;
  std::uint32_t stage = 0;
  std::string port;
  struct Copy {
    vulkan::Buffer buffer;
    std::uint64_t frame = HEDDLE_NO_FRAME;
  };
  std::vector<Copy> copies;
};

struct PassState {
  heddle_pass_host api{};          // api.host = this
  void* executor_state = nullptr;  // Executor::State
  PassIndex index = kNoIndex;
  std::shared_ptr<Library> library;
  const heddle_technique* descriptor = nullptr;
  heddle_pass* object = nullptr;
  bool is_declaring = false;  // inside declare
  bool is_preparing = false;  // inside prepare
  bool is_prepared = false;
  bool is_adopted = false;         // the object of an earlier plan
  bool is_redeclared = false;      // and while it is planned: declared and prepared again
  bool wants_redeclare = false;    // asked for it; due before the next frame
  bool declares_by_scene = false;  // asked for the scene's meshes or components in declare, when they were
  std::array<std::uint64_t, 2> declared_content{};  // these revisions
  const Stage* cached_stage =
      nullptr;  // inside execute of a stage with cached_by: all that it may ask for is in its key
  vulkan::GeneratedTexts texts;
  std::string resolved_path;                                                   // the last answer of resolve_path
  std::vector<std::shared_ptr<image::OpenImage>> images;                       // open
  std::vector<std::shared_ptr<StoreFile>> stores;                              // open
  std::map<std::string, std::shared_ptr<StoreFile>, std::less<>> made_stores;  // by artifact, until it is kept
  // Slices that several stages do together (execute_slices.cpp): with which scheduled stage the next one begins, where
  // a stage has just asked for it; and how often they have begun anew.
  std::optional<std::uint32_t> again;
  std::uint32_t slice = 0;
  std::chrono::steady_clock::time_point began, told, saved;
  std::chrono::steady_clock::duration saving{};
  std::map<std::string, ShaderState, std::less<>> shaders;
  vulkan::Buffer parameters;
  vulkan::ParameterLayout layout;
};

}  // namespace heddle::graph

/// One call of record or execute: what the C functions of heddle_pass_host act on.
struct heddle_frame {
  const heddle::graph::ScheduledStage* stage = nullptr;
  VkCommandBuffer commands = VK_NULL_HANDLE;  // VK_NULL_HANDLE in execute
  // Layers of attachments that were already drawn into by this stage: cleared or loaded once.
  std::set<std::uint32_t> drawn_layers;
  std::array<float, 4> blend_constant{1, 1, 1, 1};
  // execute: host memory of mapped ports.
  struct Mapping {
    std::string port;
    heddle::vulkan::Buffer staging;
    bool is_written = false;
    std::uint64_t frame = HEDDLE_NO_FRAME;  // that made the contents
    // Stages with latency: where the contents are; else in staging.
    std::byte* late = nullptr;
    std::vector<std::byte> zeros;  // `late` when nothing has arrived
  };
  std::vector<Mapping> mappings;
  // execute: what made surfaces hold, for a snapshot; none where the last one still holds.
  struct Contents {
    std::uint32_t made = 0;                        // resource
    std::array<heddle::vulkan::Buffer, 4> copies;  // vertices, indices, instances, commands
  };
  std::vector<Contents> contents;
  std::chrono::steady_clock::time_point began, told;  // execute, and when the person at the screen was last told of it
  std::uint32_t slice = 0;                            // how often the stage has answered HEDDLE_MORE
  bool stops_at_slices = false;                       // and nowhere else
  bool is_saving = false;                             // inside save_state
  std::vector<std::byte> state;                       // what that kept
};

namespace heddle::graph {

/// What passes get wrong while a plan is made: each has its say, so that a person sees all mistakes at once. What
/// depends on a mistaken one is left in peace, as its inputs may be wrong for that reason alone.
class PassMistakes {
 public:
  explicit PassMistakes(const ResolvedGraph& graph) : graph_(graph) {}
  template <class Body>
  void attempt(PassIndex pass, Body body) {
    const auto is_mistaken = [&](PassIndex other) { return errors_.contains(other) || left_in_peace_.contains(other); };
    if (is_mistaken(pass)) return;
    if (std::ranges::any_of(graph_.passes[pass].dependencies, is_mistaken)) {
      left_in_peace_.insert(pass);
      return;
    }
    try {
      body();
    } catch (const Error& error) {
      if (error.status() == HEDDLE_CANCELLED) throw;
      errors_.emplace(pass, error);
    }
  }
  [[nodiscard]] bool empty() const { return errors_.empty(); }
  /// By the order of the passes in the file; with the status of the first.
  void throw_if_any() const {
    if (errors_.empty()) return;
    std::vector<Diagnostic> all;
    for (const auto& [pass, error] : errors_)
      all.insert(all.end(), error.diagnostics().begin(), error.diagnostics().end());
    throw Error(errors_.begin()->second.status(), first_of(std::move(all)));
  }

 private:
  const ResolvedGraph& graph_;
  std::map<PassIndex, Error> errors_;
  std::set<PassIndex> left_in_peace_;
};

/// What a plan that was taken down left for the next one, by names.
struct Legacy {
  struct Object {
    Pass pass;
    std::map<std::string, Resource, std::less<>> shapes;  // of its bound ports
    std::vector<std::string> providers;                   // of functions that it calls
    std::uint32_t width = 0, height = 0;                  // of the graph
    std::vector<ReadBackRing> rings;
    std::unique_ptr<PassState> state;  // null: adopted
  };
  struct Memory {
    Resource shape;
    ResourceState state;
  };
  std::map<std::string, Object, std::less<>> passes;
  std::map<std::string, Memory, std::less<>> memory;  // what outlasts frames, and values
  bool has_past = false;                              // frames were rendered
};

/// Instances of a source of draws, relative to a point of a drawing's own, as far as drawings have needed them.
struct Placing {
  glm::dvec3 origin{0.0};
  VkBuffer source = VK_NULL_HANDLE;  // the same instances relative to the frame's origin
  const vulkan::Buffer* instances = nullptr;
  std::vector<std::uint8_t> is_there;  // by slot
};

/// What the commands of one frame use until its fence is there.
struct FrameMemory {
  VkCommandPool command_pool = VK_NULL_HANDLE;
  std::vector<VkCommandBuffer> command_buffers;  // of the pool; one for each submission of a frame
  std::size_t command_buffer_count = 0;          // in use this frame
  std::vector<VkDescriptorPool> descriptor_pools;
  std::size_t descriptor_pool = 0;  // in use
  VkFence fence = VK_NULL_HANDLE;
  std::vector<vulkan::Buffer> frame_buffers;  // staging that must live until the fence
  vulkan::Buffer views;                       // HeddleView of each drawing, 512 bytes apart
  std::uint32_t view_count = 0;
  vulkan::Buffer draw_commands;  // of drawings that leave out instances
  std::uint64_t draw_command_bytes = 0;
  std::map<std::tuple<const void*, VkBuffer, VkBuffer>, VkDescriptorSet>
      program_sets;                             // of this submission: set 3 by program, vertices, instances
  std::vector<Placing> placings;                // of this submission
  std::deque<vulkan::Buffer> placed_instances;  // of all submissions: as many as one has had placings
  vulkan::Buffer group_commands;                // VkDispatchIndirectCommand of each dispatch over a list
  std::uint64_t group_command_count = 0;        // of this submission
  std::vector<ResourceIndex> count_slots;       // this frame's: lists whose head was copied, in that order
  std::vector<vulkan::Buffer> count_buffers;
  std::uint64_t submitted_frame = HEDDLE_NO_FRAME;
};
/// Live mode: frames that may run at the same time, the one that is recorded included.
constexpr std::size_t kFramesInFlight = 3;

/// What the service heddle.components hands out of one component.
struct ComponentRows {
  std::uint64_t revision = 0;
  std::vector<std::uint32_t> owner_kinds, owners, first_values;
  std::vector<std::uint64_t> written;
  std::vector<double> values;
  std::vector<const char*> property_names;
};

struct Executor::State : FrameMemory {
  HostServices& services;
  ResolvedGraph original;  // as resolved; each plan starts from it
  ResolvedGraph graph;     // pruned, with declared shapes
  std::vector<std::string> kept_names;

  // The plan; valid while `is_planned`.
  bool is_planned = false;
  bool is_fresh = false;   // no frame was rendered, of this plan or of those that it took over: there is no past
  bool has_frame = false;  // the wanted images hold a frame
  Legacy legacy;
  std::vector<std::uint8_t> is_outdated;  // passes that must run in this plan's first frame; empty: none
  std::vector<std::string> planned_features;
  std::array<std::uint32_t, 2> planned_environment{};  // width, height
  const scene::Scene* planned_scene = nullptr;         // while it is planned for; null: for any
  Order order;
  std::vector<MemoryNeed> needs;
  std::uint32_t memory_types = 0;  // that serve them all
  Placement placement;
  BarrierPlan barriers;
  ListPlan lists;
  bool is_redeclaring = false;  // the plan is made because a pass asked for it
  std::vector<ResourceIndex> wanted;
  std::vector<ResourceState> resources;
  std::vector<ReadBackRing> rings;
  std::vector<heddle_iterations> iterations;       // of this frame, parallel to order.loops
  std::vector<std::unique_ptr<PassState>> passes;  // parallel to graph.passes; null if pruned
  vulkan::Heap heap;
  std::uint64_t kept_bytes = 0;

  // Device objects that outlive plans.
  vulkan::Device* device = nullptr;
  std::unique_ptr<vulkan::PipelineMaker> maker;
  VkDescriptorSetLayout materials_layout = VK_NULL_HANDLE;
  VkDescriptorSetLayout program_layout = VK_NULL_HANDLE;
  vulkan::SurfaceProgram program;  // of meshes

  std::map<std::string, ProgramState, std::less<>> programs;  // of techniques, by pass

  // Scene side.
  const scene::Scene* scene = nullptr;
  std::unique_ptr<scene::SceneBuffers> scene_buffers;
  scene::Snapshot snapshot, empty_snapshot;
  std::map<std::string, ComponentRows, std::less<>> component_rows;
  std::vector<std::uint64_t> light_texture_revisions;  // in the value `light_textures`
  std::optional<heddle_camera> previous_camera;
  double told_near = 0;  // a near plane beyond the scene, of which the person at the screen was told
  glm::dvec3 origin{0.0}, previous_origin{0.0};
  std::vector<std::byte> inputs;  // of the last frame, all that techniques can see: what is_still compares
  bool is_changed = false;        // a parameter was set since

  // One frame.
  std::uint64_t frame_index = 0;  // frames that were submitted
  bool is_continuing = false;     // a loop goes on where the last frame left it: no time passes
  bool is_first_iteration = true, is_last_iteration = true;  // of this frame, in a loop; both outside of loops
  FrameStats stats;
  std::chrono::steady_clock::time_point first_submission;  // of this frame
  heddle_frame_info info{};
  VkCommandBuffer commands = VK_NULL_HANDLE;
  std::vector<Diagnostic> errors;  // reported by plugins in the running call
  std::exception_ptr stop_reason;  // of whoever was told of progress, to be thrown when nothing is half done

  State(HostServices& s, ResolvedGraph g) : services(s), original(std::move(g)) {}

  void open_device();
  void plan(const scene::Scene& scene);
  void plan(const std::vector<std::string>& features, bool is_restoring = false);
  void redeclare();
  void note_content(const scene::Scene& scene);
  void plan_memory(const std::vector<std::string>& features);
  void find_wanted();
  void find_needs();
  void unplan();
  void destroy(PassState& pass);
  void retire();
  void bury();
  std::unique_ptr<PassState> adopt_object(PassIndex pass);
  bool keep_adopted(PassIndex pass);
  void adopt_memory(ResourceIndex resource);
  void find_outdated();
  void adopt_rings(PassIndex pass);
  [[nodiscard]] Legacy::Memory* outgrown(ResourceIndex resource);
  void migrate(ResourceIndex resource, std::uint32_t list_count);
  ShaderState* former_pipelines(PassState& pass, const ShaderState& made);
  void open_passes(PassMistakes& mistakes);
  void create(PassState& pass);
  void declare(PassIndex pass);
  void declare_passes(PassMistakes& mistakes);
  void place_resources();
  void initialize_kept();
  ShaderState compile_shader(const PassState& pass, const Shader& shader, bool is_restoring);
  void compile_passes(bool is_restoring);
  [[nodiscard]] std::vector<const Shader*> scheduled_shaders(const PassState& state) const;
  void make_pipelines(ShaderState& shader);
  void count_pipeline(const vulkan::Pipeline& pipeline);
  // Surface programs of techniques (execute_programs.cpp).
  using Programs = std::map<std::string, ProgramState, std::less<>>;
  [[nodiscard]] Programs compile_programs(bool is_restoring) const;
  [[nodiscard]] std::vector<ProgramState*> programs_behind(const Pass& pass, const ShaderState& shader);
  [[nodiscard]] static ShaderState::Behind* former_behind(ShaderState* former, const ProgramState& own,
                                                          const std::string& pass);
  void make_pipelines_behind(const Pass& pass, ShaderState& shader, ShaderState* former);
  void keep_pipelines_behind(const Pass& pass, ShaderState& shader, ShaderState* former);
  [[nodiscard]] const ProgramState* program_behind(ResourceIndex made) const;
  bool evaluate_vertices(ResourceIndex made, vulkan::Buffer& vertices);
  [[nodiscard]] vulkan::ProviderRequest provider_request(const Pass& provider, const Function& function) const;
  [[nodiscard]] std::vector<PassIndex> owners_of(const vulkan::CompiledShader& shader) const;
  void write_parameters(PassState& pass);
  [[nodiscard]] vulkan::Constants constants(const vulkan::CompiledShader& shader) const;
  [[nodiscard]] vulkan::BoundPort bound_port(const Pass& pass, const Access& access) const;
  [[nodiscard]] vulkan::ShaderRequest shader_request(const PassState& pass, const Shader& shader) const;
  void add_role(const Pass& caller, const std::string& role, std::vector<vulkan::RoleRequest>& roles) const;
  [[nodiscard]] vulkan::RasterState raster_state(const Pass& pass, const Shader& shader) const;
  [[nodiscard]] vulkan::ImageShape image_shape(const Resource& resource) const;

  void set_scene_values(const scene::Scene& scene);
  void tell_of_near_plane(const scene::Scene& scene, const heddle_camera& camera);
  void set_environment(ResourceIndex resource, const scene::Scene& scene);
  void set_light_textures(ResourceIndex resource, const scene::Scene& scene);
  /// What the plan depends on of a scene is as it was.
  [[nodiscard]] bool is_planned_for(const scene::Scene& scene) const;
  void set_component_values(const scene::Scene& scene);
  /// The scene that a pass may ask of: in declare and prepare the one that is planned for, if any.
  [[nodiscard]] const scene::Scene* asked_scene(PassState& pass) const;
  void set_value(ResourceIndex resource, std::span<const std::byte> bytes);
  void turn_histories();
  void carry_over(ResourceIndex newest, ResourceIndex history);
  void keep_outputs(const ScheduledStage& stage);
  void clear_history(ResourceIndex history);
  void run_read_back(const ScheduledStage& stage);
  [[nodiscard]] const ResourceState& readable(std::string_view name, std::uint32_t layer, std::uint32_t mip);
  heddle_frame::Mapping late_mapping(const ScheduledStage& stage, const std::string& port);
  void copy_to_host(ResourceIndex resource, const vulkan::Buffer& buffer);
  [[nodiscard]] std::uint64_t host_bytes(ResourceIndex resource) const;
  VkDescriptorBufferInfo uniform_of(Value& value);
  VkDescriptorBufferInfo storage_of(Value& value);
  void begin_commands();
  void submit_and_wait();
  void record_barriers(std::span<const Barrier> list);
  void run_stage(std::uint32_t index, std::span<const Barrier> before);
  void run_stages(bool is_profiled);
  void run_loop(std::size_t loop, bool is_profiled);
  /// stops_here: before the stage, if asked to.
  void run_timed(std::uint32_t index, std::span<const Barrier> before, bool is_profiled, bool stops_here = true);
  [[nodiscard]] bool find_iterations();
  [[nodiscard]] bool is_still(const scene::Scene& scene, const FrameOptions& options);
  void begin_frame_memory();
  // Live mode: memory of frames that were submitted, the oldest first, and of frames that are done.
  std::deque<FrameMemory> in_flight;
  std::vector<FrameMemory> spare;
  std::vector<vulkan::Buffer> outgrown_buffers;  // that these frames may still read; go with the next frame's
  [[nodiscard]] FrameMemory make_frame_memory() const;
  void destroy_frame_memory(FrameMemory& memory) const;
  void take_frame_memory();
  void end_frame(FrameMemory& memory);
  void end_finished_frames(std::size_t most_left);
  void wait_for_frames();
  [[nodiscard]] bool is_done(const FrameMemory& memory) const;
  [[nodiscard]] bool is_done(std::uint64_t frame) const;
  void submit();
  void wait_for(VkFence awaited);
  void order_after_frames_in_flight();
  void upload_in_frame(const vulkan::Buffer& target, std::uint64_t offset, std::span<const std::byte> bytes);
  void run_cpu_stage(PassState& pass, const ScheduledStage& stage, heddle_frame& frame);
  void execute_stage(PassState& pass, const ScheduledStage& stage, heddle_frame& frame);
  void warn(const Pass& pass, std::string_view message) const;

  // Slices of a stage (execute_slices.cpp). `key`: of what it makes; empty: nobody keeps that.
  void run_slices(PassState& pass, const ScheduledStage& stage, heddle_frame& frame, const heddle_frame_info& seen,
                  const std::string& key);
  void begin_slice(PassState& pass, const ScheduledStage& stage, heddle_frame& frame);
  void run_again(std::uint32_t last, bool is_profiled);
  [[nodiscard]] std::vector<Barrier> barriers_again(std::uint32_t stage) const;
  [[nodiscard]] bool is_stop_asked() const;
  void save_unfinished(PassState& pass, const ScheduledStage& stage, heddle_frame& frame, const std::string& key);
  void load_unfinished(PassState& pass, const ScheduledStage& stage, heddle_frame& frame, const std::string& key);
  [[nodiscard]] std::optional<std::uint32_t> first_of(const PassState& pass, const ScheduledStage& stage,
                                                      const ArtifactParts& parts) const;
  void put_back(PassState& pass, const ScheduledStage& stage, heddle_frame& frame, const ArtifactParts& parts);
  void begin_anew(const PassState& pass, const ScheduledStage& stage, heddle_frame& frame);
  [[nodiscard]] std::vector<std::string> device_outputs(const PassState& pass, const ScheduledStage& stage) const;

  // Jobs (execute_job.cpp): waves of passes whose artifacts are all there.
  std::map<std::string, Lasting, std::less<>> lasting;  // what is there, by resource; also what other jobs have made
  std::vector<std::string> pass_keys;                   // parallel to original.passes
  std::vector<std::string> pass_codes;                  // the same: of library, shaders and device alone
  std::vector<heddle_surface_item> surface_items;       // of the port that was asked for last (execute_pieces.cpp)
  std::map<std::string, PiecePack> piece_packs;         // by code, of passes that have asked for one in this run
  std::vector<std::string> wave;                        // what the present plan is for
  std::vector<std::unique_ptr<Executor>> jobs;          // parallel to original.jobs
  std::string jobs_scene;                               // that these were run for, but for places; empty: they are due
  std::set<std::string> looked_up;                      // keys, in the cache, in this run
  bool is_named = false;                                // the job of another graph's input
  JobResult job_result;
  [[nodiscard]] std::vector<std::string> job_wants() const;
  [[nodiscard]] std::vector<std::string> frame_wants() const;
  [[nodiscard]] std::vector<ResourceIndex> needed_artifacts(const std::vector<std::string>& features) const;
  [[nodiscard]] bool keeps_artifacts() const;
  PiecePack& pieces_of(PassIndex pass);
  void keep_pieces(PassIndex pass);
  bool run_jobs(const scene::Scene& scene);
  void adopt_jobs(const std::vector<GraphJob>& former);
  void run_job(const scene::Scene& scene, const FrameOptions& options, const std::vector<std::string>& names);
  bool find_lasting(PassIndex pass);
  [[nodiscard]] bool has_lasting(PassIndex pass) const;
  std::vector<PassIndex> find_due(const std::vector<std::string>& names);
  [[nodiscard]] std::vector<PassIndex> find_ready(const std::vector<PassIndex>& due) const;
  void place_lasting();
  void keep_lasting(std::uint32_t stage);
  [[nodiscard]] std::filesystem::path new_store_file(PassIndex pass, std::string_view port) const;
  std::map<std::string, std::shared_ptr<StorePlace>, std::less<>> keep_stores(PassIndex pass, ArtifactViews& parts,
                                                                              std::deque<std::uint64_t>& sizes);
  [[nodiscard]] heddle_frame_info info_for(const Pass& pass) const;
  [[nodiscard]] bool is_key_file(const Pass& pass, std::string_view path) const;
  void run_frame(const scene::Scene& scene, const FrameOptions& options);
  std::string artifact_key(const PassState& pass, const ScheduledStage& stage, const heddle_frame& frame);
  bool take_artifact(const ArtifactParts& parts, PassState& pass, const ScheduledStage& stage, heddle_frame& frame);
  ArtifactViews made_parts(const PassState& pass, const ScheduledStage& stage, const heddle_frame& frame);
  void write_neutral(PassState& pass, const ScheduledStage& stage);
  void clear_image(ResourceState& state, const Resource& resource, const std::array<double, 4>& value);
  VkDescriptorSet allocate_set(VkDescriptorSetLayout layout);
  VkDescriptorSet make_program_set(const ProgramState* program, VkBuffer vertices, VkBuffer instances);
  VkDescriptorSet port_set(const PassState& pass, const ShaderState& shader, std::uint32_t set);
  void fill_set(VkDescriptorSet target, const Pass& caller, std::span<const vulkan::Binding> bindings,
                std::span<const PassIndex> owners, std::uint32_t set);
  void bind(const PassState& pass, const ShaderState& shader, const vulkan::Pipeline& pipeline, const void* push,
            std::uint32_t push_bytes);
  vulkan::Buffer switch_table(const Pass& caller, const std::string& role);
  /// A drawing with what the caller left open filled in, and checked. `origin`: what its view is relative to, nullptr:
  /// the frame's.
  struct Drawing {
    heddle_draw wanted{};
    HeddleView view{};
    const glm::dvec3* origin = nullptr;
    bool clears = false;  // its part of the attachments; only with an origin, else they load as their accesses say
  };
  void draw_surfaces(const PassState& pass, const ShaderState& shader, const Drawing& drawing);
  [[nodiscard]] scene::Look look_of(const PassState& pass, const Drawing& drawing);

  // Made surfaces (execute_surfaces.cpp).
  void set_batches(ResourceIndex surfaces, std::vector<scene::MadeBatch> batches, std::uint64_t revision);
  const scene::PlacedBatches& place(SurfacesState& made);
  /// The versions that passes made and that hold something, the newest first.
  [[nodiscard]] std::vector<ResourceIndex> made_versions(ResourceIndex surfaces) const;
  [[nodiscard]] VkBuffer buffer_of(ResourceIndex buffer) const;
  bool copy_contents(ResourceIndex surfaces, heddle_frame& frame);
  const scene::Snapshot& take_snapshot(ResourceIndex surfaces, const heddle_frame& frame);
  void begin_rendering(const PassState& pass, heddle_frame& frame, std::uint32_t layer,
                       const Drawing* drawing = nullptr);
  [[nodiscard]] VkExtent2D attachment_extent(const Pass& pass, const Stage& stage) const;
  std::uint32_t add_view(const HeddleView& view);
  struct DrawRange {  // of indirect commands
    VkBuffer buffer = VK_NULL_HANDLE;
    std::uint64_t offset = 0;
    std::uint32_t count = 0;
  };
  /// `own`: the list's commands as they lie on the device; null: nowhere.
  Placing& placing_at(const glm::dvec3& origin, VkBuffer source, std::size_t slots);
  void place(Placing& placing, const scene::DrawList& list, const scene::PlacedBatches* made,
             std::span<const VkDrawIndexedIndirectCommand> drawn);
  DrawRange draw_range(const scene::DrawGroup& group, const scene::VisibleDraws& visible, VkBuffer own);
  void throw_if_failed(const PassState& pass, heddle_status status, std::string_view what);

  // What images are known to hold (execute_contents.cpp).
  std::uint64_t writes_recorded = 0;  // draws, dispatches, and whenever a technique was given the command buffer
  [[nodiscard]] bool holds(ResourceIndex image, const std::array<double, 4>& value);
  void note_contents(const ScheduledStage& stage, const heddle_frame& frame, std::uint64_t writes_before);

  // Counters of techniques (execute_views.cpp).
  void add_count(const PassState& pass, std::string_view name, std::uint64_t count);

  // Lists (execute_lists.cpp).
  vulkan::Pipeline groups_pipeline;
  std::set<std::string> overflowing;  // names of the lists that had no room in the last frame
  [[nodiscard]] AccessInfo list_access(const ScheduledStage& stage, ResourceIndex list) const;
  void begin_lists(std::uint32_t stage, std::uint32_t activity);
  void copy_counts(std::uint32_t stage);
  void publish_counts();
  void note_counts(const FrameMemory& memory);
  void tell_counts(const FrameMemory& memory);
  void make_groups_pipeline();
  void dispatch_over_list(const PassState& pass, const ShaderState& shader, ResourceIndex list, const void* push,
                          std::uint32_t push_bytes);
  [[nodiscard]] bool is_redeclare_due() const {
    return std::ranges::any_of(passes, [](const auto& pass) { return pass && pass->wants_redeclare; });
  }

  // What Executor::check renders (execute_orders.cpp): one of find_orders, and what fills memory that nobody wrote.
  enum class ListOrder : std::uint8_t { kAscending, kDescending };  // of bytes, of what one stage has appended
  struct Variant {
    std::size_t order = 0;
    std::optional<std::uint32_t> poison;
    bool culls = true;
    std::optional<ListOrder> list_order;
  };
  Variant variant;
  static constexpr std::size_t kMostOrders = 16;
  std::vector<OrderSet> wave_orders;                     // of a job's waves
  std::map<ResourceIndex, std::uint32_t> sorted_counts;  // elements of each list that were put in order
  void sort_appended(std::uint32_t stage);
  void place_poison(ResourceIndex resource, std::uint64_t bytes);
  void poison_around(std::uint32_t stage, bool is_before);
  void forget_frames();

  // Check mode (execute_check.cpp); without it each does nothing.
  struct Scan {  // texels of an output, copied right after its pass
    PassIndex pass = kNoIndex;
    ResourceIndex resource = kNoIndex;
    std::uint32_t layer = 0, mip = 0, width = 0, height = 0;
    std::uint32_t iteration = 0, iteration_count = 0;  // of a loop; count 0: in none
    vulkan::Buffer texels;
  };
  std::vector<Scan> scans;
  std::optional<Diagnostic> wrong_value;                          // the first that a scan of this frame found
  std::map<ResourceIndex, std::set<std::uint32_t>> drawn_layers;  // this frame, of attachments, by first version
  void name_resources();
  void begin_checked_frame();
  void label_commands(const ScheduledStage* stage);
  void scan_outputs(std::uint32_t stage);
  void search_scans(std::size_t begin);
  void throw_what_the_check_found();

  // Looking at pixels (execute_inspect.cpp): texels of every version of an image, copied where it was finished.
  struct Look {
    std::uint32_t stage = 0;  // of the order
    ResourceIndex resource = kNoIndex;
    std::uint32_t layers = 1;
    vulkan::Buffer texels;  // kLookStride bytes for each pixel of each layer; none where pixels have no meaning
  };
  std::vector<Pixel> pixels;  // empty: nobody looks
  std::vector<Look> looks;
  void look_at_outputs(std::uint32_t stage);

  /// Throws Error(HEDDLE_CANCELLED) if the application asked for it, and what it threw itself while it was told of
  /// progress.
  void stop_if_cancelled();

  [[nodiscard]] bool is_any_version_kept(ResourceIndex first) const;
  [[nodiscard]] ResourceState& root(ResourceIndex resource) { return resources[resources[resource].root]; }
  [[nodiscard]] const Pass& pass_of(const PassState& state) const { return graph.passes[state.index]; }
  [[nodiscard]] const Technique& technique_of(const PassState& state) const {
    return *graph.passes[state.index].entry.technique;
  }
};

/// Everything before, then everything after; an image may change its layout meanwhile.
void barrier_between_all(const heddle_vulkan& vk, VkCommandBuffer commands, const vulkan::Image& image,
                         VkImageLayout from, VkImageLayout to);

/// What a copy between all of an image and tightly packed host memory takes: all layers mip by mip, the finest first.
std::vector<VkBufferImageCopy> all_mips(const Resource& resource);
std::uint64_t bytes_of(const std::vector<VkBufferImageCopy>& regions, const Resource& resource);

/// Depth or colour.
VkImageAspectFlags aspect_of(std::uint32_t format);
/// Commands that are in no plan, at a frame's start or between frames, are ordered against everything.
Barrier full_barrier(ResourceIndex resource, VkImageLayout from, VkImageLayout to);
/// All memory: what was accessed so in the one is done before the other.
void barrier_between(const heddle_vulkan& vk, VkCommandBuffer commands, VkPipelineStageFlags2 from,
                     VkAccessFlags2 written, VkPipelineStageFlags2 to, VkAccessFlags2 access);
/// What was copied to host memory is there for the host once the fence is.
void show_copies_to_host(const heddle_vulkan& vk, VkCommandBuffer commands);
/// What declare says of an image or buffer.
void copy_shape(Resource& to, const Resource& from);
/// A resource's shape as plugins see it, bound.
heddle_shape shape_of(const Resource& resource);
/// The scene's environment.
bool is_environment(const Resource& resource);

/// Fills the C functions of a pass's host side.
void fill_pass_host(PassState& pass, const heddle_vulkan& table);

}  // namespace heddle::graph
