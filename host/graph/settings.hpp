// SPDX-License-Identifier: Apache-2.0
// What a graph's settings say now, as JSON under the keys of `--set`.
#pragma once

#include "graph/stages.hpp"
#include "json.hpp"

namespace heddle::graph {

/// {"extent", "output", "params", "joins", PASS: {"role", "technique", "enabled", "params", "inputs", "functions"}};
/// parameters and inputs of passes as resolved, with defaults.
Json settings(const WrittenGraph& written, const ResolvedGraph& resolved);
/// The part of it under "ao.params.radius"; "": all. Throws Error(HEDDLE_BAD_INPUT) with the nearest right name.
Json find_setting(const Json& settings, std::string_view key);

}  // namespace heddle::graph
