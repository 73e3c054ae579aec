// SPDX-License-Identifier: Apache-2.0
// Technique -> JSON, the same in manifests and in what `heddle list` prints.
#pragma once

#include "json.hpp"
#include "plugin/technique.hpp"

namespace heddle {

/// Keys in the order of plugin.h. Enumerations are words, infinities the strings "inf" and "-inf".
Json technique_to_json(const Technique& technique);
/// A double as JSON: infinities as words.
Json number_to_json(double number);
std::string_view to_word(PortType type);
std::string_view to_word(Direction direction);

}  // namespace heddle
