// SPDX-License-Identifier: Apache-2.0
// The rules of plugin.h that hold for a technique as a whole, whether it came from a descriptor or from a manifest.
#pragma once

#include "diagnostics.hpp"
#include "plugin/technique.hpp"

namespace heddle {

/// A name that C, GLSL and TOML take as it is: letters, digits, single underscores, no digit first, no "gl_".
bool is_identifier(std::string_view name);
/// "role/technique", both identifiers.
bool is_technique_id(std::string_view id);
/// Words separated by spaces.
std::vector<std::string> split_words(std::string_view text);
/// Every rule that `technique` breaks, with `where` as the place: the library or the manifest.
std::vector<Diagnostic> broken_rules(const Technique& technique, const Location& where);

}  // namespace heddle
