// SPDX-License-Identifier: Apache-2.0
// What heddle_list and heddle_graph_describe say of one pass.
#pragma once

#include "json.hpp"

#include <string>

namespace heddle::view {

/// Of a pass as heddle_graph_describe has it, in heddle_list; nullptr for "none".
const Json* technique_of(const Json& list, const Json& pass);
/// nullptr if the graph has no such pass.
const Json* pass_of(const Json& description, const std::string& name);
/// nullptr if the pass's technique has no such parameter.
const Json* parameter_of(const Json& list, const Json& pass, const std::string& name);
/// Whether a frame depends on those before it: kept ports, lists that grow, copies that arrive later.
bool remembers(const Json& description, const Json& list);

}  // namespace heddle::view
