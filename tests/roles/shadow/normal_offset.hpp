// SPDX-License-Identifier: Apache-2.0
// The normal offset of lookups in depth maps, as shaders have it, in float64.
#pragma once

#include <glm/glm.hpp>

namespace normal_offset_float64 {
using namespace glm;
#define float double
#include "normal_offset.glsl"
#undef float
}  // namespace normal_offset_float64
