// SPDX-License-Identifier: Apache-2.0
// Parameters that all techniques of bake_visibility have: where its elements lie, and what relief they have. `flags`:
// HEDDLE_PARAMETER_*, as a technique whose shapes depend on them needs.
#pragma once

#include <heddle/pass.hpp>

namespace baked_visibility {

inline constexpr const char* kElementKinds[] = {"lattice", "vertices", "texels", nullptr};
inline constexpr const char* kDetails[] = {"none", "normal_map", "fine_vertices", "fine_points", nullptr};
inline constexpr double kSpacingLadder[] = {1, 0.5, 0.25, 0.125};

constexpr heddle_parameter elements_parameter(std::uint32_t flags = 0) {
  return heddle::pass::choice("elements", kElementKinds, 0,
                              "what asks: a lattice on each triangle, its vertices, or the texels of its own texture "
                              "coordinates (uv1, else uv0)",
                              flags);
}
constexpr heddle_parameter spacing_parameter(std::uint32_t flags = 0) {
  return heddle::pass::knob(
      heddle::pass::parameter("spacing", "m", 1e-4, 1e4, 0.25, "between elements, at most", HEDDLE_TYPE_FLOAT, flags),
      kSpacingLadder);
}
constexpr heddle_parameter inset_parameter(std::uint32_t flags = 0) {
  return heddle::pass::parameter("inset", "1", 0, 0.5, 0.1,
                                 "of the spacing: how far elements lie off the rims of smooth parts", HEDDLE_TYPE_FLOAT,
                                 flags);
}
constexpr heddle_parameter detail_parameter(std::uint32_t flags = 0) {
  return heddle::pass::choice(
      "detail", kDetails, 0,
      "what relief an element has beside its mesh's: normal_map: its material's, which weighs directions, while the "
      "mesh "
      "alone occludes; fine_vertices: that of vertices of finer instances (component mesh_detail.fine), carried over; "
      "fine_points: it lies on them",
      flags);
}
constexpr heddle_parameter reach_parameter(std::uint32_t flags = 0) {
  return heddle::pass::parameter("reach", "m", 1e-6, 1e4, 0.1,
                                 "from a surface, to both sides, at which its finer one is looked for",
                                 HEDDLE_TYPE_FLOAT, flags);
}

}  // namespace baked_visibility
