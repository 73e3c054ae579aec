// SPDX-License-Identifier: Apache-2.0
// What a graph says, as JSON: for completion, editors and scripts, which need no plan.
#pragma once

#include "graph/stages.hpp"
#include "json.hpp"

namespace heddle::graph {

/// {"file", "extent", "output", "presets", "passes", "ports"}: see heddle_graph_describe.
Json describe(const WrittenGraph& written, const ResolvedGraph& resolved);

}  // namespace heddle::graph
