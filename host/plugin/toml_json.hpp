// SPDX-License-Identifier: Apache-2.0
// A value of a TOML file as JSON, so that one check serves both.
#pragma once

#include "json.hpp"

#include <toml++/toml.h>

namespace heddle {

/// Dates and times, which JSON lacks, become null.
Json json_of(const toml::node& node);

}  // namespace heddle
