// SPDX-License-Identifier: Apache-2.0
// The fine meshes of a coarse instance, and a ray from its surface -> the point of them that it stands for. For
// techniques that link embree3.
#pragma once

#include "embree_triangles.hpp"

#include <heddle/meshes.hpp>

#include <glm/glm.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <array>
#include <optional>
#include <string>
#include <vector>

class FineMeshes {
 public:
  struct Point {
    std::uint32_t instance = 0, triangle = 0;
    std::array<double, 3> weights{};  // of its corners
  };

  FineMeshes() = default;
  ~FineMeshes() {
    if (scene_ != nullptr) rtcReleaseScene(scene_);
    if (device_ != nullptr) rtcReleaseDevice(device_);
  }
  FineMeshes(const FineMeshes&) = delete;
  FineMeshes& operator=(const FineMeshes&) = delete;

  /// Places relative to `origin`, in the scene. False: Embree cannot; why is in error().
  [[nodiscard]] bool build(const heddle::pass::Meshes& meshes, std::span<const std::uint32_t> instances,
                           const glm::dvec3& origin) {
    if (!embree::make_scene(device_, scene_, error_)) return false;
    for (const std::uint32_t id : instances) {
      const heddle_scene_instance instance = meshes.instance(id);
      const heddle_scene_mesh mesh = meshes.mesh(instance.mesh);
      const glm::dmat4 place = glm::make_mat4(instance.scene_from_object);
      Shape& shape = shapes_.emplace_back();
      shape.instance = id;
      shape.side = glm::determinant(glm::dmat3(place)) < 0 ? -1 : 1;
      for (std::uint32_t v = 0; v < mesh.vertex_count; ++v) {
        const auto& p = mesh.vertices[v].position;
        shape.positions.emplace_back(glm::dvec3(place * glm::dvec4(p[0], p[1], p[2], 1.0)) - origin);
      }
      std::vector<std::uint32_t> all;
      for (std::uint32_t t = 0; t < mesh.index_count / 3; ++t) {
        shape.triangles.push_back(glm::make_vec3(mesh.indices + std::size_t{3} * t));
        all.push_back(t);
      }
      RTCBuffer vertices = embree::copy_vertices(device_, shape.positions);
      if (vertices == nullptr) return false;
      embree::attach_triangles(device_, scene_, static_cast<unsigned>(shapes_.size() - 1), vertices,
                               shape.positions.size(), shape.triangles, all, nullptr, nullptr);
      rtcReleaseBuffer(vertices);
    }
    rtcCommitScene(scene_);
    return error_.text[0] == '\0';
  }
  [[nodiscard]] const char* error() const { return error_.text; }

  /// Of the fronts within `reach` metres to both sides of a surface, the outermost: what is seen of them from outside.
  /// Nothing: there is none.
  [[nodiscard]] std::optional<Point> find(const glm::dvec3& from, const glm::dvec3& normal, double reach) const {
    if (scene_ == nullptr || normal == glm::dvec3(0.0)) return std::nullopt;
    RTCRayHit ray{};
    const glm::vec3 start(from + normal * reach), direction(-normal);
    ray.ray.org_x = start.x, ray.ray.org_y = start.y, ray.ray.org_z = start.z;
    ray.ray.dir_x = direction.x, ray.ray.dir_y = direction.y, ray.ray.dir_z = direction.z;
    ray.ray.mask = ~0U;
    const auto end = static_cast<float>(2 * reach);
    // Layers that lie on the way with their backs to it.
    for (int layer = 0; layer < kMostLayers; ++layer) {
      ray.ray.tfar = end;
      ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      rtcIntersect1(scene_, &context, &ray);
      if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
      const Shape& shape = shapes_[ray.hit.geomID];
      const glm::uvec3& corners = shape.triangles[ray.hit.primID];
      const glm::dvec3 a(shape.positions[corners.x]), b(shape.positions[corners.y]), c(shape.positions[corners.z]);
      if (glm::dot(glm::cross(b - a, c - a), normal) * shape.side > 0) {
        const auto u = static_cast<double>(ray.hit.u), v = static_cast<double>(ray.hit.v);
        return Point{shape.instance, ray.hit.primID, {1 - u - v, u, v}};
      }
      ray.ray.tnear = std::nextafter(ray.ray.tfar, end);
    }
    return std::nullopt;
  }

 private:
  static constexpr int kMostLayers = 64;
  struct Shape {
    std::uint32_t instance = 0;
    double side = 1;  // -1: a mirror turns its fronts around
    std::vector<glm::vec3> positions;
    std::vector<glm::uvec3> triangles;
  };
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  std::vector<Shape> shapes_;
  embree::ErrorText error_;
};
