// SPDX-License-Identifier: Apache-2.0
// What Executor::inspect saw, for people.
#pragma once

#include "json.hpp"

namespace heddle::graph {

std::string inspection_text(const Json& seen);

}  // namespace heddle::graph
