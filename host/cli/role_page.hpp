// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "json.hpp"

namespace heddle::cli {

/// The page of one role in Markdown: its contract, its techniques, and what each can be told. `list` is heddle_list's.
std::string role_page(const Json& list, const Json& role);

}  // namespace heddle::cli
