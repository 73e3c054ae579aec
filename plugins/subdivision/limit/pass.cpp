// SPDX-License-Identifier: Apache-2.0
// subdivision/limit: cages of the scene -> points of their limit surfaces with its normals, evaluated in float64 and
// rounded once. The reference of its rivals: slow, on the CPU, and as fine as asked for.
#include "subdivision_cages.hpp"

namespace {

using namespace heddle::pass;
using heddle::subdivision::Corner;
using heddle::subdivision::Object;
using heddle::subdivision::Vector;

constexpr heddle_port kPorts[] = {
    surfaces_out("surfaces", HEDDLE_INOUT, "vertices", "indices", "subdivided instances in the place of their meshes"),
    buffer_out("vertices", 0, "HeddleVertex vertices[];", "on the limit surfaces", HEDDLE_PORT_KEPT),
    buffer_out("indices", 0, "uint indices[];", "their triangles", HEDDLE_PORT_KEPT),
};
constexpr double kLevels[] = {3, 4, 5, 6};
constexpr heddle_parameter kParameters[] = {
    knob(integer("levels", "1", 1, 6, 5, "how often every face is split in four; components ask for fewer in vain",
                 HEDDLE_PARAMETER_REDECLARE),
         kLevels),
};
constexpr heddle_access kEvaluate[] = {host_write("vertices"), host_write("indices"), batches("surfaces")};
constexpr heddle_stage kStages[] = {cpu_stage("evaluate", kEvaluate)};

void store(const Vector& from, float (&to)[3]) {
  for (std::size_t k = 0; k < 3; ++k) to[k] = static_cast<float>(from[k]);
}

/// (6) to (9) of the README of catmull_clark at one vertex.
HeddleVertex evaluate(const Object& object, const Corner& corner, const HeddleVertex* cage) {
  const std::uint32_t row = corner.row & ~heddle::subdivision::kMirrored;
  const Vector place =
      heddle::subdivision::weigh(object.refined.limits, object.refined.vertices[row], object.sources, cage);
  const Vector t1 = heddle::subdivision::weigh(object.refined.t1, row, object.sources, cage);
  const Vector t2 = heddle::subdivision::weigh(object.refined.t2, row, object.sources, cage);
  const Vector none{};
  const Vector normal = heddle::subdivision::unit(
      heddle::subdivision::cross(heddle::subdivision::unit(t1, none), heddle::subdivision::unit(t2, none)), {0, 1, 0});
  Vector tangent{};
  for (std::size_t k = 0; k < 3; ++k)
    tangent[k] = static_cast<double>(corner.direction[0]) * t1[k] + static_cast<double>(corner.direction[1]) * t2[k];
  const double across = heddle::subdivision::dot(tangent, normal);
  for (std::size_t k = 0; k < 3; ++k) tangent[k] -= across * normal[k];
  const Vector axis = std::abs(normal[0]) < 0.6 ? Vector{1, 0, 0} : Vector{0, 1, 0};
  tangent = heddle::subdivision::unit(tangent,
                                      heddle::subdivision::unit(heddle::subdivision::cross(normal, axis), {1, 0, 0}));
  HeddleVertex vertex{};
  store(place, vertex.position);
  store(normal, vertex.normal);
  for (std::size_t k = 0; k < 3; ++k) vertex.tangent[k] = static_cast<float>(tangent[k]);
  vertex.tangent[3] = (corner.row & heddle::subdivision::kMirrored) != 0 ? -1.0F : 1.0F;
  vertex.u0 = corner.uv0[0];
  vertex.v0 = corner.uv0[1];
  vertex.u1 = corner.uv1[0];
  vertex.v1 = corner.uv1[1];
  vertex.color = corner.color;
  return vertex;
}

class LimitSurface {
 public:
  heddle_status declare(const PassHost& host) {
    const std::int32_t levels = host.integer("levels");
    const heddle_status status = heddle::subdivision::find_objects(host, {levels, levels, 6}, objects_);
    if (status != HEDDLE_OK) return status;
    const Meshes meshes(host);
    std::uint64_t vertices = 0, indices = 0;
    for (const std::shared_ptr<Object>& object : objects_) {
      vertices += object->corners.size() * (meshes.mesh(object->mesh).shape != 0 ? 2 : 1);
      indices += object->indices.size();
    }
    heddle_shape shape{};
    shape.byte_size = std::max<std::uint64_t>(vertices * sizeof(HeddleVertex), 64);
    if (const heddle_status made = host.set_shape("vertices", shape); made != HEDDLE_OK) return made;
    shape.byte_size = std::max<std::uint64_t>(indices * sizeof(std::uint32_t), 64);
    shapes_.clear();
    return host.set_shape("indices", shape);
  }

  std::uint32_t activity(const Frame& frame) const {
    return shapes(frame) == shapes_ && has_run_ ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  heddle_status execute(const Frame& frame) {
    const Meshes meshes(frame.host());
    std::vector<HeddleVertex> vertices;
    std::vector<std::uint32_t> indices;
    std::vector<heddle_batch> all;
    for (const std::shared_ptr<Object>& object : objects_) {
      const heddle_scene_mesh mesh = meshes.mesh(object->mesh);
      const auto first_vertex = static_cast<std::uint32_t>(vertices.size());
      const auto first_index = static_cast<std::uint32_t>(indices.size());
      const bool has_bent = mesh.shape != mesh.previous_shape;
      for (const Corner& corner : object->corners) vertices.push_back(evaluate(*object, corner, mesh.vertices));
      for (const Corner& corner : object->corners)
        if (has_bent) vertices.push_back(evaluate(*object, corner, mesh.previous_vertices));
      if (mesh.shape != 0 && !has_bent) vertices.resize(vertices.size() + object->corners.size());
      indices.insert(indices.end(), object->indices.begin(), object->indices.end());
      all.push_back(heddle::subdivision::batch_of(*object, mesh, first_vertex, first_index,
                                                  has_bent ? static_cast<std::uint32_t>(object->corners.size()) : 0));
    }
    heddle_status status = copy_to<HeddleVertex>(frame, "vertices", vertices);
    if (status == HEDDLE_OK) status = copy_to<std::uint32_t>(frame, "indices", indices);
    if (status == HEDDLE_OK) status = frame.set_batches("surfaces", all, ++revision_);
    shapes_ = shapes(frame);
    has_run_ = true;
    return status;
  }

 private:
  /// How the cages are bent now and were in the last frame.
  [[nodiscard]] std::vector<std::uint64_t> shapes(const Frame& frame) const {
    const Meshes meshes(frame.host());
    std::vector<std::uint64_t> all;
    for (const std::shared_ptr<Object>& object : objects_) {
      const heddle_scene_mesh mesh = meshes.mesh(object->mesh);
      all.push_back(mesh.shape);
      all.push_back(mesh.previous_shape);
    }
    return all;
  }
  template <typename Element>
  static heddle_status copy_to(const Frame& frame, const char* port, std::span<const Element> elements) {
    heddle_mapped mapped{};
    const heddle_status status = frame.map(port, mapped);
    if (status == HEDDLE_OK && !elements.empty()) std::memcpy(mapped.data, elements.data(), elements.size_bytes());
    return status;
  }

  std::vector<std::shared_ptr<Object>> objects_;
  std::vector<std::uint64_t> shapes_;
  std::uint64_t revision_ = 0;
  bool has_run_ = false;
};

constexpr heddle_technique kTechnique = [] {
  heddle_technique t = technique<LimitSurface>("subdivision/limit", "The limit surface itself, in float64",
                                               "Halstead, Kass and DeRose 1993, \"Efficient, Fair Interpolation Using "
                                               "Catmull-Clark Surfaces\"",
                                               kPorts, kParameters, kStages);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  t.features = "subdivision.surface";
  t.components = "subdivision.surface";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kTechnique)
