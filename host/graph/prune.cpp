// SPDX-License-Identifier: Apache-2.0
// What is wanted + what the scene has -> which passes stay, and for each the reason, as a sentence.
#include <fmt/format.h>

#include <algorithm>

#include "graph/stages.hpp"
#include "graph/uses.hpp"

namespace heddle::graph {
namespace {

/// Takes a pass out whose features the scene lacks: readers of what it changed see what was there before, readers of
/// what it makes anew see nothing, and callers lose it as a provider.
void detach(ResolvedGraph& graph, PassIndex gone) {
  const auto replace = [&](ResourceIndex resource) {
    while (resource != kNoIndex && graph.resources[resource].producer == gone)
      resource = graph.resources[resource].previous_version;
    return resource;
  };
  for (Resource& resource : graph.resources)
    if (resource.previous_version != kNoIndex && resource.producer != gone)
      resource.previous_version = replace(resource.previous_version);
  // The same for readers of last frame's.
  std::vector<bool> is_lost(graph.resources.size(), false);
  for (ResourceIndex r = 0; r < graph.resources.size(); ++r) {
    Resource& history = graph.resources[r];
    if (history.history_of == kNoIndex || graph.resources[history.history_of].producer != gone) continue;
    history.history_of = replace(history.history_of);
    const bool has_history =
        history.history_of != kNoIndex && (!has_memory(history.type) || is_kept(graph, history.history_of));
    if (has_history) history.name = graph.resources[history.history_of].name + "@previous";
    is_lost[r] = !has_history;
  }
  for (PassIndex p = 0; p < graph.passes.size(); ++p) {
    if (p == gone) continue;
    Pass& pass = graph.passes[p];
    for (auto* ports : {&pass.ports, &pass.inout_sources}) {
      for (auto port = ports->begin(); port != ports->end();) {
        port->second = is_lost[port->second] ? kNoIndex : replace(port->second);
        port = port->second == kNoIndex ? ports->erase(port) : std::next(port);
      }
    }
    for (FunctionBinding& binding : pass.functions) std::erase(binding.providers, gone);
  }
}

std::string first_missing(const Technique& technique, std::span<const std::string> features) {
  for (const std::string& feature : technique.features)
    if (std::ranges::find(features, feature) == features.end()) return feature;
  return {};
}

/// Why `user` needs `made`: one of its inputs, a function, or an input of a function.
std::string reason_for(const ResolvedGraph& graph, PassIndex made, PassIndex user) {
  const Pass& pass = graph.passes[user];
  for (const auto* ports : {&pass.ports, &pass.inout_sources})
    for (const auto& [name, resource] : *ports)
      if (graph.resources[resource].producer == made)
        return fmt::format("makes '{}' for '{}'", graph.resources[resource].name, pass.name);
  const std::vector<std::string> calls = all_calls(*pass.entry.technique);
  for (const FunctionBinding& binding : pass.functions)
    if (std::ranges::find(binding.providers, made) != binding.providers.end())
      return fmt::format("answers '{}' for '{}'", binding.role, pass.name);
  for (const auto& use : function_uses(graph, user, calls))
    if (graph.resources[use.resource].producer == made)
      return fmt::format("makes '{}' for functions that '{}' calls", graph.resources[use.resource].name, pass.name);
  return fmt::format("answers functions that '{}' calls through another", pass.name);
}

/// Why `user` needs what `made` made in an earlier frame.
std::string past_reason_for(const ResolvedGraph& graph, PassIndex made, PassIndex user) {
  for (const auto& [name, resource] : graph.passes[user].ports) {
    const ResourceIndex newest = graph.resources[resource].history_of;
    if (newest != kNoIndex && graph.resources[newest].producer == made)
      return fmt::format("makes '{}', whose last version '{}' reads", graph.resources[newest].name,
                         graph.passes[user].name);
    if (graph.resources[resource].producer == made)
      return fmt::format("makes '{}', which '{}' reads some frames later", graph.resources[resource].name,
                         graph.passes[user].name);
  }
  return fmt::format("made what '{}' reads", graph.passes[user].name);
}

std::string outputs_of(const ResolvedGraph& graph, PassIndex pass) {
  std::string text;
  for (const Resource& resource : graph.resources)
    if (resource.producer == pass) text += fmt::format("{}'{}'", text.empty() ? "" : ", ", resource.name);
  return text;
}

std::string why_dropped(const ResolvedGraph& graph, PassIndex dropped) {
  std::string users;
  for (PassIndex p = 0; p < graph.passes.size(); ++p) {
    const auto needs = [&](const std::vector<PassIndex>& list) {
      return std::ranges::find(list, dropped) != list.end();
    };
    if (p != dropped && (needs(graph.passes[p].dependencies) || needs(graph.passes[p].past_dependencies)))
      users += fmt::format("{}'{}'", users.empty() ? "" : ", ", graph.passes[p].name);
  }
  if (!users.empty()) return fmt::format("only {} would use it, and nobody asks for that", users);
  const std::string outputs = outputs_of(graph, dropped);
  const bool has_functions = !graph.passes[dropped].entry.technique->functions.empty();
  if (outputs.empty()) return has_functions ? "nobody calls its functions" : "it makes nothing";
  return fmt::format("nobody asks for {}{}", outputs, has_functions ? " or calls its functions" : "");
}

}  // namespace

void prune(ResolvedGraph& graph, std::span<const ResourceIndex> wanted, std::span<const std::string> features) {
  for (Pass& pass : graph.passes) {
    pass.is_pruned = true;
    pass.reason.clear();
    pass.reader = kNoIndex;
  }
  for (PassIndex p = 0; p < graph.passes.size(); ++p) {
    Pass& pass = graph.passes[p];
    const std::string missing = first_missing(*pass.entry.technique, features);
    if (missing.empty()) continue;
    pass.reason = fmt::format("the scene has no '{}'", missing);
    if (graph.output != kNoIndex && graph.resources[graph.output].producer == p)
      throw Error(
          HEDDLE_BAD_INPUT,
          Diagnostic{Severity::kError,
                     pass.where,
                     fmt::format("pass '{}' makes the graph's output, but the scene has nothing for it", pass.name),
                     {},
                     fmt::format("a scene with '{}'", missing),
                     {}});
    detach(graph, p);
  }
  for (PassIndex p = 0; p < graph.passes.size(); ++p) {
    graph.passes[p].dependencies = find_dependencies(graph, p);
    graph.passes[p].past_dependencies = find_past_dependencies(graph, p);
  }

  // From what is wanted back to what it needs; the first user met is the reason.
  std::vector<PassIndex> open;
  const auto keep = [&](PassIndex p, PassIndex reader, const auto& reason) {
    Pass& pass = graph.passes[p];
    if (!pass.is_pruned || !pass.reason.empty()) return;
    pass.reason = reason();
    pass.reader = reader;
    pass.is_pruned = false;
    open.push_back(p);
  };
  for (const ResourceIndex resource : wanted) {
    const Resource& r = graph.resources[resource];
    if (r.producer == kNoIndex) continue;
    keep(r.producer, kNoIndex, [&] {
      return resource == graph.output ? fmt::format("makes the output '{}'", r.name)
                                      : fmt::format("makes '{}', which is asked for", r.name);
    });
  }
  for (std::size_t i = 0; i < open.size(); ++i) {
    for (const PassIndex dependency : graph.passes[open[i]].dependencies)
      keep(dependency, open[i], [&] { return reason_for(graph, dependency, open[i]); });
    for (const PassIndex dependency : graph.passes[open[i]].past_dependencies)
      keep(dependency, open[i], [&] { return past_reason_for(graph, dependency, open[i]); });
  }

  for (PassIndex p = 0; p < graph.passes.size(); ++p)
    if (graph.passes[p].is_pruned && graph.passes[p].reason.empty()) graph.passes[p].reason = why_dropped(graph, p);

  // An image that a later pass changes in place is not there any more when the frame ends.
  for (const ResourceIndex resource : wanted) {
    if (!has_memory(graph.resources[resource].type)) continue;
    for (const Resource& later : graph.resources)
      if (later.previous_version == resource && !graph.passes[later.producer].is_pruned)
        throw Error(HEDDLE_BAD_INPUT,
                    Diagnostic{Severity::kError,
                               graph.passes[later.producer].where,
                               fmt::format("'{}' cannot be read after the frame: pass '{}' changes it in place",
                                           graph.resources[resource].name, graph.passes[later.producer].name),
                               {},
                               {},
                               fmt::format("ask for '{}'", later.name)});
  }

  // The same in the next frame.
  for (const Pass& pass : graph.passes) {
    if (pass.is_pruned) continue;
    for (const auto& [port, history] : pass.ports) {
      const ResourceIndex newest = graph.resources[history].history_of;
      if (newest == kNoIndex || !has_memory(graph.resources[newest].type)) continue;
      for (const Resource& later : graph.resources)
        if (later.previous_version == newest && !graph.passes[later.producer].is_pruned)
          throw Error(
              HEDDLE_BAD_INPUT,
              Diagnostic{Severity::kError,
                         pass.where,
                         fmt::format("pass '{}': inputs.{}: '{}' is gone by the next frame: pass '{}' changes it "
                                     "in place",
                                     pass.name, port, graph.resources[newest].name, graph.passes[later.producer].name),
                         {},
                         {},
                         fmt::format("read \"{}@previous\"", later.name)});
    }
  }
}

}  // namespace heddle::graph
