// SPDX-License-Identifier: Apache-2.0
// What execute*.cpp share: the run-time side of passes, resources and one frame.
#pragma once

#include "graph/execute.hpp"

#include <set>

namespace heddle::graph {

/// A value port's bytes on the CPU, and where shaders see them: as a uniform block, and as a storage buffer behind 16
/// bytes of header (so that `.length()` is right for empty lists).
struct Value {
  std::vector<std::byte> bytes;
  bool is_set = false;
  vulkan::Buffer uniform, storage;
  std::uint64_t uniform_range = 0, storage_range = 0;
  std::uint64_t revision = 0;  // of what a scene's components made; 0: of something else
};

/// Run-time side of a Resource. Later versions of images and buffers point to their first version by `root`.
struct ResourceState {
  ResourceIndex root = kNoIndex;
  vulkan::Heap own_heap;  // only while memory is poisoned: of a resource outside of the shared heap
  vulkan::Image image;
  vulkan::Buffer buffer;
  vulkan::Buffer poison;  // over the bytes of a transient image or buffer, while memory is poisoned
  Value value;
  VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;  // now; tracked while recording
  bool was_initialized = false;                      // kept resources: neutral contents were written
};

struct ShaderState {
  const Shader* shader = nullptr;
  std::uint32_t stage = 0;
  vulkan::CompiledShader compiled;
  vulkan::Pipeline pipeline;
  vulkan::Pipeline masked;  // depth-only surface shaders: batches with alpha masks
};

struct PassState {
  heddle_pass_host api{};          // api.host = this
  void* executor_state = nullptr;  // Executor::State
  PassIndex index = kNoIndex;
  std::shared_ptr<Library> library;
  const heddle_technique* descriptor = nullptr;
  heddle_pass* object = nullptr;
  bool is_declaring = false;
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
  // execute: host memory of mapped ports.
  struct Mapping {
    std::string port;
    heddle::vulkan::Buffer staging;
    bool is_written = false;
  };
  std::vector<Mapping> mappings;
};

namespace heddle::graph {

/// What the service heddle.components hands out of one component.
struct ComponentRows {
  std::uint64_t revision = 0;
  std::vector<std::uint32_t> owner_kinds, owners, first_values;
  std::vector<std::uint64_t> written;
  std::vector<double> values;
  std::vector<const char*> property_names;
};

struct Executor::State {
  HostServices& services;
  ResolvedGraph original;  // as resolved; each plan starts from it
  ResolvedGraph graph;     // pruned, with declared shapes
  std::vector<std::string> kept_names;

  // The plan; valid while `is_planned`.
  bool is_planned = false;
  std::vector<std::string> planned_features;
  Order order;
  std::vector<MemoryNeed> needs;
  std::uint32_t memory_types = 0;  // that serve them all
  Placement placement;
  BarrierPlan barriers;
  std::vector<ResourceIndex> wanted;
  std::vector<ResourceState> resources;
  std::vector<std::unique_ptr<PassState>> passes;  // parallel to graph.passes; null if pruned
  vulkan::Heap heap;
  std::uint64_t kept_bytes = 0;

  // Device objects that outlive plans.
  vulkan::Device* device = nullptr;
  std::unique_ptr<vulkan::PipelineMaker> maker;
  VkDescriptorSetLayout materials_layout = VK_NULL_HANDLE;
  VkDescriptorSetLayout program_layout = VK_NULL_HANDLE;
  vulkan::SurfaceProgram program;
  VkCommandPool command_pool = VK_NULL_HANDLE;
  std::vector<VkCommandBuffer> command_buffers;  // of the pool; one for each submission of a frame
  std::size_t command_buffer_count = 0;          // in use this frame
  std::vector<VkDescriptorPool> descriptor_pools;
  std::size_t descriptor_pool = 0;  // in use
  VkFence fence = VK_NULL_HANDLE;

  // Scene side.
  const scene::Scene* scene = nullptr;
  std::unique_ptr<scene::SceneBuffers> scene_buffers;
  scene::Snapshot snapshot;
  std::map<std::string, ComponentRows, std::less<>> component_rows;
  std::uint64_t component_revision = 0;
  std::optional<heddle_camera> previous_camera;
  glm::dvec3 origin{0.0};

  // One frame.
  FrameStats stats;
  heddle_frame_info info{};
  VkCommandBuffer commands = VK_NULL_HANDLE;
  std::vector<vulkan::Buffer> frame_buffers;  // staging that must live until the fence
  vulkan::Buffer views;                       // HeddleView of each drawing, 512 bytes apart
  std::uint32_t view_count = 0;
  VkDescriptorSet program_set = VK_NULL_HANDLE;
  std::vector<Diagnostic> errors;  // reported by plugins in the running call

  State(HostServices& s, ResolvedGraph g) : services(s), original(std::move(g)) {}

  void open_device();
  void plan(const scene::Scene& scene);
  void plan_memory(const std::vector<std::string>& features);
  void find_needs();
  void unplan();
  void open_passes();
  void declare_passes();
  void place_resources();
  void initialize_kept();
  void compile_passes();
  void write_parameters(PassState& pass);
  [[nodiscard]] vulkan::Constants constants(const vulkan::CompiledShader& shader) const;
  [[nodiscard]] vulkan::BoundPort bound_port(const Pass& pass, const Access& access) const;
  [[nodiscard]] vulkan::ShaderRequest shader_request(const PassState& pass, const Shader& shader) const;
  void add_role(const Pass& caller, const std::string& role, std::vector<vulkan::RoleRequest>& roles) const;
  [[nodiscard]] vulkan::RasterState raster_state(const Pass& pass, const Shader& shader) const;
  [[nodiscard]] vulkan::ImageShape image_shape(const Resource& resource) const;

  void set_scene_values(const scene::Scene& scene);
  void set_component_values(const scene::Scene& scene);
  void set_value(ResourceIndex resource, std::span<const std::byte> bytes);
  void begin_commands();
  void submit_and_wait();
  void record_barriers(std::span<const Barrier> list);
  void run_stage(std::uint32_t index);
  void run_cpu_stage(PassState& pass, const ScheduledStage& stage, heddle_frame& frame);
  void write_neutral(PassState& pass, const ScheduledStage& stage);
  void clear_image(ResourceState& state, const Resource& resource, const std::array<double, 4>& value);
  VkDescriptorSet allocate_set(VkDescriptorSetLayout layout);
  VkDescriptorSet port_set(const PassState& pass, const ShaderState& shader, std::uint32_t set);
  void bind(const PassState& pass, const ShaderState& shader, const vulkan::Pipeline& pipeline, const void* push,
            std::uint32_t push_bytes);
  vulkan::Buffer switch_table(const Pass& caller, const std::string& role);
  void begin_rendering(const PassState& pass, heddle_frame& frame, std::uint32_t layer);
  [[nodiscard]] VkExtent2D attachment_extent(const Pass& pass, const Stage& stage) const;
  std::uint32_t add_view(const HeddleView& view);
  void throw_if_failed(const PassState& pass, heddle_status status, std::string_view what);

  // What Executor::check renders (execute_orders.cpp): one of find_orders, and what fills memory that nobody wrote.
  struct Variant {
    std::size_t order = 0;
    std::optional<std::uint32_t> poison;
  };
  Variant variant;
  void place_poison(ResourceIndex resource, std::uint64_t bytes);
  void poison_around(std::uint32_t stage, bool is_before);

  // Check mode (execute_check.cpp); without it each does nothing.
  struct Scan {  // texels of an output, copied right after its pass
    PassIndex pass = kNoIndex;
    ResourceIndex resource = kNoIndex;
    std::uint32_t layer = 0, mip = 0, width = 0, height = 0;
    vulkan::Buffer texels;
  };
  std::vector<Scan> scans;
  std::map<ResourceIndex, std::set<std::uint32_t>> drawn_layers;  // this frame, of attachments, by first version
  void name_resources();
  void begin_checked_frame();
  void label_commands(const ScheduledStage* stage);
  void scan_outputs(std::uint32_t stage);
  void throw_what_the_check_found();

  [[nodiscard]] bool is_any_version_kept(ResourceIndex first) const;
  [[nodiscard]] ResourceState& root(ResourceIndex resource) { return resources[resources[resource].root]; }
  [[nodiscard]] const Pass& pass_of(const PassState& state) const { return graph.passes[state.index]; }
  [[nodiscard]] const Technique& technique_of(const PassState& state) const {
    return *graph.passes[state.index].entry.technique;
  }
};

/// Fills the C functions of a pass's host side.
void fill_pass_host(PassState& pass, const heddle_vulkan& table);

}  // namespace heddle::graph
