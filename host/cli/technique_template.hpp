// SPDX-License-Identifier: Apache-2.0
// A role's contract -> the files of a new technique: builds, loads and renders as it is. Pure; opens no file.
#pragma once

#include "json.hpp"

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace heddle::cli {

enum class TemplateLanguage { kC, kCpp };

struct TemplateFile {
  std::string name;  // in the technique's folder
  std::string text;
};

/// role: an element of heddle_list's "roles". An image output is the role's neutral value, or, where the role turns one
/// image into another, that image clamped to the output's range; a function is the role's neutral body.
/// Throws Failure(HEDDLE_UNSUPPORTED) for a role with outputs that are not images.
std::vector<TemplateFile> technique_template(const Json& role, std::string_view name, TemplateLanguage language);

}  // namespace heddle::cli
