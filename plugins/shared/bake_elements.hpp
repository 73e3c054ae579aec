// SPDX-License-Identifier: Apache-2.0
// The scene's meshes and instances -> the points at which a bake asks for visibility, and the places of their answers
// in the artifact (baked_visibility.hpp). In float64.
#pragma once

#include "baked_visibility.hpp"
#include "fine_instances.hpp"
#include "fine_meshes.hpp"
#include "normal_maps.hpp"

#include <heddle/meshes.hpp>

#include <glm/glm.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <algorithm>
#include <map>
#include <numeric>
#include <sstream>
#include <tuple>
#include <utility>

namespace baked_visibility {

enum class ElementKind : std::uint32_t { kOnLattice, kOnVertices, kInTexels };
/// Where relief comes from that a mesh has not.
enum class Detail : std::uint32_t { kNone, kNormalMap, kFineVertices, kFinePoints };

struct ElementSettings {
  ElementKind kind = ElementKind::kOnLattice;
  double spacing = 0.25;  // metres between elements, at most
  double inset = 0.1;     // of the spacing: how far elements lie off the rims of smooth parts
  Detail detail = Detail::kNone;
  double reach = 0.1;  // metres from the surface, to both sides, at which its finer one is looked for
};
/// As the parameters of all techniques name them.
inline ElementSettings element_settings(const heddle::pass::PassHost& host) {
  ElementSettings settings;
  settings.kind = static_cast<ElementKind>(host.choice("elements"));
  settings.spacing = host.parameter("spacing");
  settings.inset = host.parameter("inset");
  settings.detail = static_cast<Detail>(host.choice("detail"));
  settings.reach = host.parameter("reach");
  return settings;
}
/// Steps along a triangle's side, and texels along a tile's, at most: where that is too few, elements are further apart
/// than was asked, and a remark says so.
inline constexpr std::uint32_t kMostResolution = 128, kMostTexels = 1024;
/// Elements that a bake makes at most: beyond it the spacing is doubled.
inline constexpr std::uint64_t kMostElements = 4'000'000;

/// A point that asks.
struct Element {
  glm::vec3 position{0.0F};  // relative to the set's origin, metres
  glm::vec3 normal{0.0F};    // unit, what directions are weighed by; zero: a degenerate one, which is open
  glm::vec3 facing{0.0F};    // unit, of the surface itself: what is not in front of it is hidden by it
  std::uint32_t value = 0;   // in the artifact; from ElementSet::value_count on, of a fine mesh
};

/// Elements of one instance whose normals lean to the same side, one behind the other.
struct Part {
  std::uint32_t instance = 0;  // on whose mesh they lie; kNoMesh: on several
  std::uint32_t first = 0, count = 0;
};

inline constexpr std::uint32_t kNoMesh = ~0U;

/// A value that is the one at a point of a fine mesh's triangle: of its corners, by weights.
struct Transfer {
  std::uint32_t value = 0;
  std::array<std::uint32_t, 3> from{};
  std::array<double, 3> weights{};
};

struct ElementSet {
  glm::dvec3 origin{0.0};  // of the scene's bounding sphere
  double radius = 0;
  std::vector<Element> elements;
  std::vector<Part> parts;        // of all elements, in their order
  Baked baked;                    // without values; at its end, until they are set, those of fine meshes
  std::uint32_t value_count = 0;  // of the artifact
  std::vector<Transfer> transfers;
  std::vector<std::uint8_t> is_answered;  // by value: an element asks for it
  std::vector<std::uint32_t> others;      // instances that must not occlude, as the ones asked stand in their place
  std::vector<std::string> remarks;       // to be told
  double spacing = 0;                     // as it was used
  double reached = 0;                     // metres between elements where they are furthest apart
  std::uint64_t mapped = 0;               // elements whose normal is a normal map's
  std::uint64_t refined = 0, missed = 0;  // points of coarse meshes for which there is one of a fine mesh, and is not
};

namespace detail {

struct LocalElement {
  glm::dvec3 position{0.0}, normal{0.0};
  glm::dvec4 tangent{0.0};
  std::array<glm::dvec2, 2> uvs{glm::dvec2(0.0), glm::dvec2(0.0)};
  glm::dvec3 inward{0.0};  // the integral of unit directions over the angles of triangles around: 0 inside of a part
  double room = HUGE_VAL;  // to the nearest of their middles
  std::uint32_t value = 0;
};
/// A mesh's elements in object space.
struct Layout {
  std::uint32_t kind = kNothing;
  std::uint32_t width = 0, height = 0, uv_set = 0, value_count = 0;
  double reached = 0;  // between elements, at most; of texels in the mean
  std::vector<LocalElement> elements;
  std::vector<BakedTriangle> triangles;
  std::vector<std::uint32_t> lattice;
};

inline glm::dvec3 position_of(const HeddleVertex& v) {
  return {v.position[0], v.position[1], v.position[2]};
}
inline glm::dvec3 normal_of(const HeddleVertex& v) {
  return {v.normal[0], v.normal[1], v.normal[2]};
}
/// What a mesh has at a point of a triangle: its corners' by their weights.
inline void blend(const heddle_scene_mesh& mesh, const std::uint32_t* corners, const std::array<double, 3>& weights,
                  LocalElement& out) {
  for (std::size_t k = 0; k < 3; ++k) {
    const HeddleVertex& v = mesh.vertices[corners[k]];
    out.position += position_of(v) * weights[k];
    out.normal += normal_of(v) * weights[k];
    out.tangent += glm::dvec4(v.tangent[0], v.tangent[1], v.tangent[2], v.tangent[3]) * weights[k];
    out.uvs[0] += glm::dvec2(v.u0, v.v0) * weights[k];
    out.uvs[1] += glm::dvec2(v.u1, v.v1) * weights[k];
  }
}
/// Unit, or zero.
inline glm::dvec3 unit(const glm::dvec3& v) {
  const double length = glm::length(v);
  return length > 0 && std::isfinite(length) ? v / length : glm::dvec3(0.0);
}

/// Corners, edges and insides of triangles, none twice: what triangles share they share by the mesh's own vertices.
inline Layout make_lattice(const heddle_scene_mesh& mesh, double spacing) {
  Layout layout;
  layout.kind = kLattice;
  std::map<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t>, std::uint32_t> known;
  const std::uint32_t triangle_count = mesh.index_count / 3;
  for (std::uint32_t t = 0; t < triangle_count; ++t) {
    const std::uint32_t* first = mesh.indices + std::size_t{3} * t;
    const std::array<std::uint32_t, 3> corner{first[0], first[1], first[2]};
    std::array<glm::dvec3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = position_of(mesh.vertices[corner[k]]);
    double longest = 0;
    for (std::size_t k = 0; k < 3; ++k) longest = std::max(longest, glm::distance(p[k], p[(k + 1) % 3]));
    // Powers of two: lattices that meet at an edge share every point of the coarser one.
    std::uint32_t resolution = 1;
    while (spacing > 0 && resolution < kMostResolution && longest > spacing * resolution) resolution *= 2;
    if (std::isfinite(longest)) layout.reached = std::max(layout.reached, longest / resolution);
    const glm::dvec3 middle = (p[0] + p[1] + p[2]) / 3.0;
    BakedTriangle triangle;
    triangle.first_lattice = static_cast<std::uint32_t>(layout.lattice.size());
    triangle.resolution = resolution;
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t c = 0; c < 3; ++c) triangle.corners[3 * k + c] = mesh.vertices[corner[k]].position[c];
    layout.triangles.push_back(triangle);
    for (std::uint32_t j = 0; j <= resolution; ++j) {
      for (std::uint32_t i = 0; i + j <= resolution; ++i) {
        const std::array<std::uint32_t, 3> weight{resolution - i - j, i, j};
        const std::size_t zeros = static_cast<std::size_t>(std::ranges::count(weight, 0U));
        auto key = std::tuple(~0U, t, i, j);
        if (zeros == 2) {
          key = {corner[static_cast<std::size_t>(std::ranges::max_element(weight) - weight.begin())], ~0U, 0, 0};
        } else if (zeros == 1) {
          const auto zero = static_cast<std::size_t>(std::ranges::find(weight, 0U) - weight.begin());
          std::size_t a = (zero + 1) % 3, b = (zero + 2) % 3;
          if (corner[b] < corner[a]) std::swap(a, b);
          // The step as a fraction in lowest terms: the same point whatever the resolution.
          const std::uint32_t common = std::gcd(weight[b], resolution);
          key = {corner[a], corner[b], weight[b] / common, resolution / common};
        }
        const auto [found, is_new] = known.try_emplace(key, static_cast<std::uint32_t>(layout.elements.size()));
        if (is_new) {
          LocalElement element;
          element.value = found->second;
          std::array<double, 3> parts{};
          for (std::size_t k = 0; k < 3; ++k) parts[k] = static_cast<double>(weight[k]) / resolution;
          blend(mesh, corner.data(), parts, element);
          layout.elements.push_back(element);
        }
        if (zeros > 0) {
          LocalElement& element = layout.elements[found->second];
          element.room = std::min(element.room, glm::distance(middle, element.position));
          if (zeros == 2) {
            const auto k = static_cast<std::size_t>(std::ranges::max_element(weight) - weight.begin());
            const glm::dvec3 a = unit(p[(k + 1) % 3] - p[k]), b = unit(p[(k + 2) % 3] - p[k]);
            // 2 sin(angle / 2) along the bisector.
            element.inward += unit(a + b) * glm::length(a - b);
          } else {
            const auto zero = static_cast<std::size_t>(std::ranges::find(weight, 0U) - weight.begin());
            const glm::dvec3 edge = unit(p[(zero + 2) % 3] - p[(zero + 1) % 3]), across = p[zero] - p[(zero + 1) % 3];
            element.inward += 2.0 * unit(across - edge * glm::dot(across, edge));
          }
        }
        layout.lattice.push_back(found->second);
      }
    }
  }
  layout.value_count = static_cast<std::uint32_t>(layout.elements.size());
  return layout;
}

using Uv = std::array<double, 2>;
inline double cross(const Uv& a, const Uv& b, const Uv& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}
/// Barycentric coordinates of the point of a triangle that is nearest to `at`.
inline std::array<double, 3> nearest_barycentric(const std::array<Uv, 3>& p, const Uv& at) {
  const double area = cross(p[0], p[1], p[2]);
  if (area != 0) {
    const std::array<double, 3> b{cross(at, p[1], p[2]) / area, cross(p[0], at, p[2]) / area,
                                  cross(p[0], p[1], at) / area};
    if (b[0] >= 0 && b[1] >= 0 && b[2] >= 0) return b;
  }
  std::array<double, 3> best{1, 0, 0};
  double least = HUGE_VAL;
  for (std::size_t k = 0; k < 3; ++k) {
    const Uv &a = p[k], &b = p[(k + 1) % 3];
    const double dx = b[0] - a[0], dy = b[1] - a[1], length = dx * dx + dy * dy;
    const double s = length > 0 ? std::clamp(((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / length, 0.0, 1.0) : 0.0;
    const double x = a[0] + s * dx - at[0], y = a[1] + s * dy - at[1];
    if (x * x + y * y >= least) continue;
    least = x * x + y * y;
    best = {};
    best[k] = 1 - s;
    best[(k + 1) % 3] = s;
  }
  return best;
}
inline bool touches_texel(const std::array<Uv, 3>& p, double x, double y) {
  // Separating axes: the square's and the triangle's edges.
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double low = axis == 0 ? x : y;
    if (std::max({p[0][axis], p[1][axis], p[2][axis]}) < low ||
        std::min({p[0][axis], p[1][axis], p[2][axis]}) > low + 1)
      return false;
  }
  const double sign = cross(p[0], p[1], p[2]) < 0 ? -1 : 1;
  for (std::size_t k = 0; k < 3; ++k) {
    const Uv &a = p[k], &b = p[(k + 1) % 3];
    double most = -HUGE_VAL;
    for (const Uv& square : {Uv{x, y}, Uv{x + 1, y}, Uv{x, y + 1}, Uv{x + 1, y + 1}})
      most = std::max(most, sign * cross(a, b, square));
    if (most < 0) return false;
  }
  return true;
}

/// Texels of a mesh's own tile. Nothing where two triangles want the same texel centre, or coordinates leave [0, 1].
inline std::optional<Layout> make_texels(const heddle_scene_mesh& mesh, double spacing) {
  Layout layout;
  layout.kind = kTexels;
  const auto has_uv1 = [&] {
    for (std::uint32_t v = 0; v < mesh.vertex_count; ++v)
      if (mesh.vertices[v].u1 != mesh.vertices[0].u1 || mesh.vertices[v].v1 != mesh.vertices[0].v1) return true;
    return false;
  };
  layout.uv_set = mesh.vertex_count > 0 && has_uv1() ? 1 : 0;
  const auto uv_of = [&](std::uint32_t v) {
    const HeddleVertex& vertex = mesh.vertices[v];
    return layout.uv_set == 1 ? Uv{vertex.u1, vertex.v1} : Uv{vertex.u0, vertex.v0};
  };
  double area = 0, uv_area = 0;
  for (std::uint32_t t = 0; t + 2 < mesh.index_count; t += 3) {
    std::array<glm::dvec3, 3> p;
    std::array<Uv, 3> uv;
    for (std::uint32_t k = 0; k < 3; ++k) {
      p[k] = position_of(mesh.vertices[mesh.indices[t + k]]);
      uv[k] = uv_of(mesh.indices[t + k]);
      for (const double c : uv[k])
        if (!(c >= -1e-6 && c <= 1 + 1e-6)) return {};
    }
    area += 0.5 * glm::length(glm::cross(p[1] - p[0], p[2] - p[0]));
    uv_area += 0.5 * std::abs(cross(uv[0], uv[1], uv[2]));
  }
  if (!(uv_area > 0) || !(area > 0)) return {};
  const double side = std::clamp(std::ceil(std::sqrt(area / uv_area) / spacing), 4.0, double{kMostTexels});
  layout.reached = std::sqrt(area / uv_area) / side;
  layout.width = layout.height = static_cast<std::uint32_t>(side);
  layout.value_count = layout.width * layout.height;
  constexpr std::uint32_t kFree = ~0U;
  std::vector<std::uint32_t> owner(layout.value_count, kFree);
  std::vector<std::uint8_t> is_inside(layout.value_count, 0);
  for (std::uint32_t t = 0; t + 2 < mesh.index_count; t += 3) {
    std::array<Uv, 3> uv;
    for (std::uint32_t k = 0; k < 3; ++k) {
      uv[k] = uv_of(mesh.indices[t + k]);
      for (double& c : uv[k]) c *= side;
    }
    const auto range = [&](std::size_t axis) {
      const auto [low, high] = std::minmax({uv[0][axis], uv[1][axis], uv[2][axis]});
      return std::pair(static_cast<std::uint32_t>(std::clamp(std::floor(low), 0.0, side - 1)),
                       static_cast<std::uint32_t>(std::clamp(std::floor(high), 0.0, side - 1)));
    };
    const auto [x0, x1] = range(0);
    const auto [y0, y1] = range(1);
    for (std::uint32_t y = y0; y <= y1; ++y) {
      for (std::uint32_t x = x0; x <= x1; ++x) {
        if (!touches_texel(uv, x, y)) continue;
        const Uv centre{x + 0.5, y + 0.5};
        const double doubled = cross(uv[0], uv[1], uv[2]);
        bool is_in = doubled != 0;
        for (std::size_t k = 0; k < 3; ++k)
          is_in = is_in && cross(uv[k], uv[(k + 1) % 3], centre) * (doubled < 0 ? -1 : 1) > 1e-9 * side;
        const std::uint32_t value = y * layout.width + x;
        if (is_in && is_inside[value] != 0) return {};
        if (owner[value] != kFree && !is_in) continue;
        LocalElement element;
        element.value = value;
        blend(mesh, mesh.indices + t, nearest_barycentric(uv, centre), element);
        if (owner[value] == kFree) {
          owner[value] = static_cast<std::uint32_t>(layout.elements.size());
          layout.elements.push_back(element);
        } else {
          layout.elements[owner[value]] = element;
        }
        is_inside[value] = is_inside[value] != 0 || is_in ? 1 : 0;
      }
    }
  }
  return layout;
}

/// Into the set: how far apart its elements are, and, where that is further than was asked, a remark.
inline void tell_reached(ElementSet& set, std::span<const Layout> layouts, std::span<const double> scales) {
  std::size_t widest = 0;
  std::uint32_t too_wide = 0;
  for (std::size_t m = 0; m < layouts.size(); ++m) {
    const double reached = layouts[m].reached * scales[m];
    // What divides and multiplies by the scale again may differ in its last bit.
    if (set.spacing > 0 && reached > set.spacing * (1 + 1e-9)) ++too_wide;
    if (reached <= set.reached) continue;
    set.reached = reached;
    widest = m;
  }
  if (too_wide == 0) return;
  std::ostringstream text;
  text << "elements of " << too_wide << " of " << layouts.size() << " meshes are further apart than " << set.spacing
       << " m: up to " << set.reached << " m, on mesh " << widest << ", as ";
  if (layouts[widest].kind == kTexels)
    text << "its tile has at most " << kMostTexels << " texels a side: split the mesh";
  else
    text << "a side of a triangle has at most " << kMostResolution << " steps: split its largest triangles";
  set.remarks.push_back(text.str() + ", or raise spacing");
}

/// Of six: the axis that a normal leans to most, and which way.
inline std::uint32_t side_of(const glm::vec3& normal) {
  std::uint32_t axis = 0;
  for (std::uint32_t a = 1; a < 3; ++a)
    if (std::abs(normal[static_cast<int>(a)]) > std::abs(normal[static_cast<int>(axis)])) axis = a;
  return 2 * axis + (normal[static_cast<int>(axis)] < 0 ? 1 : 0);
}
/// Sorts an instance's elements, the last ones of the set, by the side that their surface faces.
inline void add_parts(ElementSet& set, std::uint32_t instance, std::size_t first) {
  const auto begin = set.elements.begin() + static_cast<std::ptrdiff_t>(first);
  std::stable_sort(begin, set.elements.end(),
                   [](const Element& a, const Element& b) { return side_of(a.facing) < side_of(b.facing); });
  for (std::size_t e = first; e < set.elements.size(); ++e) {
    if (e == first || side_of(set.elements[e].facing) != side_of(set.elements[e - 1].facing))
      set.parts.push_back({instance, static_cast<std::uint32_t>(e), 0});
    ++set.parts.back().count;
  }
}

inline double largest_scale(const glm::dmat4& m) {
  return std::max({glm::length(glm::dvec3(m[0])), glm::length(glm::dvec3(m[1])), glm::length(glm::dvec3(m[2]))});
}

}  // namespace detail

/// The sphere around all instances' boxes.
inline std::pair<glm::dvec3, double> bounding_sphere(const heddle::pass::Meshes& meshes) {
  glm::dvec3 low(HUGE_VAL), high(-HUGE_VAL);
  std::map<std::uint32_t, std::pair<glm::dvec3, glm::dvec3>> boxes;
  for (std::uint32_t i = 0; i < meshes.content().instance_count; ++i) {
    const heddle_scene_instance instance = meshes.instance(i);
    auto [box, is_new] = boxes.try_emplace(instance.mesh, glm::dvec3(HUGE_VAL), glm::dvec3(-HUGE_VAL));
    if (is_new) {
      const heddle_scene_mesh mesh = meshes.mesh(instance.mesh);
      for (std::uint32_t v = 0; v < mesh.vertex_count; ++v) {
        box->second.first = glm::min(box->second.first, detail::position_of(mesh.vertices[v]));
        box->second.second = glm::max(box->second.second, detail::position_of(mesh.vertices[v]));
      }
    }
    const glm::dmat4 place = glm::make_mat4(instance.scene_from_object);
    for (int c = 0; c < 8; ++c) {
      const auto& [a, b] = box->second;
      const glm::dvec3 corner((c & 1) != 0 ? b.x : a.x, (c & 2) != 0 ? b.y : a.y, (c & 4) != 0 ? b.z : a.z);
      if (!std::isfinite(corner.x + corner.y + corner.z)) continue;
      const glm::dvec3 at(place * glm::dvec4(corner, 1.0));
      low = glm::min(low, at);
      high = glm::max(high, at);
    }
  }
  if (!(low.x <= high.x)) return {glm::dvec3(0.0), 1.0};
  return {0.5 * (low + high), std::max(0.5 * glm::distance(low, high), 1e-6)};
}

namespace detail {

/// Where an instance stands, for its elements.
struct Place {
  glm::dmat4 scene_from_object;
  glm::dmat3 directions, normals;
  double mirror = 1;

  explicit Place(const glm::dmat4& place) : scene_from_object(place), directions(place) {
    const glm::dmat3& m = directions;
    mirror = glm::determinant(m) < 0 ? -1 : 1;
    // By the inverse transpose up to a positive factor: mirrored instances keep their outward normals.
    normals = glm::dmat3(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1])) * mirror;
  }
  /// As surface_sample.glsl has it: tangents of unit vertices are interpolated in the scene. Zero: it says nothing.
  [[nodiscard]] glm::dvec3 mapped(const LocalElement& local, const glm::dvec3& bump) const {
    const glm::dvec3 n = unit(normals * local.normal) * glm::length(local.normal);
    const glm::dvec3 t = unit(directions * glm::dvec3(local.tangent)) * glm::length(glm::dvec3(local.tangent));
    return unit(bump.x * t + bump.y * mirror * local.tangent.w * glm::cross(n, t) + bump.z * n);
  }
};

/// An element to a point of a fine mesh, where it then faces as that does.
inline void move_to(const heddle::pass::Meshes& meshes, const FineMeshes::Point& point, const glm::dvec3& origin,
                    Element& element) {
  const heddle_scene_instance instance = meshes.instance(point.instance);
  const heddle_scene_mesh mesh = meshes.mesh(instance.mesh);
  const Place place(glm::make_mat4(instance.scene_from_object));
  LocalElement local;
  blend(mesh, mesh.indices + std::size_t{3} * point.triangle, point.weights, local);
  element.position = glm::vec3(glm::dvec3(place.scene_from_object * glm::dvec4(local.position, 1.0)) - origin);
  element.normal = element.facing = glm::vec3(unit(place.normals * local.normal));
}

}  // namespace detail

inline heddle_status make_elements(const heddle::pass::PassHost& host, ElementSet& set) {
  const heddle::pass::Meshes meshes(host);
  const ElementSettings settings = element_settings(host);
  NormalMaps maps;
  if (settings.detail == Detail::kNormalMap)
    if (const heddle_status status = maps.read(host); status != HEDDLE_OK) return status;
  std::map<std::uint32_t, std::vector<std::uint32_t>> fine;  // by coarse instance
  if (const heddle_status status = fine_instances::read(host, nullptr, fine); status != HEDDLE_OK) return status;
  set = {};
  std::tie(set.origin, set.radius) = bounding_sphere(meshes);
  const std::uint32_t instance_count = meshes.content().instance_count;
  std::vector<std::uint8_t> is_fine(instance_count, 0);
  for (const auto& [coarse, all] : fine)
    for (const std::uint32_t i : all) is_fine[i] = 1;
  const bool is_transferred = settings.detail == Detail::kFineVertices;
  const bool is_refined = is_transferred || settings.detail == Detail::kFinePoints;
  for (const auto& [coarse, all] : fine)
    if (is_refined)
      set.others.push_back(coarse);
    else
      set.others.insert(set.others.end(), all.begin(), all.end());
  if (is_refined && fine.empty())
    set.remarks.emplace_back(
        "no instance has a finer one, so all elements lie on their own meshes: put the component mesh_detail.fine on "
        "the "
        "finer instances");
  std::vector<double> scales(meshes.content().mesh_count, 0.0);
  for (std::uint32_t i = 0; i < instance_count; ++i) {
    if (is_fine[i] != 0) continue;  // nothing shows it
    const heddle_scene_instance instance = meshes.instance(i);
    scales[instance.mesh] =
        std::max(scales[instance.mesh], detail::largest_scale(glm::make_mat4(instance.scene_from_object)));
  }
  set.spacing = settings.kind == ElementKind::kOnVertices ? 0.0 : settings.spacing;
  std::vector<detail::Layout> layouts;
  std::uint32_t without_uvs = 0;
  for (;;) {
    layouts.assign(scales.size(), {});
    without_uvs = 0;
    for (std::uint32_t m = 0; m < scales.size(); ++m) {
      const heddle_scene_mesh mesh = meshes.mesh(m);
      if (!(scales[m] > 0) || mesh.shape != 0) continue;  // a mesh that bends is none to bake
      const double spacing = set.spacing / scales[m];
      std::optional<detail::Layout> texels;
      if (settings.kind == ElementKind::kInTexels) {
        texels = detail::make_texels(mesh, spacing);
        without_uvs += texels ? 0 : 1;
      }
      layouts[m] = texels ? *std::move(texels) : detail::make_lattice(mesh, spacing);
    }
    std::uint64_t total = 0;
    for (std::uint32_t i = 0; i < instance_count; ++i)
      if (is_fine[i] == 0) total += layouts[meshes.instance(i).mesh].elements.size();
    if (total <= kMostElements || set.spacing == 0) break;
    set.spacing *= 2;
    set.remarks.push_back(std::to_string(total) + " elements are too many; they are " + std::to_string(set.spacing) +
                          " m apart instead");
  }
  detail::tell_reached(set, layouts, scales);
  if (without_uvs > 0)
    set.remarks.push_back(std::to_string(without_uvs) +
                          " meshes have no texture coordinates of their own for every point: they get lattices");

  std::vector<std::pair<std::uint32_t, std::uint32_t>> first;  // triangle, lattice
  for (const detail::Layout& layout : layouts) {
    const auto lattice = static_cast<std::uint32_t>(set.baked.lattice.size());
    first.emplace_back(static_cast<std::uint32_t>(set.baked.triangles.size()), lattice);
    for (BakedTriangle triangle : layout.triangles) {
      triangle.first_lattice += lattice;
      set.baked.triangles.push_back(triangle);
    }
    set.baked.lattice.insert(set.baked.lattice.end(), layout.lattice.begin(), layout.lattice.end());
  }
  for (std::uint32_t i = 0; i < instance_count; ++i)
    if (is_fine[i] == 0) set.value_count += layouts[meshes.instance(i).mesh].value_count;
  // Vertices of fine meshes, each once; what carries their answers over follows below.
  std::uint32_t value_end = set.value_count;
  std::map<std::uint32_t, std::pair<std::uint32_t, detail::Layout>> vertices;  // first value, by fine instance
  for (std::uint32_t i = 0; i < instance_count && is_transferred; ++i) {
    if (is_fine[i] == 0) continue;
    auto& [first_value, layout] = vertices[i];
    first_value = value_end;
    layout = detail::make_lattice(meshes.mesh(meshes.instance(i).mesh), 0.0);
    value_end += layout.value_count;
  }
  if (value_end - set.value_count > kMostElements)
    return host.fail(HEDDLE_UNSUPPORTED, "fine meshes have " + std::to_string(value_end - set.value_count) +
                                             " vertices; expected: at most " + std::to_string(kMostElements) +
                                             ", or params.detail = \"fine_points\"");

  std::uint32_t value_count = 0;
  const double inset = settings.inset * (set.spacing > 0 ? set.spacing : settings.spacing);
  for (std::uint32_t i = 0; i < instance_count; ++i) {
    const heddle_scene_instance instance = meshes.instance(i);
    const bool is_of_vertices = is_fine[i] != 0;
    if (is_of_vertices && !is_transferred) {
      set.baked.instances.emplace_back();
      continue;
    }
    const detail::Layout& layout = is_of_vertices ? vertices.at(i).second : layouts[instance.mesh];
    BakedInstance record;
    if (!is_of_vertices) {
      record.kind = layout.kind;
      record.first_value = value_count;
      record.first_triangle = first[instance.mesh].first;
      record.triangle_count = static_cast<std::uint32_t>(layout.triangles.size());
      record.width = layout.width;
      record.height = layout.height;
      record.uv_set = layout.uv_set;
    }
    set.baked.instances.push_back(record);
    const std::uint32_t first_value = is_of_vertices ? vertices.at(i).first : value_count;
    const detail::Place place(glm::make_mat4(instance.scene_from_object));
    const std::uint32_t material = meshes.mesh(instance.mesh).material;
    FineMeshes finer;
    const auto found = fine.find(i);
    const bool has_finer = is_refined && found != fine.end();
    if (has_finer && !finer.build(meshes, found->second, set.origin)) return host.fail(HEDDLE_FAILED, finer.error());
    const std::size_t first_element = set.elements.size();
    for (const detail::LocalElement& local : layout.elements) {
      glm::dvec3 at = glm::dvec3(place.scene_from_object * glm::dvec4(local.position, 1.0));
      if (glm::length(local.inward) > 0.5) {  // a rim
        const glm::dvec3 step = place.directions * detail::unit(local.inward);
        const double length = glm::length(step);
        if (length > 0) at += step * std::min(inset / length, 0.5 * local.room);
      }
      Element element;
      element.position = glm::vec3(at - set.origin);
      element.normal = element.facing = glm::vec3(detail::unit(place.normals * local.normal));
      element.value = first_value + local.value;
      if (maps.has(material)) {
        const glm::dvec3 mapped = place.mapped(local, maps.bump(material, local.uvs[maps.uv_set(material)]));
        if (mapped != glm::dvec3(0.0) && element.facing != glm::vec3(0.0F)) {
          element.normal = glm::vec3(mapped);
          ++set.mapped;
        }
      }
      if (has_finer) {
        const auto point = finer.find(at - set.origin, glm::dvec3(element.facing), settings.reach);
        ++(point ? set.refined : set.missed);
        if (point && is_transferred) {
          const auto& [fine_first, corners] = vertices.at(point->instance);
          Transfer& transfer = set.transfers.emplace_back();
          transfer.value = element.value;
          transfer.weights = point->weights;
          for (std::size_t k = 0; k < 3; ++k)
            transfer.from[k] = fine_first + corners.lattice[std::size_t{3} * point->triangle + k];
          continue;
        }
        if (point) detail::move_to(meshes, *point, set.origin, element);
      }
      set.elements.push_back(element);
    }
    detail::add_parts(set, has_finer ? kNoMesh : i, first_element);
    if (!is_of_vertices) value_count += layout.value_count;
  }
  if (set.elements.empty())
    set.remarks.push_back(
        "nothing was baked: the scene has no triangles on meshes that never bend; name a scene that has");
  if (set.missed > 0)
    set.remarks.push_back(std::to_string(set.missed) + " of " + std::to_string(set.missed + set.refined) +
                          " points of coarse meshes have no finer surface within " + std::to_string(settings.reach) +
                          " m and answer for themselves: raise reach");
  set.baked.values.resize(value_end);
  set.is_answered.assign(value_end, 0);
  for (const Element& element : set.elements) set.is_answered[element.value] = 1;
  for (const Transfer& transfer : set.transfers) set.is_answered[transfer.value] = 1;
  return HEDDLE_OK;
}

/// What directions said of an element: sums over those in front of it.
struct Sums {
  double weight = 0, open = 0;  // of N.s; of N.s where nothing is in the way
  std::array<double, 3> bent{};
};

/// Into the artifact; nothing in front of an element is an open one.
inline void set_value(Baked& baked, const Element& element, const Sums& sums) {
  BakedValue value;
  if (sums.weight > 0) value.visibility = static_cast<float>(std::clamp(sums.open / sums.weight, 0.0, 1.0));
  const std::array<double, 3> normal{element.normal.x, element.normal.y, element.normal.z};
  const bool has_bent = sums.bent[0] != 0 || sums.bent[1] != 0 || sums.bent[2] != 0;
  const auto packed = pack_direction(has_bent ? sums.bent : normal);
  value.bent[0] = packed[0];
  value.bent[1] = packed[1];
  baked.values[element.value] = value;
}

/// Values that nobody has asked for, and, if `is_filling`, those of elements that see nothing at all because they lie
/// in or under something: the mean of their neighbours that are neither, as far as `steps` elements away.
inline void fill_gaps(ElementSet& set, bool is_filling, std::uint32_t steps) {
  Baked& baked = set.baked;
  std::vector<std::uint8_t> is_gap(baked.values.size(), 0);
  for (std::size_t v = 0; v < is_gap.size(); ++v)
    is_gap[v] = set.is_answered[v] == 0 || (is_filling && baked.values[v].visibility == 0) ? 1 : 0;
  struct Mean {
    double visibility = 0;
    glm::dvec3 bent{0.0};
    std::uint32_t count = 0;
  };
  for (std::uint32_t step = 0; step < steps; ++step) {
    std::map<std::uint32_t, Mean> means;
    const auto meet = [&](std::uint32_t a, std::uint32_t b) {
      if (is_gap[a] == is_gap[b]) return;
      if (is_gap[b] != 0) std::swap(a, b);
      Mean& mean = means[a];
      mean.visibility += static_cast<double>(baked.values[b].visibility);
      const std::array<double, 3> bent = unpack_direction(baked.values[b].bent);
      mean.bent += glm::dvec3(bent[0], bent[1], bent[2]);
      ++mean.count;
    };
    for (const BakedInstance& instance : baked.instances) {
      if (instance.kind == kTexels) {
        for (std::uint32_t y = 0; y < instance.height; ++y)
          for (std::uint32_t x = 0; x < instance.width; ++x) {
            const std::uint32_t at = instance.first_value + y * instance.width + x;
            const bool has_right = x + 1 < instance.width, has_below = y + 1 < instance.height;
            if (has_right) meet(at, at + 1);
            if (has_below) meet(at, at + instance.width);
            if (has_right && has_below) {
              meet(at, at + instance.width + 1);
              meet(at + 1, at + instance.width);
            }
          }
        continue;
      }
      for (std::uint32_t t = 0; instance.kind == kLattice && t < instance.triangle_count; ++t) {
        const BakedTriangle& triangle = baked.triangles[instance.first_triangle + t];
        const auto value = [&](std::uint32_t i, std::uint32_t j) {
          return instance.first_value + baked.lattice[triangle.first_lattice + lattice_row(triangle.resolution, j) + i];
        };
        for (std::uint32_t j = 0; j < triangle.resolution; ++j)
          for (std::uint32_t i = 0; i + j < triangle.resolution; ++i) {
            meet(value(i, j), value(i + 1, j));
            meet(value(i, j), value(i, j + 1));
            meet(value(i + 1, j), value(i, j + 1));
          }
      }
    }
    if (means.empty()) return;
    for (const auto& [v, mean] : means) {
      is_gap[v] = 0;
      baked.values[v].visibility = static_cast<float>(mean.visibility / mean.count);
      const auto packed = pack_direction({mean.bent.x, mean.bent.y, mean.bent.z});
      baked.values[v].bent[0] = packed[0];
      baked.values[v].bent[1] = packed[1];
    }
  }
}

/// Answers of fine meshes' vertices to the values that are theirs. If `is_filling`, vertices that see nothing, because
/// they lie in something, are left out where another corner sees something.
inline void carry_over(ElementSet& set, bool is_filling) {
  for (const Transfer& transfer : set.transfers) {
    double weight = 0, visibility = 0;
    glm::dvec3 bent(0.0);
    for (const bool is_leaving_out : {is_filling, false}) {
      for (std::size_t k = 0; k < 3; ++k) {
        const BakedValue& corner = set.baked.values[transfer.from[k]];
        if (is_leaving_out && corner.visibility == 0) continue;
        const std::array<double, 3> direction = unpack_direction(corner.bent);
        weight += transfer.weights[k];
        visibility += transfer.weights[k] * static_cast<double>(corner.visibility);
        bent += transfer.weights[k] * glm::dvec3(direction[0], direction[1], direction[2]);
      }
      if (weight > 0) break;
    }
    BakedValue& value = set.baked.values[transfer.value];
    value.visibility = weight > 0 ? static_cast<float>(std::clamp(visibility / weight, 0.0, 1.0)) : 1.0F;
    const auto packed = pack_direction({bent.x, bent.y, bent.z});
    value.bent[0] = packed[0];
    value.bent[1] = packed[1];
  }
  set.baked.values.resize(set.value_count);
}

inline constexpr std::uint32_t kFillSteps = 8;  // elements that `fill` reaches; as many texels a gutter is wide

/// Elements that see nothing, and those that have no side to see from.
struct Blind {
  std::uint64_t closed = 0, without_side = 0;
};
/// All answers into the artifact. sums: parallel to the elements.
inline Blind set_values(ElementSet& set, std::span<const Sums> sums, bool is_filling, std::size_t directions) {
  Blind blind;
  for (std::size_t e = 0; e < sums.size(); ++e) {
    set_value(set.baked, set.elements[e], sums[e]);
    blind.without_side += sums[e].weight > 0 ? 0 : 1;
    blind.closed += sums[e].weight > 0 && sums[e].open == 0 ? 1 : 0;
  }
  carry_over(set, is_filling);
  fill_gaps(set, is_filling, kFillSteps);
  set.baked.direction_count = static_cast<std::uint32_t>(directions);
  return blind;
}

}  // namespace baked_visibility
