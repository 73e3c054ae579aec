// SPDX-License-Identifier: Apache-2.0
// Why one pass runs or does not, why it stands where it stands, and where its settings come from.
#pragma once

#include "graph/stages.hpp"
#include "json.hpp"

namespace heddle::graph {

using Roles = std::map<std::string, Role, std::less<>>;

/// `written`: the merged graph; `resolved`: what it resolves to; `graph`, `order`: the plan for a scene. Throws Error
/// for a name that no pass has, and none had that an overlay removed.
///
/// {"pass", "role", "technique", "written_at", "runs", "rule": "wanted" | "read" | "not_read" | "feature_missing" |
/// "technique_none" | "not_enabled" | "removed", "reason", "rule_at", "asked_for", "chain": [sentence], "outputs",
/// "neutral", "stages", "settings", "notes"}; what does not apply is missing.
Json why(const WrittenGraph& written, const ResolvedGraph& resolved, const ResolvedGraph& graph, const Order& order,
         const Roles& roles, std::string_view pass);
/// The same for people.
std::string to_text(const Json& why);

}  // namespace heddle::graph
