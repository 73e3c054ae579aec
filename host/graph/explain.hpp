// SPDX-License-Identifier: Apache-2.0
// What the explanations of a graph (explain.cpp), of one pass (why.cpp) and its description (describe.cpp) share.
#pragma once

#include "graph/stages.hpp"
#include "json.hpp"

namespace heddle::graph {

/// A parameter's value as a person would write it: a number, a word, true or false, three numbers, names.
Json to_json(const Parameter& parameter, const ParameterValue& value);

/// Names of the formats that techniques declare; numbers for others, so that nothing is hidden.
std::string format_text(std::uint32_t format);
/// "image", "buffer", "value", "surfaces".
std::string_view type_text(PortType type);
/// "deferred.toml:12:3", "--set"; a whole file without line.
std::string place_text(const Location& where);
/// Columns of equal width, two spaces before and between; the last is not padded.
std::string table_text(const std::vector<std::vector<std::string>>& rows);

}  // namespace heddle::graph
