// SPDX-License-Identifier: Apache-2.0
// What the compiler decided and why -> text for a person, JSON for programs, DOT for Graphviz.
#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "graph/explain.hpp"
#include "graph/stages.hpp"
#include "graph/uses.hpp"
#include "json.hpp"

namespace heddle::graph {
namespace {

template <typename Flag, std::size_t kCount>
std::string flag_words(Flag flags, const std::array<std::pair<Flag, std::string_view>, kCount>& words) {
  std::string text;
  for (const auto& [flag, word] : words) {
    if ((flags & flag) != flag) continue;
    flags &= ~flag;
    text += fmt::format("{}{}", text.empty() ? "" : "+", word);
  }
  if (flags != 0) text += fmt::format("{}0x{:x}", text.empty() ? "" : "+", flags);
  return text.empty() ? "none" : text;
}

std::string stages_text(VkPipelineStageFlags2 stages) {
  static constexpr std::array<std::pair<VkPipelineStageFlags2, std::string_view>, 9> kWords{{
      {VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT, "draw_indirect"},
      {VK_PIPELINE_STAGE_2_INDEX_INPUT_BIT, "index_input"},
      {VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT, "vertex"},
      {VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT, "early_depth"},
      {VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT, "fragment"},
      {VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT, "late_depth"},
      {VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT, "color"},
      {VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, "compute"},
      {VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT, "transfer"},
  }};
  return flag_words(stages, kWords);
}

std::string access_text(VkAccessFlags2 access) {
  static constexpr std::array<std::pair<VkAccessFlags2, std::string_view>, 11> kWords{{
      {VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT, "indirect_read"},
      {VK_ACCESS_2_INDEX_READ_BIT, "index_read"},
      {VK_ACCESS_2_SHADER_SAMPLED_READ_BIT, "sampled_read"},
      {VK_ACCESS_2_SHADER_STORAGE_READ_BIT, "storage_read"},
      {VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT, "storage_write"},
      {VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT, "color_read"},
      {VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT, "color_write"},
      {VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT, "depth_read"},
      {VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT, "depth_write"},
      {VK_ACCESS_2_TRANSFER_READ_BIT, "transfer_read"},
      {VK_ACCESS_2_TRANSFER_WRITE_BIT, "transfer_write"},
  }};
  return flag_words(access, kWords);
}

std::string_view layout_text(VkImageLayout layout) {
  switch (layout) {
    case VK_IMAGE_LAYOUT_UNDEFINED:
      return "undefined";
    case VK_IMAGE_LAYOUT_GENERAL:
      return "general";
    case VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL:
      return "color_attachment";
    case VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL:
      return "depth_attachment";
    case VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL:
      return "depth_read_only";
    case VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL:
      return "shader_read_only";
    case VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL:
      return "transfer_src";
    case VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL:
      return "transfer_dst";
    default:
      return "other";
  }
}

std::string shape_text(const Resource& resource) {
  switch (resource.type) {
    case PortType::kValue:
      return "value";
    case PortType::kSurfaces:
      return "surfaces";
    case PortType::kArtifact:
      return resource.content.empty() ? "artifact" : fmt::format("artifact of {} bytes", resource.byte_size);
    case PortType::kReport:
      return "report";
    case PortType::kBuffer:
      if (resource.is_list())
        return fmt::format("list of at most {} elements of {} bytes", resource.capacity, resource.element_bytes);
      return fmt::format("buffer of {} bytes", resource.byte_size);
    case PortType::kImage:
      break;
  }
  std::string text = fmt::format("{} {} x {}", format_text(resource.format), resource.width, resource.height);
  if ((resource.flags & HEDDLE_PORT_CUBE) != 0)
    text += fmt::format(" x {} cubes", resource.layers / 6);
  else if (resource.layers > 1)
    text += fmt::format(" x {} layers", resource.layers);
  if (resource.mips > 1) text += fmt::format(", {} mips", resource.mips);
  return text;
}

std::string bytes_text(std::uint64_t bytes) {
  if (bytes < 1024) return fmt::format("{} B", bytes);
  if (bytes < 1024 * 1024) return fmt::format("{:.1f} KiB", static_cast<double>(bytes) / 1024);
  return fmt::format("{:.2f} MiB", static_cast<double>(bytes) / (1024 * 1024));
}

std::string_view join_text(Join join) {
  constexpr std::array<std::string_view, 3> kWords{"switch", "sum", "product"};
  return kWords.at(static_cast<std::size_t>(join));
}

std::string stage_text(const ResolvedGraph& graph, const ScheduledStage& scheduled) {
  const Pass& pass = graph.passes[scheduled.pass];
  return pass.name + "." + pass.entry.technique->stages[scheduled.stage].name;
}

/// How a cpu stage gets what the GPU made, and what that costs.
std::string waiting_text(const ResolvedGraph& graph, const ScheduledStage& scheduled, bool is_live) {
  const std::uint32_t latency = graph.passes[scheduled.pass].entry.technique->stages[scheduled.stage].latency;
  if (scheduled.is_read_back)
    return fmt::format("   copies to the host, for {} later",
                       latency == 1 ? "1 frame" : fmt::format("{} frames", latency));
  if (scheduled.splits_submission) return "   waits for the gpu: reads what it made this frame";
  if (latency > 0)
    return fmt::format("   waits for nothing: reads what the gpu made {} ago{}",
                       latency == 1 ? "1 frame" : fmt::format("{} frames", latency),
                       is_live ? ", or earlier if that is not there yet" : "");
  return {};
}

/// What the artifact of a cached stage depends on.
std::string cached_text(const ResolvedGraph& graph, const ScheduledStage& scheduled) {
  const Technique& technique = *graph.passes[scheduled.pass].entry.technique;
  const Stage& stage = technique.stages[scheduled.stage];
  if (!stage.cached_by) return {};
  std::vector<std::string> causes;
  for (const Access& access : stage.accesses)
    if (technique.find_port(access.port)->direction == Direction::kIn) causes.push_back(access.port);
  causes.insert(causes.end(), stage.cached_by->begin(), stage.cached_by->end());
  return fmt::format("   an artifact, kept on disk by {}",
                     causes.empty() ? "nothing but its code" : fmt::format("{}", fmt::join(causes, ", ")));
}

/// Lines before a stage where loops begin or have ended.
std::string loop_text(const ResolvedGraph& graph, const Order& order, std::uint32_t stage) {
  std::string text;
  for (const ScheduledLoop& loop : order.loops) {
    const std::string& name = graph.passes[loop.pass].name;
    if (loop.end == stage) text += fmt::format("       end of the loop of '{}'\n", name);
    if (loop.begin != stage) continue;
    const auto woven = std::ranges::find(graph.loops, loop.pass, &GraphLoop::pass);
    std::string overrides;
    std::string gathers;
    for (const auto& [from, to] : woven->overrides)
      overrides += fmt::format("{}'{}' for '{}'", overrides.empty() ? "" : ", ", graph.resources[to].name,
                               graph.resources[from].name);
    for (const ResourceIndex gathered : woven->gathers)
      gathers += fmt::format("{}'{}'", gathers.empty() ? "" : ", ", graph.resources[gathered].name);
    text += fmt::format("       loop of '{}', stages {} to {}: gives {}, gathers {}\n", name, loop.begin + 1, loop.end,
                        overrides, gathers);
  }
  return text;
}

std::vector<bool> used_resources(const ResolvedGraph& graph, const Order& order) {
  std::vector<bool> is_used(graph.resources.size(), false);
  for (const ScheduledStage& scheduled : order.stages)
    for (const auto& use : scheduled.uses) is_used[use.resource] = true;
  return is_used;
}

/// Of last frame's version: how it comes to be.
std::string history_text(const ResolvedGraph& graph, const Resource& history) {
  const Resource& newest = graph.resources[history.history_of];
  if (!has_memory(history.type)) return fmt::format("a copy of '{}' of the frame before", newest.name);
  const bool is_rewritten =
      (graph.resources[first_version(graph, history.history_of)].flags & HEDDLE_PORT_REWRITTEN) != 0;
  return fmt::format("kept, takes turns with '{}'{}", newest.name,
                     is_rewritten ? "" : ", which is copied back: its technique may write parts of it");
}

std::string memory_text(const ResolvedGraph& graph, const Placement& placement, ResourceIndex resource) {
  if (graph.resources[resource].history_of != kNoIndex) return history_text(graph, graph.resources[resource]);
  if (!has_memory(graph.resources[resource].type)) return "";
  const ResourceIndex first = first_version(graph, resource);
  if (first != resource) return fmt::format("in place of '{}'", graph.resources[first].name);
  if (placement.offset[resource] == Placement::kOwnMemory)
    return graph.resources[resource].is_kept ? "kept" : "own memory";
  return fmt::format("heap at {}", placement.offset[resource]);
}

std::string barrier_text(const ResolvedGraph& graph, const Barrier& barrier) {
  std::string text = fmt::format("'{}' {} ({}) -> {} ({})", graph.resources[barrier.resource].name,
                                 stages_text(barrier.source_stages), access_text(barrier.source_access),
                                 stages_text(barrier.target_stages), access_text(barrier.target_access));
  if (graph.resources[barrier.resource].type == PortType::kImage)
    text += fmt::format(", {} -> {}", layout_text(barrier.old_layout), layout_text(barrier.new_layout));
  return text;
}

Json barrier_json(const ResolvedGraph& graph, const Barrier& barrier) {
  return {{"resource", graph.resources[barrier.resource].name},  {"source_stages", stages_text(barrier.source_stages)},
          {"source_access", access_text(barrier.source_access)}, {"target_stages", stages_text(barrier.target_stages)},
          {"target_access", access_text(barrier.target_access)}, {"old_layout", layout_text(barrier.old_layout)},
          {"new_layout", layout_text(barrier.new_layout)}};
}

std::string dot_quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

}  // namespace

std::string format_text(std::uint32_t format) {
  static constexpr std::array<std::pair<VkFormat, std::string_view>, 21> kNames{{
      {VK_FORMAT_UNDEFINED, "undefined"},
      {VK_FORMAT_R8_UNORM, "r8"},
      {VK_FORMAT_R8G8_UNORM, "rg8"},
      {VK_FORMAT_R8G8B8A8_UNORM, "rgba8"},
      {VK_FORMAT_R8G8B8A8_SRGB, "rgba8_srgb"},
      {VK_FORMAT_A2B10G10R10_UNORM_PACK32, "rgb10a2"},
      {VK_FORMAT_R16_UNORM, "r16"},
      {VK_FORMAT_R16G16_UNORM, "rg16"},
      {VK_FORMAT_R16G16B16A16_UNORM, "rgba16"},
      {VK_FORMAT_R16G16_SNORM, "rg16_snorm"},
      {VK_FORMAT_R16_SFLOAT, "r16f"},
      {VK_FORMAT_R16G16_SFLOAT, "rg16f"},
      {VK_FORMAT_R16G16B16A16_SFLOAT, "rgba16f"},
      {VK_FORMAT_R32_UINT, "r32ui"},
      {VK_FORMAT_R32_SFLOAT, "r32f"},
      {VK_FORMAT_R32G32_SFLOAT, "rg32f"},
      {VK_FORMAT_R32G32B32A32_SFLOAT, "rgba32f"},
      {VK_FORMAT_B10G11R11_UFLOAT_PACK32, "r11g11b10f"},
      {VK_FORMAT_D16_UNORM, "d16"},
      {VK_FORMAT_D32_SFLOAT, "d32f"},
      {VK_FORMAT_D24_UNORM_S8_UINT, "d24s8"},
  }};
  for (const auto& [known, name] : kNames)
    if (known == static_cast<VkFormat>(format)) return std::string(name);
  return fmt::format("VkFormat {}", format);
}

std::string_view type_text(PortType type) {
  constexpr std::array<std::string_view, 6> kTypes{"image", "buffer", "value", "surfaces", "artifact", "report"};
  return kTypes.at(static_cast<std::size_t>(type));
}

std::string place_text(const Location& where) {
  // A setting is one line, and what it sets is said beside its place.
  if (where.line == 0 || where.file == "--set") return where.file;
  return fmt::format("{}:{}:{}", where.file, where.line, where.column);
}

std::string table_text(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line = "  ";
    for (std::size_t c = 0; c < row.size(); ++c)
      line += c + 1 < row.size() ? fmt::format("{:<{}}  ", row[c], widths[c]) : row[c];
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

Json to_json(const Parameter& parameter, const ParameterValue& value) {
  switch (parameter.type) {
    case ParameterType::kNames:
      return value.names;
    case ParameterType::kText:
      return value.names.empty() ? "" : value.names.front();
    case ParameterType::kBool:
      return value.number[0] != 0;
    case ParameterType::kChoice:
      return parameter.choices.at(static_cast<std::size_t>(value.number[0]));
    case ParameterType::kInt:
      return static_cast<std::int64_t>(value.number[0]);
    case ParameterType::kColor:
    case ParameterType::kFloat3:
      return value.number;
    case ParameterType::kFloat:
      return value.number[0];
  }
  return {};
}

namespace {

/// What kind of graph it is, and what it is for.
std::string head_text(const ResolvedGraph& graph) {
  const std::string output = graph.output == kNoIndex ? "" : graph.resources[graph.output].name;
  if (!graph.is_job)
    return fmt::format("{}: {} x {} pixels, output '{}'\n", graph.file, graph.width, graph.height, output);
  std::string text = fmt::format("{}: a job", graph.file);
  if (graph.width > 0) text += fmt::format(", {} x {} pixels", graph.width, graph.height);
  if (!output.empty()) text += fmt::format(", output '{}'", output);
  std::string made;
  for (const Resource& resource : graph.resources)
    if (lasts(resource.type) && !resource.port.empty() && resource.job == kNoIndex)
      made += fmt::format("{}'{}'", made.empty() ? "" : ", ", resource.name);
  if (!made.empty()) text += fmt::format("; keeps {}", made);
  return text + "\n";
}

/// Artifacts that jobs of other files make.
std::string jobs_text(const ResolvedGraph& graph) {
  std::vector<std::vector<std::string>> rows;
  for (const Resource& resource : graph.resources)
    if (resource.job != kNoIndex)
      rows.push_back({resource.name, fmt::format("made by '{}' of the job {}, unless the cache holds it",
                                                 resource.job_resource, graph.jobs[resource.job].graph->file)});
  return rows.empty() ? "" : "\nartifacts\n" + table_text(rows);
}

}  // namespace

std::string explain_text(const ResolvedGraph& graph, const Order& order, const Placement& placement,
                         const BarrierPlan& barriers, bool is_live) {
  std::string text = head_text(graph);
  if (is_live) text += "live: frames are not waited for, and no bytes are promised\n";

  text += "\npasses\n";
  std::vector<std::vector<std::string>> rows;
  for (const Pass& pass : graph.passes)
    rows.push_back({pass.is_pruned ? "dropped" : "kept", pass.name, pass.entry.technique->id, pass.reason});
  text += table_text(rows);
  for (const std::string& note : graph.notes) text += fmt::format("  note: {}\n", note);

  rows.clear();
  for (const Pass& pass : graph.passes) {
    if (pass.is_pruned) continue;
    for (const FunctionBinding& binding : pass.functions) {
      std::string providers;
      for (const PassIndex provider : binding.providers)
        providers += fmt::format("{}{}", providers.empty() ? "" : ", ", graph.passes[provider].name);
      rows.push_back({pass.name, "calls " + binding.role,
                      binding.providers.empty()       ? "the neutral answer"
                      : binding.providers.size() == 1 ? providers
                                                      : fmt::format("{} of {}", join_text(binding.join), providers)});
    }
  }
  if (!rows.empty()) text += "\nfunctions\n" + table_text(rows);
  text += jobs_text(graph);

  text += "\norder, with the barriers before each stage\n";
  const ListPlan lists = plan_lists(graph, order);
  for (std::uint32_t s = 0; s < order.stages.size(); ++s) {
    const ScheduledStage& scheduled = order.stages[s];
    text += loop_text(graph, order, s);
    text += fmt::format("  {:>3}  {} {}{}\n", s + 1, scheduled.kind == StageKind::kGpu ? "gpu" : "cpu",
                        stage_text(graph, scheduled),
                        waiting_text(graph, scheduled, is_live) + cached_text(graph, scheduled));
    rows.clear();
    for (const auto& use : scheduled.uses)
      rows.push_back({"      ",
                      use.reads && use.writes ? "changes"
                      : use.writes            ? "writes"
                                              : "reads",
                      graph.resources[use.resource].name, std::string(access_name(use.access))});
    text += table_text(rows);
    if (s < barriers.before.size())
      for (const Barrier& barrier : barriers.before[s])
        text += fmt::format("          barrier {}\n", barrier_text(graph, barrier));
    for (const ResourceIndex list : lists.emptied[s])
      text += fmt::format("          empties '{}'{}\n", graph.resources[list].name,
                          lists.goes_on[list] ? ", after a cut" : "");
    for (const ResourceIndex list : lists.counted[s])
      text += fmt::format("          counts  '{}', for the time after the frame\n", graph.resources[list].name);
    if (s < barriers.again.size())
      for (const Barrier& barrier : barriers.again[s])
        text += fmt::format("          again   {}\n", barrier_text(graph, barrier));
  }
  text += loop_text(graph, order, static_cast<std::uint32_t>(order.stages.size()));
  for (const Barrier& barrier : barriers.at_end)
    text += fmt::format("  end  barrier {}\n", barrier_text(graph, barrier));

  text += "\nresources\n";
  rows.clear();
  const std::vector<bool> is_used = used_resources(graph, order);
  for (ResourceIndex r = 0; r < graph.resources.size(); ++r)
    if (is_used[r])
      rows.push_back({graph.resources[r].name, shape_text(graph.resources[r]), memory_text(graph, placement, r)});
  text += table_text(rows);

  std::size_t barrier_count = barriers.at_end.size();
  for (const auto& list : barriers.before) barrier_count += list.size();
  for (const auto& list : barriers.again) barrier_count += list.size();
  const std::uint64_t shared = placement.heap_size + placement.own_size;
  const std::uint64_t apart = placement.unaliased_size + placement.own_size;
  text += "\npeak memory of images and buffers: ";
  text += apart == 0 ? "not known without a device\n"
                     : fmt::format("{}, {} without sharing; {} of it is kept or read afterwards\n", bytes_text(shared),
                                   bytes_text(apart), bytes_text(placement.own_size));
  text += fmt::format("{} stages, {} barriers\n", order.stages.size(), barrier_count);
  return text;
}

std::string explain_json(const ResolvedGraph& graph, const Order& order, const Placement& placement,
                         const BarrierPlan& barriers, bool is_live) {
  Json json;
  json["file"] = graph.file;
  json["kind"] = graph.is_job ? "job" : "frame";
  json["extent"] = {graph.width, graph.height};
  json["mode"] = is_live ? "live" : "repeatable";
  json["output"] = graph.output == kNoIndex ? Json() : Json(graph.resources[graph.output].name);
  json["notes"] = graph.notes;

  json["passes"] = Json::array();
  for (const Pass& pass : graph.passes) {
    Json entry{{"name", pass.name},
               {"role", pass.role->name},
               {"technique", pass.entry.technique->id},
               {"is_pruned", pass.is_pruned},
               {"reason", pass.reason}};
    entry["parameters"] = Json::object();
    for (std::size_t i = 0; i < pass.parameters.size(); ++i) {
      const Parameter& parameter = pass.entry.technique->parameters[i];
      entry["parameters"][parameter.name] = to_json(parameter, pass.parameters[i]);
    }
    entry["ports"] = Json::object();
    for (const auto& [port, resource] : pass.ports) entry["ports"][port] = graph.resources[resource].name;
    entry["changes"] = Json::object();
    for (const auto& [port, resource] : pass.inout_sources) entry["changes"][port] = graph.resources[resource].name;
    entry["functions"] = Json::array();
    for (const FunctionBinding& binding : pass.functions) {
      Json providers = Json::array();
      for (const PassIndex provider : binding.providers) providers.push_back(graph.passes[provider].name);
      entry["functions"].push_back(
          {{"role", binding.role}, {"join", join_text(binding.join)}, {"providers", providers}});
    }
    entry["serves"] = pass.serves;
    json["passes"].push_back(std::move(entry));
  }

  const auto names_of = [&](const std::vector<ResourceIndex>& resources) {
    Json names = Json::array();
    for (const ResourceIndex resource : resources) names.push_back(graph.resources[resource].name);
    return names;
  };
  const ListPlan lists = plan_lists(graph, order);
  const auto parted = [&](const std::vector<ResourceIndex>& of, bool goes_on) {
    std::vector<ResourceIndex> found;
    std::ranges::copy_if(of, std::back_inserter(found), [&](ResourceIndex r) { return lists.goes_on[r] == goes_on; });
    return found;
  };
  json["stages"] = Json::array();
  for (std::uint32_t s = 0; s < order.stages.size(); ++s) {
    const ScheduledStage& scheduled = order.stages[s];
    Json entry{{"pass", graph.passes[scheduled.pass].name},
               {"stage", graph.passes[scheduled.pass].entry.technique->stages[scheduled.stage].name},
               {"kind", scheduled.kind == StageKind::kGpu ? "gpu" : "cpu"},
               {"splits_submission", scheduled.splits_submission},
               {"latency", graph.passes[scheduled.pass].entry.technique->stages[scheduled.stage].latency},
               {"is_read_back", scheduled.is_read_back}};
    const auto& cached_by = graph.passes[scheduled.pass].entry.technique->stages[scheduled.stage].cached_by;
    entry["cached_by"] = cached_by ? Json(*cached_by) : Json();
    entry["uses"] = Json::array();
    for (const auto& use : scheduled.uses)
      entry["uses"].push_back({{"resource", graph.resources[use.resource].name},
                               {"access", access_name(use.access)},
                               {"reads", use.reads},
                               {"writes", use.writes}});
    entry["barriers"] = Json::array();
    if (s < barriers.before.size())
      for (const Barrier& barrier : barriers.before[s]) entry["barriers"].push_back(barrier_json(graph, barrier));
    if (const auto emptied = parted(lists.emptied[s], false); !emptied.empty()) entry["empties"] = names_of(emptied);
    if (const auto emptied = parted(lists.emptied[s], true); !emptied.empty())
      entry["empties_after_cut"] = names_of(emptied);
    if (!lists.counted[s].empty()) entry["counts"] = names_of(lists.counted[s]);
    if (s < barriers.again.size() && !barriers.again[s].empty()) {
      entry["barriers_again"] = Json::array();
      for (const Barrier& barrier : barriers.again[s]) entry["barriers_again"].push_back(barrier_json(graph, barrier));
    }
    json["stages"].push_back(std::move(entry));
  }
  json["loops"] = Json::array();
  for (const ScheduledLoop& loop : order.loops)
    json["loops"].push_back({{"pass", graph.passes[loop.pass].name}, {"begin", loop.begin}, {"end", loop.end}});
  json["barriers_at_end"] = Json::array();
  for (const Barrier& barrier : barriers.at_end) json["barriers_at_end"].push_back(barrier_json(graph, barrier));

  const std::vector<bool> is_used = used_resources(graph, order);
  json["resources"] = Json::array();
  for (ResourceIndex r = 0; r < graph.resources.size(); ++r) {
    const Resource& resource = graph.resources[r];
    Json entry{{"name", resource.name},
               {"type", type_text(resource.type)},
               {"is_used", static_cast<bool>(is_used[r])},
               {"is_kept", resource.is_kept},
               {"shape", shape_text(resource)}};
    if (resource.type == PortType::kImage) {
      entry["format"] = format_text(resource.format);
      entry["width"] = resource.width;
      entry["height"] = resource.height;
      entry["layers"] = resource.layers;
      entry["mips"] = resource.mips;
    }
    if (resource.is_list()) {
      entry["capacity"] = resource.capacity;
      entry["element_bytes"] = resource.element_bytes;
    }
    if (resource.job != kNoIndex)
      entry["made_by"] = {{"job", graph.jobs[resource.job].graph->file}, {"resource", resource.job_resource}};
    if (resource.history_of != kNoIndex) entry["history_of"] = graph.resources[resource.history_of].name;
    if (resource.previous_version != kNoIndex)
      entry["previous_version"] = graph.resources[resource.previous_version].name;
    if (has_memory(resource.type) && placement.offset[r] != Placement::kOwnMemory)
      entry["heap_offset"] = placement.offset[r];
    json["resources"].push_back(std::move(entry));
  }
  json["handovers"] = Json::array();
  for (const Placement::Handover& handover : placement.handovers) {
    Json from = Json::array();
    for (const ResourceIndex resource : handover.from) from.push_back(graph.resources[resource].name);
    json["handovers"].push_back(
        {{"stage", handover.stage}, {"to", graph.resources[handover.to].name}, {"from", std::move(from)}});
  }
  json["memory"] = {{"heap_bytes", placement.heap_size},
                    {"unaliased_bytes", placement.unaliased_size},
                    {"own_bytes", placement.own_size}};
  // Names come from files of other people: bytes that are no UTF-8 are replaced, not thrown about.
  return write_json(json, 2);
}

std::string explain_dot(const ResolvedGraph& graph, const Order& order) {
  std::string text =
      "digraph heddle {\n  rankdir=LR;\n  node [shape=box, style=\"rounded,filled\", fillcolor=white, "
      "fontname=Helvetica];\n  edge [fontname=Helvetica, fontsize=10];\n";
  std::vector<std::string> numbers(graph.passes.size());
  for (std::size_t s = 0; s < order.stages.size(); ++s) {
    std::string& list = numbers[order.stages[s].pass];
    list += fmt::format("{}{}", list.empty() ? "" : ", ", s + 1);
  }
  bool uses_scene = false;
  std::set<std::string> jobs;
  std::string edges;
  const auto add_edge = [&](const std::string& from, const std::string& to, const std::string& label, bool is_grey,
                            std::string_view style = {}) {
    edges += fmt::format("  {} -> {} [label={}{}{}];\n", dot_quoted(from), dot_quoted(to), dot_quoted(label), style,
                         is_grey ? ", color=grey, fontcolor=grey" : "");
  };
  constexpr std::string_view kFunction = ", style=dashed";
  constexpr std::string_view kHistory = ", style=dotted, constraint=false";
  for (PassIndex p = 0; p < graph.passes.size(); ++p) {
    const Pass& pass = graph.passes[p];
    text +=
        fmt::format("  {} [label=\"{}\\n{}{}\", tooltip={}{}];\n", dot_quoted(pass.name), pass.name,
                    pass.entry.technique->id, numbers[p].empty() ? "" : "\\nstage " + numbers[p],
                    dot_quoted(pass.reason), pass.is_pruned ? ", fillcolor=grey90, color=grey, fontcolor=grey" : "");
    const auto add_input = [&](ResourceIndex index) {
      const bool is_history = graph.resources[index].history_of != kNoIndex;
      const Resource& resource = graph.resources[is_history ? graph.resources[index].history_of : index];
      if (resource.producer == p && !is_history) return;
      const bool is_scene = resource.producer == kNoIndex;
      uses_scene = uses_scene || (is_scene && resource.job == kNoIndex);
      const bool is_of_job = resource.job != kNoIndex;
      if (is_of_job) jobs.insert(graph.jobs[resource.job].file);
      add_edge(is_of_job  ? graph.jobs[resource.job].file
               : is_scene ? "scene"
                          : graph.passes[resource.producer].name,
               pass.name, resource.port + (is_history ? "@previous" : ""), pass.is_pruned, is_history ? kHistory : "");
    };
    for (const auto& [port, resource] : pass.ports) add_input(resource);
    for (const auto& [port, resource] : pass.inout_sources) add_input(resource);
    for (const FunctionBinding& binding : pass.functions)
      for (const PassIndex provider : binding.providers)
        add_edge(graph.passes[provider].name, pass.name, binding.role + "()", pass.is_pruned, kFunction);
  }
  for (const std::string& job : jobs)
    text += fmt::format("  {} [shape=folder, fillcolor=lightyellow];\n", dot_quoted(job));
  if (uses_scene) text += "  \"scene\" [shape=ellipse, fillcolor=lightyellow];\n";
  if (graph.output != kNoIndex && graph.resources[graph.output].producer != kNoIndex) {
    text += "  \"output\" [shape=ellipse, fillcolor=lightblue];\n";
    add_edge(graph.passes[graph.resources[graph.output].producer].name, "output", graph.resources[graph.output].port,
             false);
  }
  return text + edges + "}\n";
}

}  // namespace heddle::graph
