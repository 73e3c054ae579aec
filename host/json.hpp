// SPDX-License-Identifier: Apache-2.0
// JSON between text and values, compiled once: the parser and the writer are most of what nlohmann/json costs a file.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <string_view>

namespace heddle {

/// Keys keep their order.
using Json = nlohmann::ordered_json;

/// Throws Json::parse_error.
Json parse_json(std::string_view text);
/// indent < 0: one line. What is no UTF-8 is replaced: names come from other people's files.
std::string write_json(const Json& json, int indent = -1);
/// The text that is said to be there. Throws Json::type_error where it is none.
std::string text_of(const Json& object, const char* key);

}  // namespace heddle
