// SPDX-License-Identifier: Apache-2.0
// Kept passes -> one sequence of their stages: what must come first comes first, ties by the order in the file.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "graph/stages.hpp"
#include "graph/uses.hpp"

namespace heddle::graph {
namespace {

using NodeIndex = std::uint32_t;

struct Node {
  ScheduledStage scheduled;
  std::vector<ScheduledStage::Use> from_functions;  // the part of the uses that functions of providers add
  std::vector<PassIndex> providers;
  bool is_early = false;  // a cpu stage that touches no image or buffer
};

struct Edge {
  NodeIndex from = 0;
  std::string why;  // "'lighting' reads 'ao.visibility'"
};

class Scheduler {
 public:
  explicit Scheduler(const ResolvedGraph& graph) : graph_(graph), nodes_of_(graph.passes.size()) {
    make_nodes();
    for (NodeIndex n = 0; n < nodes_.size(); ++n) connect(n);
  }

  /// Early stages first, then the order of the file.
  Order run() {
    check_function_cycles();
    return run_by([&](NodeIndex n) { return std::pair<std::uint32_t, NodeIndex>(nodes_[n].is_early ? 0 : 1, n); });
  }

  /// As few orders as a greedy choice finds that show every pair of stages which nothing puts in order both ways.
  OrderSet run_all(std::size_t most) {
    OrderSet set;
    const std::vector<std::vector<bool>> waits_for = find_reached();
    const auto count = static_cast<NodeIndex>(nodes_.size());
    std::set<std::pair<NodeIndex, NodeIndex>> unseen;  // (first, then): not yet seen in this order
    for (NodeIndex a = 0; a < count; ++a)
      for (NodeIndex b = 0; b < count; ++b)
        if (a != b && !waits_for[a][b] && !waits_for[b][a]) unseen.emplace(a, b);
    set.unordered_pairs = unseen.size() / 2;
    const auto take = [&](const Order& order) {
      for (std::size_t i = 0; i < sequence_.size(); ++i)
        for (std::size_t j = i + 1; j < sequence_.size(); ++j) unseen.erase({sequence_[i], sequence_[j]});
      set.orders.push_back(order);
    };
    take(run());
    while (!unseen.empty() && set.orders.size() < most) {
      // One pair decides: what the first needs goes to the front, what needs the second to the end, the rest backwards.
      const auto [first, then] = *unseen.begin();
      take(run_by([&, a = first, b = then](NodeIndex n) {
        const std::uint32_t part = n == a || waits_for[a][n] ? 0 : n == b || waits_for[n][b] ? 2 : 1;
        return std::pair(part, count - n);
      }));
    }
    std::set<std::pair<NodeIndex, NodeIndex>> half_seen;
    for (const auto& [a, b] : unseen) half_seen.emplace(std::min(a, b), std::max(a, b));
    set.seen_both_ways = set.unordered_pairs - half_seen.size();
    return set;
  }

  [[nodiscard]] std::vector<StageDependency> dependencies() const {
    std::vector<StageDependency> list;
    for (NodeIndex n = 0; n < nodes_.size(); ++n)
      for (const Edge& edge : edges_[n]) {
        const ScheduledStage& from = nodes_[edge.from].scheduled;
        const ScheduledStage& to = nodes_[n].scheduled;
        list.push_back({from.pass, to.pass, from.stage, to.stage, edge.why});
      }
    return list;
  }

 private:
  template <typename Key>
  Order run_by(const Key& key) {
    done_.clear();
    sequence_.clear();
    std::set<std::pair<std::uint32_t, NodeIndex>> ready;
    std::map<std::pair<std::uint32_t, NodeIndex>, NodeIndex> node_of;
    std::vector<std::size_t> waits(nodes_.size());
    std::vector<std::vector<NodeIndex>> followers(nodes_.size());
    for (NodeIndex n = 0; n < nodes_.size(); ++n) {
      std::set<NodeIndex> before;
      for (const Edge& edge : edges_[n]) before.insert(edge.from);
      waits[n] = before.size();
      for (const NodeIndex b : before) followers[b].push_back(n);
      node_of[key(n)] = n;
      if (before.empty()) ready.insert(key(n));
    }
    Order order;
    while (!ready.empty()) {
      const NodeIndex n = node_of[*ready.begin()];
      ready.erase(ready.begin());
      sequence_.push_back(n);
      order.stages.push_back(nodes_[n].scheduled);
      done_.insert(n);
      for (const NodeIndex follower : followers[n])
        if (--waits[follower] == 0) ready.insert(key(follower));
    }
    if (order.stages.size() != nodes_.size()) throw_cycle();
    mark_splits(order);
    return order;
  }

  /// [a][b]: a waits for b, through others too.
  [[nodiscard]] std::vector<std::vector<bool>> find_reached() const {
    std::vector<std::vector<bool>> reached(nodes_.size(), std::vector<bool>(nodes_.size(), false));
    const auto visit = [&](const auto& self, NodeIndex from, NodeIndex at) -> void {
      for (const Edge& edge : edges_[at]) {
        if (reached[from][edge.from]) continue;
        reached[from][edge.from] = true;
        self(self, from, edge.from);
      }
    };
    for (NodeIndex n = 0; n < nodes_.size(); ++n) visit(visit, n, n);
    return reached;
  }

  void make_nodes() {
    for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
      const Pass& pass = graph_.passes[p];
      if (pass.is_pruned) continue;
      const Technique& technique = *pass.entry.technique;
      for (std::uint32_t s = 0; s < technique.stages.size(); ++s) {
        Node node;
        node.scheduled.pass = p;
        node.scheduled.stage = s;
        node.scheduled.kind = technique.stages[s].kind;
        node.scheduled.uses = own_uses(graph_, p, s);
        const std::vector<std::string> calls = stage_calls(pass, s);
        node.providers = reached_providers(graph_, p, calls);
        // A cpu stage asks providers for services, which touch nothing on the GPU.
        if (node.scheduled.kind == StageKind::kGpu) node.from_functions = function_uses(graph_, p, calls);
        for (const auto& use : node.from_functions) merge_use(node.scheduled.uses, use);
        node.is_early =
            node.scheduled.kind == StageKind::kCpu && std::ranges::none_of(node.scheduled.uses, [&](const auto& use) {
              return has_memory(graph_.resources[use.resource].type);
            });
        nodes_of_[p].push_back(static_cast<NodeIndex>(nodes_.size()));
        nodes_.push_back(std::move(node));
      }
    }
    edges_.resize(nodes_.size());
  }

  [[nodiscard]] const std::string& name(PassIndex pass) const { return graph_.passes[pass].name; }

  /// Stages that write a version; if its producer says of none, all of them; without stages, those of the version
  /// before.
  [[nodiscard]] std::vector<NodeIndex> writers(ResourceIndex resource) const {
    while (true) {
      const Resource& r = graph_.resources[resource];
      if (r.producer == kNoIndex) return {};
      std::vector<NodeIndex> found;
      for (const NodeIndex n : nodes_of_[r.producer])
        if (std::ranges::any_of(nodes_[n].scheduled.uses,
                                [&](const auto& use) { return use.resource == resource && use.writes; }))
          found.push_back(n);
      if (found.empty()) found = nodes_of_[r.producer];
      if (!found.empty() || r.previous_version == kNoIndex) return found;
      resource = r.previous_version;
    }
  }

  void add_edge(NodeIndex from, NodeIndex to, std::string why) { edges_[to].push_back({from, std::move(why)}); }

  void connect(NodeIndex n) {
    const Node& node = nodes_[n];
    const PassIndex pass = node.scheduled.pass;
    if (node.scheduled.stage > 0) add_edge(n - 1, n, {});

    const auto read = [&](ResourceIndex resource) {
      if (graph_.resources[resource].producer == pass) return;
      for (const NodeIndex w : writers(resource))
        if (nodes_[w].scheduled.pass != pass)
          add_edge(w, n, fmt::format("'{}' reads '{}'", name(pass), graph_.resources[resource].name));
    };
    for (const auto& use : node.scheduled.uses) read(use.resource);
    for (const auto& [port, resource] : graph_.passes[pass].inout_sources) read(resource);
    // A value may be asked for without a declared access: it must be there.
    for (const auto& [port, resource] : graph_.passes[pass].ports)
      if (!has_memory(graph_.resources[resource].type)) read(resource);
    // Functions that read what this pass makes: only what its earlier stages made is there.
    for (const auto& use : node.from_functions) {
      if (graph_.resources[use.resource].producer != pass) continue;
      for (const NodeIndex w : writers(use.resource))
        if (w >= n)
          add_edge(
              w, n,
              fmt::format("'{}' calls a function that reads '{}'", name(pass), graph_.resources[use.resource].name));
    }
    for (const PassIndex provider : node.providers) {
      if (provider == pass || nodes_of_[provider].empty()) continue;
      add_edge(nodes_of_[provider].back(), n, fmt::format("'{}' calls functions of '{}'", name(pass), name(provider)));
    }
    // Whoever touches the version before a change in place comes before the change.
    for (const auto& use : node.scheduled.uses) {
      if (!has_memory(graph_.resources[use.resource].type)) continue;
      for (ResourceIndex later = 0; later < graph_.resources.size(); ++later) {
        const Resource& r = graph_.resources[later];
        if (r.previous_version != use.resource || r.producer == pass || graph_.passes[r.producer].is_pruned) continue;
        for (const NodeIndex w : writers(later))
          if (nodes_[w].scheduled.pass == r.producer)
            add_edge(n, w,
                     fmt::format("'{}' changes '{}', which '{}' reads", name(r.producer),
                                 graph_.resources[use.resource].name, name(pass)));
      }
    }
  }

  /// Texts that call each other in a circle cannot be joined: GLSL has no recursion.
  void check_function_cycles() const {
    enum : std::uint8_t { kNew, kOpen, kClosed };
    std::vector<std::uint8_t> state(graph_.passes.size(), kNew);
    std::vector<PassIndex> path;
    const auto visit = [&](const auto& self, PassIndex p) -> void {
      state[p] = kOpen;
      path.push_back(p);
      for (const Function& function : graph_.passes[p].entry.technique->functions)
        for (const std::string& role : function.calls)
          for (const FunctionBinding& binding : graph_.passes[p].functions)
            if (binding.role == role)
              for (const PassIndex q : binding.providers) {
                if (state[q] == kOpen) {
                  std::vector<PassIndex> circle(std::ranges::find(path, q), path.end());
                  circle.push_back(q);
                  std::string why;
                  for (std::size_t i = 0; i + 1 < circle.size(); ++i)
                    why += (why.empty() ? "" : "; ") +
                           fmt::format("'{}' calls functions of '{}'", name(circle[i]), name(circle[i + 1]));
                  report(circle, why);
                }
                if (state[q] == kNew) self(self, q);
              }
      path.pop_back();
      state[p] = kClosed;
    };
    for (PassIndex p = 0; p < graph_.passes.size(); ++p)
      if (state[p] == kNew && !graph_.passes[p].is_pruned) visit(visit, p);
  }

  [[noreturn]] void throw_cycle() const {
    // Every remaining node waits for another remaining one: walk back until a node is met again.
    NodeIndex n = 0;
    while (done_.contains(n)) ++n;
    std::vector<NodeIndex> walked;
    std::vector<std::string> reasons;
    while (std::ranges::find(walked, n) == walked.end()) {
      walked.push_back(n);
      const auto edge = std::ranges::find_if(edges_[n], [&](const Edge& e) { return !done_.contains(e.from); });
      reasons.push_back(edge->why);
      n = edge->from;
    }
    const auto begin = static_cast<std::size_t>(std::ranges::find(walked, n) - walked.begin());
    // Walked against the arrows, so the order of execution is the reverse; it starts at the pass written first.
    std::vector<PassIndex> circle;
    std::vector<std::string> why;
    for (std::size_t i = walked.size(); i-- > begin;) {
      const PassIndex pass = nodes_[walked[i]].scheduled.pass;
      if (circle.empty() || circle.back() != pass) circle.push_back(pass);
      if (!reasons[i].empty()) why.push_back(reasons[i]);
    }
    if (circle.size() > 1 && circle.front() == circle.back()) circle.pop_back();
    std::ranges::rotate(circle, std::ranges::min_element(circle));
    circle.push_back(circle.front());
    std::ranges::sort(why);
    std::string text;
    for (const std::string& reason : why) text += (text.empty() ? "" : "; ") + reason;
    report(circle, text);
  }

  [[noreturn]] void report(const std::vector<PassIndex>& circle, const std::string& why) const {
    std::string chain;
    for (const PassIndex pass : circle) chain += (chain.empty() ? "" : " -> ") + name(pass);
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             graph_.passes[circle.front()].where,
                                             "these passes wait for each other: " + chain,
                                             why,
                                             {},
                                             "bind one of these inputs to another pass, or to \"none\""});
  }

  /// Mapping for the host what was made on the GPU in this frame needs the GPU to be done.
  void mark_splits(Order& order) const {
    std::set<ResourceIndex> made;
    for (ScheduledStage& scheduled : order.stages) {
      for (const auto& use : scheduled.uses) {
        if (!has_memory(graph_.resources[use.resource].type)) continue;
        const bool reads_on_host = (use.mask & (1U << HEDDLE_ACCESS_HOST_READ)) != 0;
        if (scheduled.kind == StageKind::kCpu && reads_on_host && made.contains(first_version(graph_, use.resource)))
          scheduled.splits_submission = true;
      }
      for (const auto& use : scheduled.uses)
        if (use.writes && has_memory(graph_.resources[use.resource].type))
          made.insert(first_version(graph_, use.resource));
    }
  }

  const ResolvedGraph& graph_;
  std::vector<Node> nodes_;
  std::vector<std::vector<NodeIndex>> nodes_of_;  // by pass
  std::vector<std::vector<Edge>> edges_;          // by the node that waits
  std::set<NodeIndex> done_;
  std::vector<NodeIndex> sequence_;  // of the last run
};

}  // namespace

Order order(const ResolvedGraph& graph) {
  return Scheduler(graph).run();
}

std::vector<StageDependency> stage_dependencies(const ResolvedGraph& graph) {
  return Scheduler(graph).dependencies();
}

OrderSet find_orders(const ResolvedGraph& graph, std::size_t most) {
  return Scheduler(graph).run_all(most);
}

}  // namespace heddle::graph
