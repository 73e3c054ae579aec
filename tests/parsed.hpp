// SPDX-License-Identifier: Apache-2.0
// JSON out of text, for tests. The parser is most of what nlohmann/json costs a file: it is compiled once for all.
#pragma once

#include <nlohmann/json.hpp>

#include <string_view>

namespace parsed {

/// Throws nlohmann::json::parse_error.
nlohmann::json json(std::string_view text);

}  // namespace parsed
