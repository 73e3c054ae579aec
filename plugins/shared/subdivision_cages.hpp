// SPDX-License-Identifier: Apache-2.0
// The scene's instances with the component subdivision.surface -> their meshes as cages, refined, with vertices that
// carry texture coordinates, colours and directions of tangents. What is done with positions is the technique's.
#pragma once

#include "catmull_clark.hpp"

#include <heddle/meshes.hpp>

#include <bit>
#include <cstring>
#include <memory>
#include <unordered_map>

namespace heddle::subdivision {

struct Settings {
  std::int32_t levels = 0;
  bool pins_corners = true;
  double crease_angle = 0, crease_sharpness = 0;
  auto operator<=>(const Settings&) const = default;
};

/// A vertex to draw: a row of the refinement with what does not move. As shaders see it, 32 bytes.
struct Corner {
  std::uint32_t row = 0;    // kMirrored: bitangents are turned
  std::uint32_t color = 0;  // rgba8
  std::array<float, 2> uv0{}, uv1{};
  std::array<float, 2> direction{};  // of the tangent, along the row's t1 and t2
  bool operator==(const Corner&) const = default;
};
static_assert(sizeof(Corner) == 32);
inline constexpr std::uint32_t kMirrored = 0x80000000U;

/// One mesh, refined for some instances.
struct Object {
  std::uint32_t mesh = 0, material = 0;
  Settings settings;
  std::vector<std::uint32_t> instances;
  std::vector<std::uint32_t> sources;  // of each point of the cage: the mesh's vertex
  catmull_clark::Refined refined;
  std::vector<Corner> corners;
  std::vector<std::uint32_t> indices;  // triangles of corners
};

using Vector = std::array<double, 3>;

inline Vector position_of(const HeddleVertex& vertex) {
  return {static_cast<double>(vertex.position[0]), static_cast<double>(vertex.position[1]),
          static_cast<double>(vertex.position[2])};
}
inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
/// Unit, or `otherwise` where there is no direction.
inline Vector unit(const Vector& v, const Vector& otherwise) {
  const double largest = std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])});
  if (!(largest > 0)) return otherwise;
  const Vector scaled{v[0] / largest, v[1] / largest, v[2] / largest};
  const double length = std::sqrt(dot(scaled, scaled));
  return {scaled[0] / length, scaled[1] / length, scaled[2] / length};
}

/// A row of weights over the positions of a mesh's vertices, float64.
inline Vector weigh(const catmull_clark::Weights& weights, std::size_t row, std::span<const std::uint32_t> sources,
                    const HeddleVertex* vertices) {
  Vector sum{};
  const auto points = weights.points_of(row);
  const auto values = weights.values_of(row);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector at = position_of(vertices[sources[points[i]]]);
    for (std::size_t k = 0; k < 3; ++k) sum[k] += values[i] * at[k];
  }
  return sum;
}

/// Holds every point of the surface: weights of places are never negative and add up to 1.
inline std::array<float, 6> bounds_of(const Object& object, const heddle_scene_mesh& mesh) {
  std::array<float, 6> bounds{};
  bool is_first = true;
  for (const HeddleVertex* vertices : {mesh.vertices, mesh.previous_vertices}) {
    for (const std::uint32_t source : object.sources) {
      for (std::size_t k = 0; k < 3; ++k) {
        const float at = vertices[source].position[k];
        // Sums of float32 may leave the hull by their rounding: at most about 2^-18 of the largest for the longest
        // rows.
        const float slack = std::abs(at) * 4e-6F;
        bounds[k] = is_first ? at - slack : std::min(bounds[k], at - slack);
        bounds[3 + k] = is_first ? at + slack : std::max(bounds[3 + k], at + slack);
      }
      is_first = false;
    }
  }
  return bounds;
}

namespace detail {

/// Corners of faces as vertices of the mesh, and as points: vertices at the same place are one.
struct Faces {
  std::vector<std::uint32_t> sizes, vertices, points;
};

struct PlaceHash {
  std::size_t operator()(const std::array<std::uint32_t, 3>& bits) const {
    std::uint64_t hash = 0x9e3779b97f4a7c15ULL;
    for (const std::uint32_t word : bits) hash = (hash ^ word) * 0xff51afd7ed558ccdULL;
    return static_cast<std::size_t>(hash ^ (hash >> 32U));
  }
};

inline std::vector<std::uint32_t> weld(const heddle_scene_mesh& mesh, std::vector<std::uint32_t>& sources) {
  std::unordered_map<std::array<std::uint32_t, 3>, std::uint32_t, PlaceHash> known;
  std::vector<std::uint32_t> point_of(mesh.vertex_count);
  for (std::uint32_t v = 0; v < mesh.vertex_count; ++v) {
    std::array<std::uint32_t, 3> bits{};
    for (std::size_t k = 0; k < 3; ++k) bits[k] = std::bit_cast<std::uint32_t>(mesh.vertices[v].position[k] + 0.0F);
    const auto [found, is_new] = known.try_emplace(bits, static_cast<std::uint32_t>(sources.size()));
    if (is_new) sources.push_back(v);
    point_of[v] = found->second;
  }
  return point_of;
}

/// Edges without extent are taken out, and faces of which less than a triangle is left.
inline Faces faces_of(const heddle_scene_mesh& mesh, const std::vector<std::uint32_t>& point_of) {
  Faces faces;
  std::size_t triangle = 0;
  for (std::uint32_t f = 0; f < mesh.face_count; ++f) {
    const std::uint32_t size = mesh.face_sizes != nullptr ? mesh.face_sizes[f] : 3;
    std::vector<std::uint32_t> corners{mesh.indices[triangle * 3], mesh.indices[triangle * 3 + 1]};
    for (std::uint32_t k = 2; k < size; ++k) corners.push_back(mesh.indices[(triangle + k - 2) * 3 + 2]);
    triangle += size - 2;
    std::vector<std::uint32_t> kept;
    for (std::size_t k = 0; k < corners.size(); ++k)
      if (point_of[corners[k]] != point_of[corners[(k + 1) % corners.size()]]) kept.push_back(corners[k]);
    if (kept.size() < 3) continue;
    faces.sizes.push_back(static_cast<std::uint32_t>(kept.size()));
    for (const std::uint32_t vertex : kept) {
      faces.vertices.push_back(vertex);
      faces.points.push_back(point_of[vertex]);
    }
  }
  return faces;
}

/// Edges between faces that are turned further than the angle.
inline void add_steep_edges(const Faces& faces, const heddle_scene_mesh& mesh, const Settings& settings,
                            catmull_clark::Cage& cage) {
  if (settings.crease_angle >= std::numbers::pi || settings.crease_sharpness <= 0) return;
  std::vector<Vector> normals;
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> first_face;
  std::size_t first = 0;
  for (std::uint32_t f = 0; f < faces.sizes.size(); first += faces.sizes[f++]) {
    // Newell's normal: twice the face's area in each plane.
    Vector normal{};
    for (std::uint32_t k = 0; k < faces.sizes[f]; ++k) {
      const Vector a = position_of(mesh.vertices[faces.vertices[first + k]]);
      const Vector b = position_of(mesh.vertices[faces.vertices[first + (k + 1) % faces.sizes[f]]]);
      const Vector area = cross(a, b);
      for (std::size_t i = 0; i < 3; ++i) normal[i] += area[i];
    }
    normals.push_back(unit(normal, {}));
    for (std::uint32_t k = 0; k < faces.sizes[f]; ++k) {
      const std::uint32_t a = faces.points[first + k], b = faces.points[first + (k + 1) % faces.sizes[f]];
      const std::array<std::uint32_t, 2> edge{std::min(a, b), std::max(a, b)};
      const auto [found, is_new] = first_face.try_emplace(edge, f);
      if (!is_new && dot(normals[found->second], normals[f]) < std::cos(settings.crease_angle))
        cage.sharp_edges.emplace_back(edge, settings.crease_sharpness);
    }
  }
}

/// What a face's corner carries besides its place: refined by halves, so both sides of an edge agree in every bit.
struct Carried {
  std::array<double, 11> values{};  // uv0, uv1, colour, tangent
  bool is_mirrored = false;
};

inline Carried carried_by(const HeddleVertex& vertex, bool has_coordinates) {
  Carried made;
  made.values = {static_cast<double>(vertex.u0), static_cast<double>(vertex.v0), static_cast<double>(vertex.u1),
                 static_cast<double>(vertex.v1)};
  for (std::size_t k = 0; k < 4; ++k) made.values[4 + k] = static_cast<double>((vertex.color >> (8 * k)) & 0xffU);
  // Without texture coordinates there is no normal map, and tangents are any.
  for (std::size_t k = 0; k < 3 && has_coordinates; ++k) made.values[8 + k] = static_cast<double>(vertex.tangent[k]);
  made.is_mirrored = has_coordinates && vertex.tangent[3] < 0;
  return made;
}

inline Carried mean(std::span<const Carried> of, const Carried& turned_as) {
  Carried made;
  for (const Carried& one : of)
    for (std::size_t k = 0; k < made.values.size(); ++k) made.values[k] += one.values[k];
  for (double& value : made.values) value /= static_cast<double>(of.size());
  made.is_mirrored = turned_as.is_mirrored;
  return made;
}

/// The corners of the next level's quads, in the order of catmull_clark::refine.
inline std::vector<Carried> refine_carried(std::span<const std::uint32_t> sizes, std::span<const Carried> corners) {
  std::vector<Carried> made;
  std::size_t first = 0;
  for (const std::uint32_t size : sizes) {
    const auto face = corners.subspan(first, size);
    first += size;
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::array next{face[i], face[(i + 1) % size]}, previous{face[(i + size - 1) % size], face[i]};
      made.push_back(face[i]);
      made.push_back(mean(next, face[i]));
      made.push_back(mean(face, face[i]));
      made.push_back(mean(previous, face[i]));
    }
  }
  return made;
}

struct CornerHash {
  std::size_t operator()(const Corner& corner) const {
    std::array<std::uint32_t, 8> words{};
    std::memcpy(words.data(), &corner, sizeof corner);
    std::uint64_t hash = 0x9e3779b97f4a7c15ULL;
    for (const std::uint32_t word : words) hash = ((hash ^ word) * 0xff51afd7ed558ccdULL) ^ (hash >> 29U);
    return static_cast<std::size_t>(hash);
  }
};

/// Coordinates of a direction along two tangents, by least squares.
inline std::array<float, 2> along(const Vector& direction, const Vector& t1, const Vector& t2) {
  const double a = dot(t1, t1), b = dot(t1, t2), c = dot(t2, t2), p = dot(t1, direction), q = dot(t2, direction);
  const double det = a * c - b * b;
  if (!(det > 1e-12 * a * c) || (p == 0 && q == 0)) return {1, 0};
  const double x = (c * p - b * q) / det, y = (a * q - b * p) / det;
  const double largest = std::max(std::abs(x), std::abs(y));
  if (!(largest > 0) || !std::isfinite(largest)) return {1, 0};
  return {static_cast<float>(x / largest), static_cast<float>(y / largest)};
}

inline void make_corners(const heddle_scene_mesh& mesh, const Faces& faces, Object& object) {
  std::vector<Carried> carried;
  const bool has_coordinates = std::any_of(mesh.vertices, mesh.vertices + mesh.vertex_count, [](const HeddleVertex& v) {
    return v.u0 != 0 || v.v0 != 0 || v.u1 != 0 || v.v1 != 0;
  });
  for (const std::uint32_t vertex : faces.vertices)
    carried.push_back(carried_by(mesh.vertices[vertex], has_coordinates));
  std::vector<std::uint32_t> sizes = faces.sizes;
  for (std::int32_t level = 0; level < object.settings.levels; ++level) {
    carried = refine_carried(sizes, carried);
    sizes.assign(carried.size() / 4, 4);
  }
  const catmull_clark::Refined& refined = object.refined;
  std::unordered_map<Corner, std::uint32_t, CornerHash> known;
  std::vector<std::uint32_t> numbers;
  for (std::size_t i = 0; i < refined.quads.size(); ++i) {
    const Carried& one = carried[i];
    Corner corner;
    corner.row = refined.quads[i] | (one.is_mirrored ? kMirrored : 0);
    corner.uv0 = {static_cast<float>(one.values[0]), static_cast<float>(one.values[1])};
    corner.uv1 = {static_cast<float>(one.values[2]), static_cast<float>(one.values[3])};
    for (std::size_t k = 0; k < 4; ++k)
      corner.color |= static_cast<std::uint32_t>(std::lround(one.values[4 + k])) << (8 * k);
    corner.direction = {1, 0};
    if (has_coordinates) {
      corner.direction = along({one.values[8], one.values[9], one.values[10]},
                               weigh(refined.t1, refined.quads[i], object.sources, mesh.vertices),
                               weigh(refined.t2, refined.quads[i], object.sources, mesh.vertices));
    }
    const auto [found, is_new] = known.try_emplace(corner, static_cast<std::uint32_t>(object.corners.size()));
    if (is_new) object.corners.push_back(corner);
    numbers.push_back(found->second);
  }
  // Split from the corner's vertex to the face's: the same diagonal whichever way the quad is looked at.
  for (std::size_t q = 0; q < numbers.size(); q += 4) {
    for (const std::size_t k : {0, 1, 2, 0, 2, 3}) object.indices.push_back(numbers[q + k]);
  }
}

}  // namespace detail

/// Refines one mesh. Throws std::invalid_argument where it is no oriented manifold.
inline void build(const heddle_scene_mesh& mesh, Object& object) {
  object.material = mesh.material;
  const std::vector<std::uint32_t> point_of = detail::weld(mesh, object.sources);
  const detail::Faces faces = detail::faces_of(mesh, point_of);
  catmull_clark::Cage cage;
  cage.point_count = static_cast<catmull_clark::Index>(object.sources.size());
  cage.face_sizes = faces.sizes;
  cage.corners = faces.points;
  cage.pins_corners = object.settings.pins_corners;
  for (std::uint32_t i = 0; i < mesh.crease_count; ++i) {
    const std::uint32_t a = point_of[mesh.creases[2 * i]], b = point_of[mesh.creases[2 * i + 1]];
    const auto sharpness = static_cast<double>(mesh.sharpness[i]);
    if (a == b) {
      cage.sharp_points.emplace_back(a, sharpness);
    } else {
      cage.sharp_edges.emplace_back(std::array{a, b}, sharpness);
    }
  }
  detail::add_steep_edges(faces, mesh, object.settings, cage);
  object.refined = catmull_clark::refine_to_limit(cage, object.settings.levels);
  detail::make_corners(mesh, faces, object);
}

/// Quads of a mesh at a level, to be refused before they are made.
inline double quad_count(const heddle_scene_mesh& mesh, std::int32_t levels) {
  double corners = 0;
  for (std::uint32_t f = 0; f < mesh.face_count; ++f) corners += mesh.face_sizes != nullptr ? mesh.face_sizes[f] : 3;
  return corners * std::pow(4.0, levels - 1);
}
inline constexpr double kMostQuads = 1 << 21;

/// How often a technique splits faces: where components do not say, and the bounds of what they say.
struct Levels {
  std::int32_t otherwise, least, most;
};

/// In declare: every object of the scene that is planned for. What cannot be subdivided is told and left as it is.
inline heddle_status find_objects(const pass::PassHost& host, const Levels& levels,
                                  std::vector<std::shared_ptr<Object>>& objects) {
  objects.clear();
  std::optional<pass::Components> surfaces;
  if (const heddle_status status = pass::components(host, nullptr, "subdivision.surface", surfaces);
      status != HEDDLE_OK)
    return status;
  const pass::Meshes meshes(host);
  std::map<std::pair<std::uint32_t, Settings>, std::shared_ptr<Object>> by_key;
  for (std::uint32_t row = 0; row < surfaces->count(); ++row) {
    if (surfaces->owner_kind(row) != HEDDLE_OWNER_INSTANCE) continue;
    const std::uint32_t instance = surfaces->owner(row);
    Settings settings;
    settings.levels = static_cast<std::int32_t>(surfaces->written(row, "levels").value_or(levels.otherwise));
    settings.pins_corners = surfaces->values(row, "border")[0] == 0;
    settings.crease_angle = surfaces->values(row, "crease_angle")[0];
    settings.crease_sharpness = surfaces->values(row, "crease_sharpness")[0];
    if (settings.levels == 0 || instance >= meshes.content().instance_count) continue;
    settings.levels = std::clamp(settings.levels, levels.least, levels.most);
    const std::uint32_t mesh = meshes.instance(instance).mesh;
    std::shared_ptr<Object>& object = by_key[{mesh, settings}];
    if (!object) {
      object = std::make_shared<Object>();
      object->mesh = mesh;
      object->settings = settings;
    }
    object->instances.push_back(instance);
  }
  for (auto& [key, object] : by_key) {
    const heddle_scene_mesh mesh = meshes.mesh(object->mesh);
    const double quads = quad_count(mesh, object->settings.levels);
    if (quads > kMostQuads) {
      return host.fail(HEDDLE_UNSUPPORTED, "mesh " + std::to_string(object->mesh) + " would have " +
                                               std::to_string(static_cast<long long>(quads)) + " quads at level " +
                                               std::to_string(object->settings.levels) + ": expected at most " +
                                               std::to_string(static_cast<long long>(kMostQuads)) +
                                               "; choose fewer levels");
    }
    try {
      build(mesh, *object);
    } catch (const std::invalid_argument& reason) {
      host.warn("mesh " + std::to_string(object->mesh) + " is not subdivided but drawn as it is: " + reason.what() +
                "; points are counted as vertices at different places, in the mesh's order");
      continue;
    }
    if (!object->indices.empty()) objects.push_back(object);
  }
  return HEDDLE_OK;
}

/// The batch of an object: its corners from `first_vertex`, its triangles from `first_index` on.
inline heddle_batch batch_of(const Object& object, const heddle_scene_mesh& mesh, std::uint32_t first_vertex,
                             std::uint32_t first_index, std::uint32_t previous_vertex) {
  heddle_batch batch{};
  batch.struct_size = sizeof batch;
  batch.material = object.material;
  batch.first_index = first_index;
  batch.index_count = static_cast<std::uint32_t>(object.indices.size());
  batch.vertex_offset = static_cast<std::int32_t>(first_vertex);
  batch.previous_vertex = previous_vertex;
  const std::array<float, 6> bounds = bounds_of(object, mesh);
  std::copy(bounds.begin(), bounds.end(), batch.bounds);
  batch.placed = static_cast<std::uint32_t>(object.instances.size());
  batch.instances = object.instances.data();
  return batch;
}

}  // namespace heddle::subdivision
