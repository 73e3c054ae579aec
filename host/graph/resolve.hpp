// SPDX-License-Identifier: Apache-2.0
// What the two halves of resolve share: ports and functions (resolve.cpp), and values of parameters (parameters.cpp).
#pragma once

#include <map>

#include "graph/stages.hpp"
#include "graph/written.hpp"

namespace heddle::graph {

/// The top-level presets by name, and which of them were used.
struct Presets {
  std::map<std::string, const Written*, std::less<>> values;
  std::map<std::string, bool, std::less<>> is_used;
};

/// Every parameter of the technique: what the graph says, checked for type, choice and range, or the default; and where
/// each value comes from.
std::vector<ParameterValue> read_parameters(const WrittenPass& written, const Technique& technique, Presets& presets,
                                            Problems& problems, std::vector<std::string>& notes,
                                            std::vector<ParameterOrigin>& origins);

}  // namespace heddle::graph
