// SPDX-License-Identifier: Apache-2.0
// The table of parameters that a technique's README must have, made from its descriptor as `heddle list` gives it.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <string>

namespace rendering {

/// Rows of the technique `id` out of the JSON of heddle_list; "" if it is not there.
std::string parameter_table(const nlohmann::json& all, const std::string& id);

std::string readme_of(const std::string& id);

}  // namespace rendering
