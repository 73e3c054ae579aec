// SPDX-License-Identifier: Apache-2.0
// Passes that repeat others -> the passes that they repeat: between the values that are overridden and the inputs that
// are gathered. The body's inputs are bound to the overriding values.
#include <fmt/format.h>

#include <algorithm>

#include "graph/stages.hpp"
#include "graph/uses.hpp"

namespace heddle::graph {
namespace {

class Weaver {
 public:
  explicit Weaver(ResolvedGraph& graph)
      : graph_(graph), written_(graph.passes), owner_(graph.passes.size(), kNoIndex) {}

  void run() {
    for (PassIndex p = 0; p < graph_.passes.size(); ++p)
      if (!graph_.passes[p].is_pruned && graph_.passes[p].entry.technique->loop) weave(p);
  }

 private:
  void weave(PassIndex index) {
    Pass& pass = graph_.passes[index];
    const Loop& loop = *pass.entry.technique->loop;
    GraphLoop woven;
    woven.pass = index;
    for (const std::string& port : loop.gathers) {
      if (const auto source = pass.inout_sources.find(port); source != pass.inout_sources.end()) {
        woven.gathers.push_back(source->second);
      } else if (const auto bound = pass.ports.find(port); bound != pass.ports.end()) {
        woven.gathers.push_back(bound->second);
      }
    }
    const std::vector<bool> leads_there = makers(woven.gathers);
    std::vector<bool> is_body(graph_.passes.size(), false);
    for (const Loop::Override& one : loop.overrides) {
      const auto source = pass.ports.find(one.input);
      if (source == pass.ports.end()) continue;
      const std::pair change(source->second, pass.ports.at(one.output));
      woven.overrides.push_back(change);
      for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
        if (!leads_there[p] || p == index || p == graph_.resources[change.first].producer) continue;
        // Another loop may have given it its own value already; one that leads there too is refused below.
        if (owner_[p] != kNoIndex && !leads_there[owner_[p]] && reads(written_[p], change.first)) claim(p, index);
        if (rebind(graph_.passes[p], change.first, change.second)) is_body[p] = true;
      }
    }
    // Whoever needs a pass of the body and leads to what is gathered is in the body too.
    for (bool grows = true; grows;) {
      grows = false;
      for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
        if (is_body[p] || !leads_there[p] || p == index) continue;
        const auto& needs = graph_.passes[p].dependencies;
        is_body[p] = std::ranges::any_of(needs, [&](PassIndex need) { return is_body[need]; });
        grows = grows || is_body[p];
      }
    }
    for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
      if (!is_body[p]) continue;
      claim(p, index);
      woven.body.push_back(p);
    }
    if (woven.body.empty())
      graph_.notes.push_back(fmt::format("pass '{}': repeats no pass: nothing that it gathers depends on {}", pass.name,
                                         names_of(woven.overrides)));
    graph_.loops.push_back(std::move(woven));
  }

  /// Passes that the makers of these resources need, these makers included.
  [[nodiscard]] std::vector<bool> makers(const std::vector<ResourceIndex>& resources) const {
    std::vector<bool> found(graph_.passes.size(), false);
    std::vector<PassIndex> open;
    const auto add = [&](PassIndex p) {
      if (p == kNoIndex || found[p]) return;
      found[p] = true;
      open.push_back(p);
    };
    for (const ResourceIndex resource : resources) add(graph_.resources[resource].producer);
    while (!open.empty()) {
      const PassIndex p = open.back();
      open.pop_back();
      for (const PassIndex need : graph_.passes[p].dependencies) add(need);
    }
    return found;
  }

  [[nodiscard]] static bool reads(const Pass& pass, ResourceIndex resource) {
    const auto is_it = [&](const auto& bound) { return bound.second == resource; };
    return std::ranges::any_of(pass.ports, is_it) || std::ranges::any_of(pass.inout_sources, is_it);
  }

  /// Binds what reads `from` to `to`; a changed copy of `from` becomes one of `to`. True if anything did.
  bool rebind(Pass& pass, ResourceIndex from, ResourceIndex to) {
    bool is_changed = false;
    for (auto& [port, resource] : pass.ports) {
      if (resource != from) continue;
      resource = to;
      is_changed = true;
    }
    for (auto& [port, source] : pass.inout_sources) {
      if (source != from) continue;
      source = to;
      graph_.resources[pass.ports.at(port)].previous_version = to;
      is_changed = true;
    }
    return is_changed;
  }

  void claim(PassIndex p, PassIndex loop) {
    const Pass& repeated = graph_.passes[p];
    const Pass& owner = graph_.passes[loop];
    if (repeated.entry.technique->loop)
      throw Error(
          HEDDLE_UNSUPPORTED,
          Diagnostic{Severity::kError,
                     owner.where,
                     fmt::format("pass '{}' would repeat pass '{}', which is a loop itself", owner.name, repeated.name),
                     {},
                     "loops that stand apart from each other",
                     fmt::format("give one of them technique = \"none\", or bind inputs.{} of '{}' above '{}'",
                                 owner.entry.technique->loop->gathers.front(), owner.name, repeated.name)});
    if (owner_[p] != kNoIndex)
      throw Error(HEDDLE_UNSUPPORTED,
                  Diagnostic{Severity::kError,
                             owner.where,
                             fmt::format("passes '{}' and '{}' would both repeat pass '{}'",
                                         graph_.passes[owner_[p]].name, owner.name, repeated.name),
                             {},
                             "a pass in the body of one loop",
                             fmt::format("give one of the two technique = \"none\", or each a '{}' of its own",
                                         repeated.name)});
    owner_[p] = loop;
  }

  [[nodiscard]] std::string names_of(const std::vector<std::pair<ResourceIndex, ResourceIndex>>& overrides) const {
    std::string text;
    for (const auto& [from, to] : overrides)
      text += fmt::format("{}'{}'", text.empty() ? "" : ", ", graph_.resources[from].name);
    return text.empty() ? "what it overrides, which is absent" : text;
  }

  ResolvedGraph& graph_;
  const std::vector<Pass> written_;  // the passes before any loop
  std::vector<PassIndex> owner_;     // the loop that repeats a pass
};

}  // namespace

void weave_loops(ResolvedGraph& graph) {
  graph.loops.clear();
  Weaver(graph).run();
}

}  // namespace heddle::graph
