// SPDX-License-Identifier: Apache-2.0
// A JSON Schema (draft 7) of graph files, for editors: completion, hover, mistakes while typing.
#pragma once

#include "graph/stages.hpp"
#include "json.hpp"

namespace heddle::graph {

/// Made from roles and manifests alone. What needs the rest of the graph (names of passes, producers, cycles) a schema
/// cannot say: `heddle explain` does.
Json schema(const Registry& registry);

}  // namespace heddle::graph
