// SPDX-License-Identifier: Apache-2.0
// The registry as JSON: what `heddle list`, the Python package and editors know of roles and techniques.
#pragma once

#include <string>

#include "plugin/registry.hpp"

namespace heddle {

/// {"abi", "roles": [...], "techniques": [...]}, sorted by name; the keys of a technique are those of its manifest, and
/// "role", "name", "library", "folder", "is_loadable". Infinities are the strings "inf" and "-inf".
std::string list_json(const Registry& registry);

}  // namespace heddle
