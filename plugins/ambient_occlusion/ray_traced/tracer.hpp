// SPDX-License-Identifier: Apache-2.0
// Triangles -> answers of Embree: the exact surface near a point of the depth image, and hits along batches of rays.
#pragma once

#include "embree_triangles.hpp"
#include "estimator.hpp"

#include <optional>
#include <span>
#include <vector>

namespace heddle::ambient_occlusion {

/// Borrowed; indices count vertices of `positions`. Masked triangles ask the alpha test at every hit; blended ones are
/// left out, as they are from the depth image.
struct Triangles {
  std::span<const glm::vec3> positions;
  std::span<const glm::uvec3> indices;
  std::span<const std::uint32_t> flags;  // HEDDLE_SURFACE_*, one a triangle
};

/// Whether there is surface at a triangle's barycentric point (p = (1-u-v) p0 + u p1 + v p2).
struct AlphaTest {
  bool (*is_surface)(void* user, std::uint32_t triangle, float u, float v) = nullptr;
  void* user = nullptr;
};

/// One Embree device with one scene. Many threads may ask at once what is const; the rest is for one.
class Tracer {
 public:
  Tracer();
  ~Tracer();
  Tracer(const Tracer&) = delete;
  Tracer& operator=(const Tracer&) = delete;

  /// False: no Embree device here, or it ran out of memory; error() says why.
  [[nodiscard]] bool build(const Triangles& triangles);
  [[nodiscard]] const char* error() const { return error_.text; }
  /// Used by the calls that follow; without one, masked triangles are solid.
  void set_alpha_test(const AlphaTest& test) { alpha_test_ = test; }

  /// Finds the triangle that the depth image saw at `point` along `view` (unit, from the eye): the first one near it
  /// whose plane passes within `tolerance` metres of it, plus what float32 leaves uncertain in a scene of this size.
  /// The origin of the answer lies on the float64 plane of that triangle, moved off by that uncertainty. If there is
  /// none (a disagreement of the rasterizer at an edge), the point itself, moved off by `tolerance` along the normal.
  [[nodiscard]] SurfacePoint anchor(const glm::dvec3& point, const glm::dvec3& view, const glm::dvec3& normal,
                                    double tolerance) const;

  /// Fills batch.distance. `nearest`: the true distance; else 0 for any hit.
  void trace(const glm::dvec3& origin, double radius, bool nearest, RayBatch& batch) const;

 private:
  static void filter(const RTCFilterFunctionNArguments* arguments);

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  std::vector<std::uint32_t> opaque_, masked_;  // Embree's primitives -> triangles
  std::vector<glm::vec3> positions_;
  std::vector<glm::uvec3> indices_;
  double largest_coordinate_ = 0.0;
  AlphaTest alpha_test_;
  embree::ErrorText error_;
};

}  // namespace heddle::ambient_occlusion
