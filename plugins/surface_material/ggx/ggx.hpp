// SPDX-License-Identifier: Apache-2.0
// The BRDF in float64: evaluate, sample, pdf, albedo; the twin of surface_material.glsl, with the same table.
#pragma once

#include <heddle/services.h>

namespace heddle::ggx {

/// The technique's service; lives as long as the library.
const heddle_surface_material_service* service();

/// kTableWidth x kTableSize texels of two floats: what the port albedo_table holds.
const float* albedo_texels();

}  // namespace heddle::ggx
