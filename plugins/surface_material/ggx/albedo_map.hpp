// SPDX-License-Identifier: Apache-2.0
// The map between (NoV, roughness) and the texels of the albedo table, and what a texel holds: read by the program that
// integrates the table and by the float64 service. surface_material.glsl says the same in GLSL; a test compares them.
#pragma once

#include <algorithm>
#include <cmath>

namespace heddle::ggx {

// The sun is 4.7e-3 rad wide and a pixel about 1e-3: no narrower lobe is seen.
inline constexpr double kMinimumAlpha = 1e-3;

inline constexpr int kTableSize = 128;              // rows: roughness; columns: NoV
inline constexpr int kTableWidth = kTableSize + 1;  // the last column holds averages over the hemisphere
// A lobe's loss is a function of NoV / alpha where both are small, and of NoV alone elsewhere. Between 1 and 4 the
// interpolation error is flat; see README "Measured".
inline constexpr double kAngleScale = 3.0;

inline double clamped_roughness(double roughness) {
  return std::clamp(roughness, std::sqrt(kMinimumAlpha), 1.0);
}
inline double alpha_from_roughness(double roughness) {
  const double r = clamped_roughness(roughness);
  return r * r;
}

/// Column in [0, kTableSize - 1].
inline double column_from_cosine(double cosine, double alpha) {
  const double k = kAngleScale * alpha;
  return std::cbrt(cosine * (1.0 + k) / (cosine + k)) * (kTableSize - 1);
}
inline double cosine_from_column(double column, double alpha) {
  const double k = kAngleScale * alpha;
  const double x = column / (kTableSize - 1);
  return k * x * x * x / (1.0 + k - x * x * x);
}

/// Row in [0, kTableSize - 1].
inline double row_from_roughness(double roughness) {
  const double low = std::sqrt(kMinimumAlpha);
  return std::sqrt((clamped_roughness(roughness) - low) / (1.0 - low)) * (kTableSize - 1);
}
inline double roughness_from_row(double row) {
  const double low = std::sqrt(kMinimumAlpha);
  const double y = row / (kTableSize - 1);
  return low + (1.0 - low) * y * y;
}

/// Directional albedo of single scattering, README (4): with F = 1, and with F = (1 - VoH)^5.
struct Albedo {
  double loss = 0.0;     // 1 - E
  double schlick = 0.0;  // E_schlick
};

inline double power5(double x) {
  return x * x * x * x * x;
}

/// Texels hold (1 - E, E_schlick - E (1 - NoV)^5): the second is small where the first direction is a mirror's.
inline double stored_schlick(const Albedo& albedo, double cosine) {
  return albedo.schlick - (1.0 - albedo.loss) * power5(1.0 - cosine);
}
inline double schlick_from_stored(double loss, double stored, double cosine) {
  return stored + (1.0 - loss) * power5(1.0 - cosine);
}

}  // namespace heddle::ggx
