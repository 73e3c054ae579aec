// SPDX-License-Identifier: Apache-2.0
// Plays a barrier plan for several frames against the declared accesses, by the rules of Vulkan's memory model, and
// lists what is not covered. Shares no table and no code with the planner.
#pragma once

#include "graph/stages.hpp"

namespace heddle::graph::test_support {

/// One line for each hazard: frame, stage, resource and what is missing. Empty: every access is safe.
/// Strict: a barrier counts only for the memory of its own resource, although its execution part would order more.
std::vector<std::string> find_hazards(const ResolvedGraph& graph, const Order& order, std::span<const MemoryNeed> needs,
                                      const Placement& placement, const BarrierPlan& plan,
                                      std::span<const ResourceIndex> wanted, std::uint32_t frames = 3,
                                      std::uint32_t iterations = 1);

/// Removes each barrier of the plan in turn; answers the ones that nobody missed, in frames of one, two and three
/// iterations of each loop.
std::vector<std::string> find_needless_barriers(const ResolvedGraph& graph, const Order& order,
                                                std::span<const MemoryNeed> needs, const Placement& placement,
                                                const BarrierPlan& plan, std::span<const ResourceIndex> wanted);

}  // namespace heddle::graph::test_support
