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
  bool is_early = false;          // a cpu stage that touches no image or buffer
  std::uint32_t loop = kNoIndex;  // index into ResolvedGraph::loops: runs in each of its iterations
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
    followers_.resize(nodes_.size());
    for (NodeIndex n = 0; n < nodes_.size(); ++n) {
      std::set<NodeIndex> before;
      for (const Edge& edge : edges_[n]) before.insert(edge.from);
      for (const NodeIndex b : before) followers_[b].push_back(n);
    }
    find_bodies();
  }

  /// Early stages first, then the order of the file; loops when all else that can come before them has.
  Order run() {
    check_function_cycles();
    check_stage_cycles();
    return run_by([&](NodeIndex n) {
      const std::uint32_t part = (nodes_[n].loop != kNoIndex ? 2U : 0U) + (nodes_[n].is_early ? 0U : 1U);
      return std::pair(part, n);
    });
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
    sequence_.clear();
    std::set<std::pair<std::uint32_t, NodeIndex>> ready;
    std::map<std::pair<std::uint32_t, NodeIndex>, NodeIndex> node_of;
    std::vector<std::size_t> waits(nodes_.size());
    for (NodeIndex n = 0; n < nodes_.size(); ++n) {
      for (const NodeIndex follower : followers_[n]) ++waits[follower];
      node_of[key(n)] = n;
    }
    for (NodeIndex n = 0; n < nodes_.size(); ++n)
      if (waits[n] == 0) ready.insert(key(n));
    // A loop's stages follow each other without a gap: it begins when everything that they wait for is done.
    std::vector<std::size_t> waits_outside(graph_.loops.size());
    std::vector<std::size_t> left(graph_.loops.size());
    for (NodeIndex n = 0; n < nodes_.size(); ++n) {
      if (nodes_[n].loop != kNoIndex) ++left[nodes_[n].loop];
      for (const NodeIndex follower : followers_[n])
        if (nodes_[follower].loop != kNoIndex && nodes_[follower].loop != nodes_[n].loop)
          ++waits_outside[nodes_[follower].loop];
    }
    std::uint32_t loop = kNoIndex;  // open: its stages were begun and not ended
    const auto may_come = [&](const auto& candidate) {
      const std::uint32_t of = nodes_[node_of.at(candidate)].loop;
      return loop != kNoIndex ? of == loop : of == kNoIndex || waits_outside[of] == 0;
    };
    Order order;
    while (!ready.empty()) {
      const auto chosen = std::ranges::find_if(ready, may_come);
      if (chosen == ready.end()) throw_tangled_loops(waits_outside, left);
      const NodeIndex n = node_of.at(*chosen);
      ready.erase(chosen);
      sequence_.push_back(n);
      if (loop == kNoIndex && nodes_[n].loop != kNoIndex) {
        loop = nodes_[n].loop;
        order.loops.push_back({graph_.loops[loop].pass, static_cast<std::uint32_t>(order.stages.size()), 0});
      }
      order.stages.push_back(nodes_[n].scheduled);
      for (const NodeIndex follower : followers_[n]) {
        const std::uint32_t of = nodes_[follower].loop;
        if (of != kNoIndex && of != nodes_[n].loop) --waits_outside[of];
        if (--waits[follower] == 0) ready.insert(key(follower));
      }
      if (loop != kNoIndex && --left[loop] == 0) {
        order.loops.back().end = static_cast<std::uint32_t>(order.stages.size());
        loop = kNoIndex;
      }
    }
    mark_splits(order);
    check_loops(order);
    return order;
  }

  /// [a][b]: a waits for b, through others too; for all of a loop if for one of it.
  [[nodiscard]] std::vector<std::vector<bool>> find_reached() const {
    std::vector<std::vector<NodeIndex>> together(graph_.loops.size());
    for (NodeIndex n = 0; n < nodes_.size(); ++n)
      if (nodes_[n].loop != kNoIndex) together[nodes_[n].loop].push_back(n);
    const auto all_with = [&](NodeIndex n) {
      return nodes_[n].loop != kNoIndex ? together[nodes_[n].loop] : std::vector<NodeIndex>{n};
    };
    std::vector<std::set<NodeIndex>> before(nodes_.size());
    for (NodeIndex n = 0; n < nodes_.size(); ++n) {
      for (const Edge& edge : edges_[n]) {
        const std::uint32_t loop = nodes_[n].loop;
        if (loop != kNoIndex && nodes_[edge.from].loop == loop) {
          before[n].insert(edge.from);
          continue;
        }
        for (const NodeIndex later : all_with(n))
          for (const NodeIndex earlier : all_with(edge.from)) before[later].insert(earlier);
      }
    }
    std::vector<std::vector<bool>> reached(nodes_.size(), std::vector<bool>(nodes_.size(), false));
    const auto visit = [&](const auto& self, NodeIndex from, NodeIndex at) -> void {
      for (const NodeIndex earlier : before[at]) {
        if (reached[from][earlier]) continue;
        reached[from][earlier] = true;
        self(self, from, earlier);
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
        if (!is_scheduled(pass, technique.stages[s])) continue;
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
    // Copies for stages with latency stand apart from their passes, and come after everything that has no reason to
    // wait for them.
    for (NodeIndex n = 0, count = static_cast<NodeIndex>(nodes_.size()); n < count; ++n) {
      Node copies;
      copies.scheduled = nodes_[n].scheduled;
      copies.scheduled.uses = late_uses(graph_, copies.scheduled.pass, copies.scheduled.stage);
      if (copies.scheduled.uses.empty()) continue;
      copies.scheduled.kind = StageKind::kGpu;
      copies.scheduled.is_read_back = true;
      nodes_.push_back(std::move(copies));
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
    const bool is_read_back = node.scheduled.is_read_back;
    if (n != nodes_of_[pass].front() && !is_read_back) add_edge(n - 1, n, {});

    const auto read = [&](ResourceIndex resource) {
      if (graph_.resources[resource].producer == pass && !is_read_back) return;
      for (const NodeIndex w : writers(resource))
        if (nodes_[w].scheduled.pass != pass || is_read_back)
          add_edge(w, n, fmt::format("'{}' reads '{}'", name(pass), graph_.resources[resource].name));
    };
    for (const auto& use : node.scheduled.uses) {
      read(use.resource);
      connect_written_by_functions(n, use.resource);
    }
    if (!is_read_back) connect_ports(n, read);
    // Whoever touches the version before a change in place comes before the change.
    for (const auto& use : node.scheduled.uses) {
      if (!has_memory(graph_.resources[use.resource].type)) continue;
      for (ResourceIndex later = 0; later < graph_.resources.size(); ++later) {
        const Resource& r = graph_.resources[later];
        if (r.previous_version != use.resource || graph_.passes[r.producer].is_pruned) continue;
        if (r.producer == pass && !is_read_back) continue;
        for (const NodeIndex w : writers(later))
          if (nodes_[w].scheduled.pass == r.producer)
            add_edge(n, w,
                     fmt::format("'{}' changes '{}', which '{}' reads", name(r.producer),
                                 graph_.resources[use.resource].name, name(pass)));
      }
    }
  }

  /// What functions write on behalf of their callers is complete for others when the callers are done: for copies to
  /// the host and for other passes. The maker's own stages stand before all callers, and see what the last frame left.
  void connect_written_by_functions(NodeIndex n, ResourceIndex resource) {
    const Node& node = nodes_[n];
    const auto of_resource = [&](const auto& use) { return use.resource == resource; };
    const bool is_own = graph_.resources[resource].producer == node.scheduled.pass && !node.scheduled.is_read_back;
    if (is_own || std::ranges::any_of(node.from_functions, of_resource)) return;
    for (NodeIndex caller = 0; caller < nodes_.size(); ++caller) {
      if (caller == n || nodes_[caller].scheduled.is_read_back) continue;
      const auto writes = [&](const auto& use) { return of_resource(use) && use.writes; };
      if (std::ranges::any_of(nodes_[caller].from_functions, writes))
        add_edge(caller, n,
                 fmt::format("'{}' calls a function that writes '{}'", name(nodes_[caller].scheduled.pass),
                             graph_.resources[resource].name));
    }
  }

  /// Nodes of each loop: its own stages of an iteration, and what lies on a way from the first to the last of them.
  void find_bodies() {
    for (std::uint32_t l = 0; l < graph_.loops.size(); ++l) {
      std::vector<NodeIndex> own;
      const Technique& technique = *graph_.passes[graph_.loops[l].pass].entry.technique;
      for (const NodeIndex n : nodes_of_[graph_.loops[l].pass])
        if (technique.stages[nodes_[n].scheduled.stage].loop_part != HEDDLE_LOOP_OUTSIDE) own.push_back(n);
      const auto reach = [&](const auto& neighbours) {
        std::set<NodeIndex> found;
        std::vector<NodeIndex> open = own;
        while (!open.empty()) {
          const NodeIndex n = open.back();
          open.pop_back();
          neighbours(n, [&](NodeIndex other) {
            if (found.insert(other).second) open.push_back(other);
          });
        }
        return found;
      };
      const std::set<NodeIndex> below = reach([&](NodeIndex n, const auto& visit) {
        for (const NodeIndex follower : followers_[n]) visit(follower);
      });
      const std::set<NodeIndex> above = reach([&](NodeIndex n, const auto& visit) {
        for (const Edge& edge : edges_[n]) visit(edge.from);
      });
      for (const NodeIndex n : own) nodes_[n].loop = l;
      for (const NodeIndex n : below) {
        if (!above.contains(n)) continue;
        Node& node = nodes_[n];
        node.loop = l;
        const Stage& stage = graph_.passes[node.scheduled.pass].entry.technique->stages[node.scheduled.stage];
        node.scheduled.runs_once = stage.latency > 0;
      }
    }
  }

  /// What an iteration would do a second time to the same memory.
  void check_loops(const Order& order) const {
    for (const ScheduledLoop& loop : order.loops) {
      std::set<ResourceIndex> seen;
      for (std::uint32_t s = loop.begin; s < loop.end; ++s) {
        const ScheduledStage& scheduled = order.stages[s];
        if (scheduled.pass == loop.pass) continue;
        for (const auto& use : scheduled.uses) {
          if (!has_memory(graph_.resources[use.resource].type)) continue;
          const ResourceIndex first = first_version(graph_, use.resource);
          const bool is_first = seen.insert(first).second;
          if (use.writes && is_written(order, first, 0, loop.begin)) {
            refuse_in_loop(loop, scheduled, use.resource, "changes", ", which is made before the loop",
                           "what an iteration changes is made in it");
          }
          // A list of which each frame makes all is empty before its first use.
          const bool is_fresh_list =
              graph_.resources[first].is_list() && (graph_.resources[first].flags & HEDDLE_PORT_REWRITTEN) != 0;
          const bool is_own =
              !is_fresh_list && is_kept(graph_, first) && is_written(order, first, loop.begin, loop.end);
          if (is_first && use.reads && is_own) {
            refuse_in_loop(loop, scheduled, use.resource, "keeps its state in", " in place",
                           "what lasts is read by @previous, which stands still in a loop");
          }
        }
      }
    }
  }

  [[nodiscard]] bool is_written(const Order& order, ResourceIndex first, std::uint32_t begin, std::uint32_t end) const {
    for (std::uint32_t s = begin; s < end; ++s)
      for (const auto& use : order.stages[s].uses)
        if (use.writes && first_version(graph_, use.resource) == first) return true;
    return false;
  }

  [[noreturn]] void refuse_in_loop(const ScheduledLoop& loop, const ScheduledStage& scheduled, ResourceIndex resource,
                                   std::string_view does, std::string_view how, std::string_view expected) const {
    throw Error(
        HEDDLE_UNSUPPORTED,
        Diagnostic{Severity::kError,
                   graph_.passes[scheduled.pass].where,
                   fmt::format("pass '{}' {} '{}'{}, and the loop of pass '{}' would do so in each iteration",
                               name(scheduled.pass), does, graph_.resources[resource].name, how, name(loop.pass)),
                   {},
                   std::string(expected),
                   fmt::format("put pass '{0}' behind '{1}', or give '{1}' technique = \"none\"", name(scheduled.pass),
                               name(loop.pass))});
  }

  /// What a stage's pass needs beyond the stage's own uses.
  template <typename Read>
  void connect_ports(NodeIndex n, const Read& read) {
    const Node& node = nodes_[n];
    const PassIndex pass = node.scheduled.pass;
    const Technique& technique = *graph_.passes[pass].entry.technique;
    const auto touches = [&](const std::string& port) {
      const auto& accesses = technique.stages[node.scheduled.stage].accesses;
      return std::ranges::find(accesses, port, &Access::port) != accesses.end();
    };
    // The stages of a loop wait for what they touch only: those before the body do not wait for what it makes.
    for (const auto& [port, resource] : graph_.passes[pass].inout_sources)
      if (!technique.loop || touches(port)) read(resource);
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

  void check_stage_cycles() {
    done_.clear();
    std::vector<std::size_t> waits(nodes_.size());
    for (const auto& followers : followers_)
      for (const NodeIndex follower : followers) ++waits[follower];
    std::vector<NodeIndex> ready;
    for (NodeIndex n = 0; n < nodes_.size(); ++n)
      if (waits[n] == 0) ready.push_back(n);
    while (!ready.empty()) {
      const NodeIndex n = ready.back();
      ready.pop_back();
      done_.insert(n);
      for (const NodeIndex follower : followers_[n])
        if (--waits[follower] == 0) ready.push_back(follower);
    }
    if (done_.size() != nodes_.size()) throw_cycle();
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
    std::rotate(circle.begin(), std::ranges::min_element(circle), circle.end());
    circle.push_back(circle.front());
    std::ranges::sort(why);
    std::string text;
    for (const std::string& reason : why) text += (text.empty() ? "" : "; ") + reason;
    report(circle, text);
  }

  /// Nothing outside of a loop is left that could come next, and each loop waits for a stage of another.
  [[noreturn]] void throw_tangled_loops(const std::vector<std::size_t>& waits_outside,
                                        const std::vector<std::size_t>& left) const {
    std::string loops;
    PassIndex first = kNoIndex;
    for (std::uint32_t l = 0; l < graph_.loops.size(); ++l) {
      if (waits_outside[l] == 0 || left[l] == 0) continue;
      if (first == kNoIndex) first = graph_.loops[l].pass;
      loops += fmt::format("{}'{}'", loops.empty() ? "" : ", ", name(graph_.loops[l].pass));
    }
    throw Error(HEDDLE_UNSUPPORTED,
                Diagnostic{Severity::kError,
                           graph_.passes[first].where,
                           fmt::format("the loops of passes {} wait for each other's stages", loops),
                           {},
                           "loops that run one after the other",
                           "give one of these passes technique = \"none\""});
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
  std::vector<std::vector<NodeIndex>> nodes_of_;   // by pass
  std::vector<std::vector<Edge>> edges_;           // by the node that waits
  std::vector<std::vector<NodeIndex>> followers_;  // those that wait for a node, each once
  std::set<NodeIndex> done_;                       // by check_stage_cycles
  std::vector<NodeIndex> sequence_;                // of the last run
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
