// SPDX-License-Identifier: Apache-2.0
// The plain structures that the stages of the graph compiler hand on, in order:
//   text -parse-> WrittenGraph -resolve-> ResolvedGraph -prune-> (the same, passes marked) -order-> Order
//        -alias-> Placement -barriers-> BarrierPlan -execute.
// No function here touches a device, a plugin library or a file except where it says so; every structure is printable.
#pragma once

#include "diagnostics.hpp"
#include "plugin/registry.hpp"

#include <map>
#include <memory>
#include <optional>
#include <variant>

namespace heddle::graph {

// ---- parse: what was written, with places -------------------------------------------------------------------------

/// A value of TOML with its place; names of keys carry their own.
struct Written {
  std::variant<bool, std::int64_t, double, std::string, std::vector<Written>> value;
  Location where;
};
struct WrittenKey {
  std::string name;
  Location where;
  // Set when an overlay or a setting changed the pass's technique afterwards: the technique that the key was written
  // for. Such a key is used where the new technique has the name and takes the value, else dropped with a note.
  std::string written_for;
};

struct WrittenPass {
  Location where;                                      // of [[pass]]
  Written name, role, technique;                       // strings; an overlay's pass may leave role and technique empty
  std::optional<Written> after, before;                // overlays only
  std::vector<std::pair<WrittenKey, Written>> params;  // params.NAME
  std::vector<std::pair<WrittenKey, Written>> inputs;  // inputs.PORT = "pass.port" | "scene.x" | "none"
  std::vector<std::pair<WrittenKey, Written>>
      functions;                   // functions.ROLE = ["pass", ...] which providers; [] = neutral
  std::vector<Written> serves;     // `switch`: names or types of lights / names of materials; empty = all
  std::optional<Written> enabled;  // bool, default true
  bool says_serves = false;        // an overlay's `serves = []` means all
};

/// A pass that an overlay took out: what it was, and where that was written.
struct RemovedPass {
  WrittenPass pass;
  Location where;  // in `remove`
};

/// A setting of a job that an input names: all of "links.toml#bake.params.rays=64", and where the job's own part
/// begins.
struct JobSetting {
  std::string job;  // "links.toml", as inputs write it
  std::string text;
  std::size_t begin = 0;
  Location where;
};

struct WrittenGraph {
  std::optional<Written> kind;  // "frame", which is the default, or "job"
  std::string file;
  std::vector<std::string> files;  // that were read for it: this one and what it extends
  std::filesystem::path folder;    // where paths in parameters start from
  std::optional<Written> extends;
  std::optional<Written> extent;                       // [w, h]
  std::optional<Written> output;                       // "display.color"
  std::vector<std::pair<WrittenKey, Written>> params;  // top-level presets: NAME = default, referred to as "$NAME"
  std::vector<std::pair<WrittenKey, Written>> joins;   // joins.ROLE = "switch" | "sum" | "product": overrides role.toml
  std::vector<Written> remove;
  std::vector<WrittenPass> passes;   // file order
  std::vector<RemovedPass> removed;  // by overlays; for explanations alone
  // Graphs that inputs name, "links.toml#links", by what stands before the '#'. Sharers: copies of this structure.
  std::map<std::string, std::shared_ptr<const WrittenGraph>, std::less<>> jobs;
  std::vector<JobSetting> job_settings;  // in order; read_jobs applies them to what it reads
};

/// TOML text -> what was written. Opens no file. Throws Error with every syntax error and unknown key.
WrittenGraph parse(std::string_view text, std::string_view file);
/// Reads a file and what it extends, and merges the overlays into one graph (no `extends` left). Opens files.
/// `shipped`: folder of the graphs that come with Heddle; a name without a folder that is no file means one of them.
WrittenGraph read_graph(const std::filesystem::path& file, const std::filesystem::path& shipped = {});
/// The same for a text that was parsed already; `folder` is where its `extends` looks. Opens files.
WrittenGraph read_extended(WrittenGraph written, const std::filesystem::path& folder,
                           const std::filesystem::path& shipped = {});
/// Reads the jobs that inputs name and that were not read yet, the jobs that those name, and so on. Opens files; throws
/// Error for what is no job, for jobs that name each other in a circle, and for settings of jobs that nothing names.
void read_jobs(WrittenGraph& graph, const std::filesystem::path& shipped = {});
/// True where a graph says kind = "job".
bool is_job(const WrittenGraph& graph);
/// Merges `over` on `base`. Pure.
WrittenGraph overlay(WrittenGraph base, WrittenGraph over);
/// Applies "ao.technique=gtao", "ao.params.radius=1", "ao.inputs.depth=x.y", "extent=[640,360]", "output=a.b",
/// "params.NAME=..."; the place of such a value is file "--set", line 1, column in the setting. "links.toml#SETTING" is
/// one of the job that inputs name "links.toml#...": read_jobs, which is to follow, reads that job anew and applies it.
/// Opens files, those of jobs, only to help where a setting is wrong.
void apply_setting(WrittenGraph& graph, std::string_view setting, const std::filesystem::path& shipped = {});

// ---- resolve: names -> descriptors and resources --------------------------------------------------------------------

using PassIndex = std::uint32_t;
using ResourceIndex = std::uint32_t;
inline constexpr std::uint32_t kNoIndex = 0xffffffffU;

/// A parameter's value: numbers, or strings for ParameterType::kNames and kText (one, or none for the default "").
struct ParameterValue {
  std::array<double, 3> number{0, 0, 0};
  std::vector<std::string> names;
  bool operator==(const ParameterValue&) const = default;
};

/// What stands behind ports. A new version made by an `inout` port is a resource of its own with `previous_version`.
struct Resource {
  std::string name;  // "gbuffer.depth", "scene.camera"
  PortType type = PortType::kImage;
  PassIndex producer = kNoIndex;              // kNoIndex: the scene
  std::string port;                           // of the producer, or of the scene: "camera", "lights", "surfaces"
  ResourceIndex previous_version = kNoIndex;  // same memory for images and buffers, a changed copy for values
  ResourceIndex history_of = kNoIndex;        // this is last frame's version of another; it has no producer then
  bool is_kept = false;
  // Shape; images and buffers only, filled from the descriptor by resolve and corrected by `declare` before alias.
  std::uint32_t format = 0, width = 0, height = 0, layers = 1, mips = 1;
  std::uint32_t flags = 0;  // HEDDLE_PORT_*
  std::uint64_t byte_size = 0;
  std::uint32_t capacity = 0, element_bytes = 0;  // lists
  // Artifacts that a job of another file makes: which of ResolvedGraph::jobs, and its resource there.
  std::uint32_t job = kNoIndex;
  std::string job_resource;
  std::string content;  // artifacts that are there: a hash
  [[nodiscard]] bool is_list() const { return (flags & HEDDLE_PORT_LIST) != 0; }
};

/// Of a list's memory, before its elements: how often shaders appended, in the first four bytes.
inline constexpr std::uint64_t kListHead = 16;
inline std::uint64_t list_bytes(std::uint32_t capacity, std::uint32_t element_bytes) {
  return kListHead + std::uint64_t{capacity} * element_bytes;
}

/// Where a parameter's value comes from.
struct ParameterOrigin {
  std::optional<Location> where;  // params.NAME of the pass; nothing: the technique's default
  std::string preset;             // NAME of "$NAME"; then `preset_where` is where that was given its value
  Location preset_where;
};

/// Providers of one role's functions for one caller pass, in graph order.
struct FunctionBinding {
  std::string role;
  Join join = Join::kSwitch;
  std::vector<PassIndex> providers;  // empty: the neutral body
};

struct Pass {
  std::string name;
  Location where;
  const Role* role = nullptr;
  TechniqueEntry entry;                    // technique "none" never gets here: resolve leaves the pass out
  std::vector<ParameterValue> parameters;  // parallel to technique->parameters
  std::vector<ParameterOrigin> origins;    // parallel to parameters
  std::map<std::string, ResourceIndex, std::less<>>
      ports;  // bound ports, in and out; an absent optional input is missing
  std::map<std::string, ResourceIndex, std::less<>>
      inout_sources;                       // for inout ports: what is read; `ports` has what is made
  std::vector<FunctionBinding> functions;  // one for each role that a shader or function text of it calls
  std::vector<std::string> serves;
  bool is_pruned = false;
  std::string reason;                   // why it stays or goes, for explain
  PassIndex reader = kNoIndex;          // whom the reason to stay names; kNoIndex: it makes something that is wanted
  std::vector<PassIndex> dependencies;  // passes that must run before it: producers of inputs, providers, their inputs
  std::vector<PassIndex> past_dependencies;  // passes of which it reads what they made in earlier frames
};

/// A pass that repeats others, and what it repeats.
struct GraphLoop {
  PassIndex pass = kNoIndex;
  std::vector<PassIndex> body;  // passes that see an overridden value, directly or not, and make what is gathered
  std::vector<std::pair<ResourceIndex, ResourceIndex>> overrides;  // what the body would have read, what it reads
  std::vector<ResourceIndex> gathers;
};

struct ResolvedGraph;
/// A job that inputs name.
struct GraphJob {
  std::string file;                            // as it was written
  std::shared_ptr<const ResolvedGraph> graph;  // sharers: copies of the graph that names it
};

struct ResolvedGraph {
  bool is_job = false;
  std::vector<GraphJob> jobs;
  std::string file;
  std::filesystem::path folder;
  std::uint32_t width = 0, height = 0;  // 0: a job that says no extent
  ResourceIndex output = kNoIndex;      // a job need not have one
  std::vector<Pass> passes;             // file order
  std::vector<Resource> resources;
  std::vector<GraphLoop> loops;      // of weave_loops
  std::vector<std::string> notes;    // e.g. "pass 'ao': technique none, its outputs are neutral"
  std::vector<Diagnostic> warnings;  // what is likely a mistake, but has a meaning
};

/// All name, type, range and unit errors are made here, all at once. Opens no library.
ResolvedGraph resolve(const WrittenGraph& written, const Registry& registry);
/// "ao.visibility" -> resource; throws Error with the nearest name. An output of a pass, or "scene.camera" ...
ResourceIndex find_resource(const ResolvedGraph& graph, std::string_view name);

// ---- prune ----------------------------------------------------------------------------------------------------------
/// Marks passes that nobody asked for (`wanted`: output and kept ports), and those whose scene features are missing
/// (`features`; their consumers then see neutral values: the port is removed from their `ports`). Says why for each.
void prune(ResolvedGraph& graph, std::span<const ResourceIndex> wanted, std::span<const std::string> features);

// ---- loops ----------------------------------------------------------------------------------------------------------
/// After prune: finds the body of every loop and binds the body's inputs to the overriding values. Throws Error where
/// two loops would repeat the same pass.
void weave_loops(ResolvedGraph& graph);

// ---- order ----------------------------------------------------------------------------------------------------------
struct ScheduledStage {
  PassIndex pass = kNoIndex;
  std::uint32_t stage = 0;  // index into technique->stages
  StageKind kind = StageKind::kGpu;
  bool splits_submission = false;  // a cpu stage that reads what the GPU made this frame
  bool is_read_back = false;       // only the copies of what the stage will read when its latency is over
  bool runs_once = false;          // in a loop's body, but only in its first iteration: a stage with latency
  // What the stage touches, functions of its shaders' providers included; several accesses of one resource are merged.
  struct Use {
    ResourceIndex resource = kNoIndex;
    std::uint32_t access = 0;  // HEDDLE_ACCESS_*
    bool reads = false, writes = false;
    std::uint32_t mask = 0;  // bit i: access i is among the merged ones; `access` has a layout that suits all of them
  };
  std::vector<Use> uses;
};
/// Stages [begin, end) run in each iteration of a loop, all others once.
struct ScheduledLoop {
  PassIndex pass = kNoIndex;
  std::uint32_t begin = 0, end = 0;
};
struct Order {
  std::vector<ScheduledStage> stages;
  std::vector<ScheduledLoop> loops;  // apart from each other, in order
};
/// One order for one graph: dependencies first, ties by the order in the file. Throws Error naming a cycle.
Order order(const ResolvedGraph& graph);
/// Orders that are all right: order's own first, then others, so that of every two stages which nothing puts in order
/// each is seen before the other. For tests of what declarations do not tell: bytes must not depend on the order.
struct OrderSet {
  std::vector<Order> orders;
  std::size_t unordered_pairs = 0, seen_both_ways = 0;
};
OrderSet find_orders(const ResolvedGraph& graph, std::size_t most);
/// What puts two stages in order, as a sentence: "'lighting' reads 'ao.visibility'"; empty: stages of one pass.
struct StageDependency {
  PassIndex from_pass = kNoIndex, to_pass = kNoIndex;
  std::uint32_t from_stage = 0, to_stage = 0;
  std::string why;
};
/// Everything that order obeys.
std::vector<StageDependency> stage_dependencies(const ResolvedGraph& graph);
/// The resource that owns the memory of a version: itself, or the first one of a chain of `inout` images or buffers.
ResourceIndex first_version(const ResolvedGraph& graph, ResourceIndex resource);
/// Images and buffers with a history that a stage reads: the memory of the newest (a first version) and the one of last
/// frame's. The two change places when a frame begins.
struct HistoryPair {
  ResourceIndex newest = kNoIndex, history = kNoIndex;
};
std::vector<HistoryPair> history_pairs(const ResolvedGraph& graph, const Order& order);
/// Every pass whose functions a shader (or function text) with these calls reaches, providers of providers included.
std::vector<PassIndex> reached_providers(const ResolvedGraph& graph, PassIndex caller,
                                         std::span<const std::string> calls);

// ---- alias ----------------------------------------------------------------------------------------------------------
struct MemoryNeed {  // of one image or buffer; from the driver
  std::uint64_t size = 0, alignment = 1;
};
struct Placement {
  static constexpr std::uint64_t kOwnMemory = ~0ULL;  // kept resources and those without memory
  std::vector<std::uint64_t> offset;                  // for each resource: into the one shared heap, or kOwnMemory
  std::uint64_t heap_size = 0;                        // with aliasing
  std::uint64_t unaliased_size = 0;                   // what the same resources would need each for itself
  std::uint64_t own_size = 0;                         // of the resources beside the heap: kept, or read after the frame
  // Pairs (stage, resource): at this stage's start the resource's memory was another's: contents are undefined, and a
  // barrier from the listed earlier users is due.
  struct Handover {
    std::uint32_t stage = 0;  // index into Order::stages
    ResourceIndex to = kNoIndex;
    std::vector<ResourceIndex> from;
  };
  std::vector<Handover> handovers;
};
/// `needs` is parallel to resources; size 0: has no memory of its own (values, surfaces, later versions).
/// `pinned`: never shared (kept, read after the frame). Offsets are multiples of max(alignment, 256).
Placement alias(const ResolvedGraph& graph, const Order& order, std::span<const MemoryNeed> needs,
                std::span<const ResourceIndex> pinned);

// ---- barriers -------------------------------------------------------------------------------------------------------
struct Barrier {
  ResourceIndex resource = kNoIndex;  // always the first version: the one with memory
  VkPipelineStageFlags2 source_stages = 0, target_stages = 0;
  VkAccessFlags2 source_access = 0, target_access = 0;
  VkImageLayout old_layout = VK_IMAGE_LAYOUT_UNDEFINED,
                new_layout = VK_IMAGE_LAYOUT_UNDEFINED;  // equal for buffers: UNDEFINED
};
struct BarrierPlan {
  std::vector<std::vector<Barrier>> before;  // for each scheduled stage; in a loop: of its first iteration
  std::vector<std::vector<Barrier>> again;   // for stages in loops: of all later iterations
  std::vector<Barrier> at_end;  // kept and wanted resources, to what the next frame's first use / read-back expects
  std::vector<VkImageLayout>
      first_layout;  // layout in which each resource enters a frame (UNDEFINED: contents not needed)
};
/// Where the host itself touches the heads of lists, by first versions; the first two parallel to Order::stages.
struct ListPlan {
  std::vector<std::vector<ResourceIndex>> emptied;  // before the stage's own commands, after its barriers
  std::vector<std::vector<ResourceIndex>> counted;  // after the stage's commands: nothing appends later
  std::vector<bool> goes_on;                        // by resource: emptied after a cut alone
};
ListPlan plan_lists(const ResolvedGraph& graph, const Order& order);
/// Layouts and stage masks of an access. Pure table.
struct AccessInfo {
  VkPipelineStageFlags2 stages = 0;
  VkAccessFlags2 access = 0;
  VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;
  bool reads = false, writes = false;
};
AccessInfo access_info(std::uint32_t access, PortType type, std::uint32_t format);
/// The union over the accesses of a use, in the one layout that suits them all. What execute writes into descriptors.
AccessInfo use_info(const ScheduledStage::Use& use, PortType type, std::uint32_t format);
/// Barriers of a stage come before everything that it records; of a cpu stage: before the copies from and to its
/// staging memory. `wanted` resources end the frame readable by transfers: images in TRANSFER_SRC_OPTIMAL. A kept image
/// is expected in first_layout when the first frame starts: execute clears it to the neutral value and leaves it there.
/// From declared accesses: read-after-write, write-after-read, write-after-write, layouts, memory hand-overs, and
/// across frames (kept resources, and the shared heap's last users before its first users of the next frame).
BarrierPlan plan_barriers(const ResolvedGraph& graph, const Order& order, const Placement& placement,
                          std::span<const ResourceIndex> wanted);

// ---- explain --------------------------------------------------------------------------------------------------------
/// is_live: frames are not waited for, so stages with latency take the newest copy that is there.
std::string explain_text(const ResolvedGraph& graph, const Order& order, const Placement& placement,
                         const BarrierPlan& barriers, bool is_live = false);
std::string explain_json(const ResolvedGraph& graph, const Order& order, const Placement& placement,
                         const BarrierPlan& barriers, bool is_live = false);
std::string explain_dot(const ResolvedGraph& graph, const Order& order);

}  // namespace heddle::graph
