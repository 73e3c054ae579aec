// SPDX-License-Identifier: Apache-2.0
// made/copies: the scene's meshes once more, in the place of some of its instances. made/listed, made/counted: squares
// that the GPU places. made/look: what a snapshot holds. For tests.
#include <heddle/meshes.hpp>

#include <algorithm>
#include <cstring>
#include <vector>

namespace {

using namespace heddle::pass;

// ---- copies
constexpr heddle_port kCopiesPorts[] = {
    surfaces_out("surfaces", HEDDLE_INOUT, "vertices", "indices", "instances, drawn from copies of their meshes"),
    buffer_out("vertices", 0, "HeddleVertex vertices[];", "copies", HEDDLE_PORT_KEPT),
    buffer_out("indices", 0, "uint indices[];", "copies", HEDDLE_PORT_KEPT),
};
constexpr heddle_parameter kCopiesParameters[] = {
    integer("every", "1", 1, 1000, 1, "of the instances, every such one is copied"),
    toggle("removes", false, "the instances are taken away and nothing is put there"),
    toggle("astray", false, "the first batch has an index too many"),
};
constexpr heddle_access kCopy[] = {host_write("vertices"), host_write("indices"), batches("surfaces")};
constexpr heddle_stage kCopiesStages[] = {cpu_stage("copy", kCopy)};

struct Copies {
  heddle_status declare(const PassHost& host) {
    const Meshes meshes(host);
    std::uint64_t vertices = 0, indices = 0;
    for (std::uint32_t m = 0; m < meshes.content().mesh_count; ++m) {
      vertices += std::uint64_t{2} * meshes.mesh(m).vertex_count;
      indices += meshes.mesh(m).index_count;
    }
    heddle_shape shape{};
    shape.byte_size = std::max<std::uint64_t>(vertices * sizeof(HeddleVertex), 64);
    heddle_status status = host.set_shape("vertices", shape);
    shape.byte_size = std::max<std::uint64_t>(indices * 4, 64);
    if (status == HEDDLE_OK) status = host.set_shape("indices", shape);
    return status;
  }
  heddle_status execute(const Frame& frame) {
    const Meshes meshes(frame.host());
    heddle_mapped vertices{}, indices{};
    heddle_status status = frame.map("vertices", vertices);
    if (status == HEDDLE_OK) status = frame.map("indices", indices);
    if (status != HEDDLE_OK) return status;
    std::vector<std::vector<std::uint32_t>> placed(meshes.content().mesh_count);
    const auto every = static_cast<std::uint32_t>(frame.host().integer("every"));
    for (std::uint32_t i = 0; i < meshes.content().instance_count; i += every)
      placed[meshes.instance(i).mesh].push_back(i);
    std::vector<heddle_batch> all;
    std::uint32_t first_vertex = 0, first_index = 0;
    for (std::uint32_t m = 0; m < placed.size(); ++m) {
      const heddle_scene_mesh mesh = meshes.mesh(m);
      auto* to = static_cast<HeddleVertex*>(vertices.data) + first_vertex;
      std::memcpy(to, mesh.vertices, mesh.vertex_count * sizeof(HeddleVertex));
      std::memcpy(to + mesh.vertex_count, mesh.previous_vertices, mesh.vertex_count * sizeof(HeddleVertex));
      std::memcpy(static_cast<std::uint32_t*>(indices.data) + first_index, mesh.indices,
                  std::size_t{4} * mesh.index_count);
      heddle_batch batch{};
      batch.struct_size = sizeof batch;
      batch.material = mesh.material;
      batch.first_index = first_index;
      batch.index_count = frame.host().toggle("removes") ? 0 : mesh.index_count;
      batch.vertex_offset = static_cast<std::int32_t>(first_vertex);
      batch.previous_vertex = mesh.vertex_count;
      batch.placed = static_cast<std::uint32_t>(placed[m].size());
      batch.instances = placed[m].data();
      for (std::uint32_t v = 0; v < mesh.vertex_count; ++v) {
        for (std::size_t k = 0; k < 3; ++k) {
          const float at = mesh.vertices[v].position[k];
          batch.bounds[k] = v == 0 ? at : std::min(batch.bounds[k], at);
          batch.bounds[3 + k] = v == 0 ? at : std::max(batch.bounds[3 + k], at);
        }
      }
      first_vertex += 2 * mesh.vertex_count;
      first_index += mesh.index_count;
      if (batch.placed > 0) all.push_back(batch);
    }
    if (!all.empty() && frame.host().toggle("astray")) all[0].first_index = first_index + 3 - all[0].index_count;
    return frame.set_batches("surfaces", all, 0);
  }
};

// ---- fields
constexpr std::uint32_t kMost = 64;
constexpr heddle_parameter kFieldParameters[] = {
    integer("count", "1", 0, kMost, 24, "squares"),
    triple("place", "m", 0, 0, {-3.5, -1, -8}, "of the first one's centre, in the scene"),
};
constexpr heddle_port kSquares = [] {
  heddle_port p = surfaces_out("surfaces", HEDDLE_INOUT, "vertices", "indices", "squares", "instances", "commands");
  p.flags = HEDDLE_PORT_OPTIONAL;
  return p;
}();
template <const heddle_port& kCommands>
constexpr heddle_port kFieldPorts[] = {
    kSquares,
    buffer_out("vertices", 4 * sizeof(HeddleVertex), "HeddleVertex vertices[];", "of one square"),
    buffer_out("indices", 6 * 4, "uint indices[];", "of one square"),
    buffer_out("instances", kMost * sizeof(HeddleInstance), "HeddleInstance instances[];", "where squares stand"),
    kCommands,
};
constexpr heddle_port kListed = list_out("commands", kMost, 20, "uint[5] commands[];", "a draw a square");
constexpr heddle_port kCounted =
    buffer_out("commands", kMost* std::uint64_t{20}, "uint commands[];", "a draw a square");
constexpr heddle_access kListedAccess[] = {storage_write("vertices"), storage_write("indices"),
                                           storage_write("instances"), appended("commands"), batches("surfaces")};
constexpr heddle_access kCountedAccess[] = {storage_write("vertices"), storage_write("indices"),
                                            storage_write("instances"), storage_write("commands"), batches("surfaces")};
constexpr heddle_stage kListedStages[] = {gpu_stage("place", kListedAccess)};
constexpr heddle_stage kCountedStages[] = {gpu_stage("place", kCountedAccess)};
constexpr heddle_shader kListedShaders[] = {compute_shader("place", "place", "listed.comp.glsl")};
constexpr heddle_shader kCountedShaders[] = {compute_shader("place", "place", "counted.comp.glsl")};

struct Field {
  heddle_status record(const Frame& frame) const {
    struct {
      float place[3];
      std::uint32_t count;
    } push{{}, static_cast<std::uint32_t>(frame.host().integer("count"))};
    const std::array<double, 3> place = frame.host().parameter3("place");
    for (std::size_t k = 0; k < 3; ++k) push.place[k] = static_cast<float>(place[k] - frame.info().origin[k]);
    const heddle_status status = frame.dispatch("place", 1, 1, 1, push);
    if (status != HEDDLE_OK) return status;
    heddle_batch batch{};
    batch.struct_size = sizeof batch;
    batch.command_count = push.count;
    return frame.set_batches("surfaces", {&batch, 1}, 0);
  }
};

// ---- look
constexpr std::uint32_t kSide = 256;
constexpr heddle_port kLookPorts[] = {
    surfaces_in("triangles", "what is looked at"),
    surfaces_in("others", "what is looked at too: as many triangles, and vertices, or it fails", HEDDLE_PORT_OPTIONAL),
    image_out_sized("color", VK_FORMAT_R32G32B32A32_SFLOAT, 1, 1,
                    "triangles, vertices, sums of x and of y of all corners in metres", HEDDLE_PORT_KEPT),
    image_out_sized("points", VK_FORMAT_R32G32B32A32_SFLOAT, kSide, kSide,
                    "layer 0: positions in the scene; 1: normals; 2: corners of triangles", HEDDLE_PORT_KEPT, 3),
};
constexpr heddle_access kLook[] = {host_read("triangles"), host_read("others"), host_write("color"),
                                   host_write("points")};
constexpr heddle_stage kLookStages[] = {cpu_stage("look", kLook)};
struct Look {
  heddle_status execute(const Frame& frame) const {
    const heddle_snapshot* snapshot = nullptr;
    heddle_alpha_test alpha = nullptr;
    heddle_mapped color{};
    heddle_status status = frame.snapshot("triangles", snapshot, alpha);
    if (status == HEDDLE_OK) status = frame.map("color", color);
    if (status != HEDDLE_OK) return status;
    if (frame.host().is_bound("others")) {
      const heddle_snapshot* other = nullptr;
      status = frame.snapshot("others", other, alpha);
      if (status != HEDDLE_OK) return status;
      if (other->triangle_count != snapshot->triangle_count || other->vertex_count != snapshot->vertex_count)
        return HEDDLE_BUG;
    }
    double x = 0, y = 0;
    for (std::size_t i = 0; i < std::size_t{snapshot->triangle_count} * 3; ++i) {
      const float* at = snapshot->positions + std::size_t{snapshot->indices[i]} * 3;
      x += static_cast<double>(at[0]) + snapshot->origin[0];
      y += static_cast<double>(at[1]) + snapshot->origin[1];
    }
    const float out[4] = {static_cast<float>(snapshot->triangle_count), static_cast<float>(snapshot->vertex_count),
                          static_cast<float>(x), static_cast<float>(y)};
    std::memcpy(color.data, out, sizeof out);
    heddle_mapped points{};
    status = frame.map("points", points);
    if (status != HEDDLE_OK) return status;
    constexpr std::size_t kTexels = std::size_t{kSide} * kSide;
    auto* texels = static_cast<float*>(points.data);
    std::fill_n(texels, 3 * 4 * kTexels, 0.0F);
    for (std::size_t i = 0; i < std::min<std::size_t>(snapshot->vertex_count, kTexels); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        texels[4 * i + k] =
            static_cast<float>(static_cast<double>(snapshot->positions[3 * i + k]) + snapshot->origin[k]);
        texels[4 * (kTexels + i) + k] = snapshot->normals[3 * i + k];
      }
    }
    for (std::size_t i = 0; i < std::min<std::size_t>(snapshot->triangle_count, kTexels); ++i)
      for (std::size_t k = 0; k < 3; ++k)
        texels[4 * (2 * kTexels + i) + k] = static_cast<float>(snapshot->indices[3 * i + k]);
    return HEDDLE_OK;
  }
};

constexpr heddle_technique kCopies = technique<Copies>("made/copies", "Meshes once more", "a test of the host",
                                                       kCopiesPorts, kCopiesParameters, kCopiesStages);
constexpr heddle_technique field(const char* id) {
  heddle_technique t = technique<Field>(id, "Squares that the GPU places", "a test of the host");
  t.parameters = list(kFieldParameters, t.parameter_count);
  return t;
}
constexpr heddle_technique kListedField = [] {
  heddle_technique t = field("made/listed");
  t.ports = list(kFieldPorts<kListed>, t.port_count);
  t.stages = list(kListedStages, t.stage_count);
  t.shaders = list(kListedShaders, t.shader_count);
  return t;
}();
constexpr heddle_technique kCountedField = [] {
  heddle_technique t = field("made/counted");
  t.ports = list(kFieldPorts<kCounted>, t.port_count);
  t.stages = list(kCountedStages, t.stage_count);
  t.shaders = list(kCountedShaders, t.shader_count);
  return t;
}();
constexpr heddle_technique kLookTechnique =
    technique<Look>("made/look", "What a snapshot holds", "a test of the host", kLookPorts, kLookStages);

}  // namespace

HEDDLE_PLUGIN(kCopies, kListedField, kCountedField, kLookTechnique)
