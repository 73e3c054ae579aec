// SPDX-License-Identifier: Apache-2.0
// All instances -> one list of triangles in host memory, with what the alpha test of masked surfaces needs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "scene/geometry.hpp"
#include "scene/made_surfaces.hpp"
#include "scene/upload.hpp"

namespace heddle::scene {

/// Alpha of one masked material, copied, so that the snapshot outlives changes of the scene.
struct AlphaLook {
  float alpha = 1, cutoff = 0.5F;
  std::uint32_t uv_set = 0;
  std::array<float, 4> uv_matrix{1, 0, 0, 1};
  std::array<float, 2> uv_offset{0, 0};
  std::array<std::uint32_t, 2> wrap{0, 0};
  bool is_nearest = false;             // the sampler does not blend texels
  std::int64_t width = 0, height = 0;  // 0: no texture
  std::vector<std::uint8_t> texels;    // alpha alone
};

/// The alpha test is given the snapshot alone and finds the rest behind it, so it comes first.
struct SnapshotData {
  heddle_snapshot record{};
  std::vector<float> positions, normals, uvs;
  std::vector<std::array<float, 2>> uv1;
  std::vector<std::array<float, 4>> tangents;
  std::vector<std::uint32_t> colors;  // rgba8
  std::vector<std::uint32_t> indices, materials, flags;
  std::vector<AlphaLook> looks;
  std::vector<std::uint32_t> look_of;  // by material; HEDDLE_NONE: no holes
  std::uint64_t content_revision = 0, motion_revision = 0;
  bool holds_scene = true;
  std::vector<std::uint64_t> made_revisions;
  glm::dvec3 made_origin{0.0};  // of instances that techniques placed
};
static_assert(std::is_standard_layout_v<SnapshotData>);

namespace {

std::int64_t wrapped(std::int64_t texel, std::int64_t size, std::uint32_t mode) {
  if (mode == 2) {
    return std::clamp<std::int64_t>(texel, 0, size - 1);
  }
  const std::int64_t period = mode == 1 ? 2 * size : size;
  const std::int64_t place = ((texel % period) + period) % period;
  return place < size ? place : period - 1 - place;
}

/// At the finest level, bilinear or nearest as the sampler magnifies, as a GPU filters: texel centres at halves.
float sample_alpha(const AlphaLook& look, float u, float v) {
  // Beyond this, coordinates in float32 say nothing about texels any more.
  constexpr float kLimit = 1e6F;
  const double x = static_cast<double>(std::clamp(u, -kLimit, kLimit)) * static_cast<double>(look.width) - 0.5;
  const double y = static_cast<double>(std::clamp(v, -kLimit, kLimit)) * static_cast<double>(look.height) - 0.5;
  const double x0 = std::floor(look.is_nearest ? x + 0.5 : x), y0 = std::floor(look.is_nearest ? y + 0.5 : y);
  const auto texel = [&](double column, double row) {
    const std::int64_t i = wrapped(static_cast<std::int64_t>(column), look.width, look.wrap[0]);
    const std::int64_t j = wrapped(static_cast<std::int64_t>(row), look.height, look.wrap[1]);
    return static_cast<double>(look.texels[static_cast<std::size_t>(j * look.width + i)]) / 255.0;
  };
  if (look.is_nearest) {
    return static_cast<float>(texel(x0, y0));
  }
  const double fx = x - x0, fy = y - y0;
  const double top = texel(x0, y0) * (1 - fx) + texel(x0 + 1, y0) * fx;
  const double bottom = texel(x0, y0 + 1) * (1 - fx) + texel(x0 + 1, y0 + 1) * fx;
  return static_cast<float>(top * (1 - fy) + bottom * fy);
}

std::uint32_t test_alpha(const heddle_snapshot* snapshot, std::uint32_t triangle, float u, float v) {
  const auto& data = *reinterpret_cast<const SnapshotData*>(snapshot);
  if (triangle >= data.record.triangle_count) {
    return 1;
  }
  const std::uint32_t index = data.look_of[data.materials[triangle]];
  if (index == HEDDLE_NONE) {
    return 1;
  }
  const AlphaLook& look = data.looks[index];
  const std::uint32_t* corners = &data.indices[std::size_t{triangle} * 3];
  const std::array<float, 3> weights = {1.0F - u - v, u, v};
  float uv[2] = {0, 0}, vertex_alpha = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t vertex = corners[k];
    const float* at = look.uv_set == 1 ? data.uv1[vertex].data() : &data.uvs[vertex * 2];
    uv[0] += weights[k] * at[0];
    uv[1] += weights[k] * at[1];
    vertex_alpha += weights[k] * static_cast<float>(data.colors[vertex] >> 24U) / 255.0F;
  }
  float alpha = look.alpha * vertex_alpha;
  if (look.width > 0) {
    alpha *= sample_alpha(look, look.uv_matrix[0] * uv[0] + look.uv_matrix[2] * uv[1] + look.uv_offset[0],
                          look.uv_matrix[1] * uv[0] + look.uv_matrix[3] * uv[1] + look.uv_offset[1]);
  }
  return alpha >= look.cutoff ? 1 : 0;
}

AlphaLook look_of(const Scene& scene, const Material& material) {
  AlphaLook look;
  const HeddleMaterial& record = material.record;
  look.alpha = record.base_color[3];
  look.cutoff = record.alpha_cutoff;
  look.uv_set = (record.texture_uv_sets >> HEDDLE_TEXTURE_BASE_COLOR) & 1U;
  std::copy(std::begin(record.uv_rotation_scale), std::end(record.uv_rotation_scale), look.uv_matrix.begin());
  std::copy(std::begin(record.uv_offset), std::end(record.uv_offset), look.uv_offset.begin());
  if (const std::uint32_t index = material.textures[HEDDLE_TEXTURE_BASE_COLOR]; index != HEDDLE_NONE) {
    const Texture& texture = scene.textures.at(index);
    look.wrap = texture.wrap;
    look.is_nearest = (texture.filter & HEDDLE_FILTER_NEAREST_MAGNIFIED) != 0;
    look.width = texture.width;
    look.height = texture.height;
    look.texels.resize(std::size_t{texture.width} * texture.height);
    for (std::size_t i = 0; i < look.texels.size(); ++i) {
      look.texels[i] = texture.rgba[i * 4 + 3];
    }
  }
  return look;
}

/// Triangles of one material, as they are placed.
void add_triangles(const Scene& scene, std::uint32_t material, const glm::dmat4& matrix,
                   std::span<const HeddleVertex> vertices, std::span<const std::uint32_t> indices, bool is_flipped,
                   const glm::dvec3& origin, SnapshotData& data) {
  const glm::dmat3 linear(matrix);
  const glm::dmat3 normals = normal_matrix(linear);
  const glm::dvec3 translation = glm::dvec3(matrix[3]) - origin;
  const auto first = static_cast<std::uint32_t>(data.positions.size() / 3);
  for (const HeddleVertex& vertex : vertices) {
    const glm::dvec3 position =
        linear * glm::dvec3(vertex.position[0], vertex.position[1], vertex.position[2]) + translation;
    const glm::dvec3 given(vertex.normal[0], vertex.normal[1], vertex.normal[2]);
    const glm::dvec3 turned = normals * given;
    const double length = glm::length(turned);
    const glm::dvec3 normal = length > 0 ? turned / length : given;
    for (int i = 0; i < 3; ++i) {
      data.positions.push_back(static_cast<float>(position[i]));
      data.normals.push_back(static_cast<float>(normal[i]));
    }
    data.uvs.push_back(vertex.u0);
    data.uvs.push_back(vertex.v0);
    data.uv1.push_back({vertex.u1, vertex.v1});
    data.colors.push_back(vertex.color);
    const glm::dvec3 along = linear * glm::dvec3(vertex.tangent[0], vertex.tangent[1], vertex.tangent[2]);
    const double tangent_length = glm::length(along);
    const glm::dvec3 tangent = tangent_length > 0 ? along / tangent_length : along;
    // A mirror turns the handedness around, as it does for surfaces that are drawn.
    data.tangents.push_back({static_cast<float>(tangent.x), static_cast<float>(tangent.y),
                             static_cast<float>(tangent.z), is_flipped ? -vertex.tangent[3] : vertex.tangent[3]});
  }
  const std::uint32_t flags = surface_flags(scene.materials.at(material).record);
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    // Corners of front faces run counter-clockwise also where the transform mirrors.
    data.indices.push_back(first + indices[i]);
    data.indices.push_back(first + indices[is_flipped ? i + 2 : i + 1]);
    data.indices.push_back(first + indices[is_flipped ? i + 1 : i + 2]);
    data.materials.push_back(material);
    data.flags.push_back(flags);
  }
}

bool is_mirrored(const glm::dmat4& matrix) {
  return glm::determinant(glm::dmat3(matrix)) < 0;
}

void add_instance(const Scene& scene, const Instance& instance, const glm::dvec3& origin, SnapshotData& data) {
  const Mesh& mesh = scene.meshes.at(instance.mesh);
  add_triangles(scene, mesh.material, instance.scene_from_object, mesh.vertices, mesh.indices,
                is_mirrored(instance.scene_from_object), origin, data);
}

/// A stretch of made indices, with the vertices that it uses alone.
struct Stretch {
  std::span<const HeddleVertex> vertices;
  std::vector<std::uint32_t> indices;
};

Stretch stretch_of(const MadeContents& made, std::uint32_t first, std::uint32_t count, std::int32_t vertex_offset) {
  Stretch stretch;
  if (count == 0 || std::uint64_t{first} + count > made.indices.size()) return stretch;
  const auto indices = made.indices.subspan(first, count);
  const auto [low, high] = std::minmax_element(indices.begin(), indices.end());
  const std::int64_t begin = std::int64_t{*low} + vertex_offset, end = std::int64_t{*high} + vertex_offset + 1;
  // Where a command reaches out of the buffers, drawing has no triangle either.
  if (begin < 0 || end > static_cast<std::int64_t>(made.vertices.size())) return stretch;
  stretch.vertices = made.vertices.subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(end - begin));
  for (const std::uint32_t index : indices) stretch.indices.push_back(index - *low);
  return stretch;
}

void add_made(const Scene& scene, const MadeContents& made, std::span<const std::uint8_t> is_gone,
              const glm::dvec3& frame_origin, const glm::dvec3& origin, SnapshotData& data) {
  for (const MadeBatch& batch : made.surfaces->batches) {
    const heddle_batch& record = batch.record;
    if (record.material >= scene.materials.size()) continue;
    if (batch.is_placed_by_scene()) {
      const Stretch stretch = stretch_of(made, record.first_index, record.index_count, record.vertex_offset);
      for (const std::uint32_t instance : batch.placed) {
        if (instance >= scene.instances.size() || is_gone[instance] != 0) continue;
        const glm::dmat4& matrix = scene.instances[instance].scene_from_object;
        add_triangles(scene, record.material, matrix, stretch.vertices, stretch.indices, is_mirrored(matrix), origin,
                      data);
      }
      continue;
    }
    const std::size_t first = std::min<std::size_t>(record.first_command, made.commands.size());
    for (const auto& command :
         made.commands.subspan(first, std::min<std::size_t>(record.command_count, made.commands.size() - first))) {
      const Stretch stretch = stretch_of(made, command.firstIndex, command.indexCount, command.vertexOffset);
      for (std::uint64_t i = command.firstInstance; i < std::uint64_t{command.firstInstance} + command.instanceCount;
           ++i) {
        if (i >= made.instances.size()) break;
        glm::dmat4 matrix(1.0);
        for (int k = 0; k < 16; ++k) matrix[k / 4][k % 4] = static_cast<double>(made.instances[i].rel_from_object[k]);
        matrix[3] += glm::dvec4(frame_origin, 0.0);
        add_triangles(scene, record.material, matrix, stretch.vertices, stretch.indices, record.is_flipped != 0, origin,
                      data);
      }
    }
  }
}

}  // namespace

struct Snapshot::State : SnapshotData {};

const heddle_snapshot& Snapshot::update(const Scene& scene) {
  return update(scene, true, {}, glm::dvec3(0.0));
}

bool Snapshot::is_of(const Scene& scene, bool holds_scene, std::span<const MadeSurfaces* const> made,
                     const glm::dvec3& origin) const {
  if (!state_ || state_->content_revision != scene.content_revision ||
      state_->motion_revision != scene.motion_revision || state_->holds_scene != holds_scene) {
    return false;
  }
  bool has_own_places = false;
  for (const MadeSurfaces* surfaces : made) has_own_places |= surfaces->has_own_places();
  return std::equal(
             made.begin(), made.end(), state_->made_revisions.begin(), state_->made_revisions.end(),
             [](const MadeSurfaces* surfaces, std::uint64_t revision) { return surfaces->revision == revision; }) &&
         (!has_own_places || state_->made_origin == origin);
}

const heddle_snapshot& Snapshot::update(const Scene& scene, bool holds_scene, std::span<const MadeContents> made,
                                        const glm::dvec3& frame_origin) {
  std::vector<const MadeSurfaces*> surfaces;
  for (const MadeContents& contents : made) surfaces.push_back(contents.surfaces);
  if (is_of(scene, holds_scene, surfaces, frame_origin)) return state_->record;
  // What a later technique places is gone from all that is beneath it.
  std::vector<std::uint8_t> is_gone(scene.instances.size(), 0), is_placed(scene.instances.size(), 0);
  for (const MadeContents& contents : made) mark_placed(*contents.surfaces, is_placed);
  std::size_t vertices = 0, triangles = 0;
  const auto check_size = [&] {
    if (std::max(vertices, triangles) <= std::numeric_limits<std::uint32_t>::max()) return;
    throw Error(HEDDLE_UNSUPPORTED, fmt::format("a snapshot of {} vertices and {} triangles is too large: at most 2^32",
                                                vertices, triangles));
  };
  for (std::size_t i = 0; i < scene.instances.size() && holds_scene; ++i) {
    if (is_placed[i] != 0) continue;
    vertices += scene.meshes.at(scene.instances[i].mesh).vertices.size();
    triangles += scene.meshes.at(scene.instances[i].mesh).indices.size() / 3;
  }
  check_size();
  auto state = std::make_shared<State>();
  SnapshotData& data = *state;
  data.positions.reserve(vertices * 3);
  data.normals.reserve(vertices * 3);
  data.uvs.reserve(vertices * 2);
  data.uv1.reserve(vertices);
  data.tangents.reserve(vertices);
  data.colors.reserve(vertices);
  data.indices.reserve(triangles * 3);
  for (const Material& material : scene.materials) {
    data.look_of.push_back(HEDDLE_NONE);
    if (material.record.alpha_mode == HEDDLE_ALPHA_MASK) {
      data.look_of.back() = static_cast<std::uint32_t>(data.looks.size());
      data.looks.push_back(look_of(scene, material));
    }
  }
  const std::array<glm::dvec3, 2> bounds = scene.bounds();
  const glm::dvec3 origin = 0.5 * (bounds[0] + bounds[1]);
  for (const MadeContents& contents : made) {
    add_made(scene, contents, is_gone, frame_origin, origin, data);
    mark_placed(*contents.surfaces, is_gone);
  }
  for (std::size_t i = 0; i < scene.instances.size() && holds_scene; ++i) {
    if (is_gone[i] == 0) add_instance(scene, scene.instances[i], origin, data);
  }
  vertices = data.positions.size() / 3;
  triangles = data.indices.size() / 3;
  check_size();
  data.content_revision = scene.content_revision;
  data.motion_revision = scene.motion_revision;
  data.holds_scene = holds_scene;
  for (const MadeSurfaces* one : surfaces) data.made_revisions.push_back(one->revision);
  data.made_origin = frame_origin;
  data.record.struct_size = sizeof data.record;
  data.record.vertex_count = static_cast<std::uint32_t>(vertices);
  data.record.triangle_count = static_cast<std::uint32_t>(triangles);
  for (int i = 0; i < 3; ++i) {
    data.record.origin[i] = origin[i];
  }
  data.record.revision = Scene::new_revision();
  data.record.positions = data.positions.data();
  data.record.normals = data.normals.data();
  data.record.uvs = data.uvs.data();
  data.record.indices = data.indices.data();
  data.record.materials = data.materials.data();
  data.record.flags = data.flags.data();
  state_ = std::move(state);
  return state_->record;
}

const heddle_snapshot& Snapshot::record() const {
  return state_->record;
}

heddle_snapshot_attributes snapshot_attributes(const heddle_snapshot& snapshot) {
  const auto& data = reinterpret_cast<const SnapshotData&>(snapshot);
  heddle_snapshot_attributes attributes{};
  attributes.struct_size = sizeof attributes;
  attributes.tangents = data.tangents.empty() ? nullptr : data.tangents.front().data();
  attributes.uvs_1 = data.uv1.empty() ? nullptr : data.uv1.front().data();
  attributes.colors = data.colors.data();
  return attributes;
}

heddle_alpha_test Snapshot::alpha_test() const {
  return test_alpha;
}

}  // namespace heddle::scene
