// SPDX-License-Identifier: Apache-2.0
#include "geometry.hpp"

#include <algorithm>
#include <cmath>

namespace heddle::path_tracer {
namespace {

using glm::dvec3;

constexpr std::size_t kOpaque = 0, kMasked = 1;  // geometries of what is solid

template <typename EmbreeRay>
void fill(EmbreeRay& out, const Ray& ray) {
  out.org_x = static_cast<float>(ray.origin.x);
  out.org_y = static_cast<float>(ray.origin.y);
  out.org_z = static_cast<float>(ray.origin.z);
  out.dir_x = static_cast<float>(ray.direction.x);
  out.dir_y = static_cast<float>(ray.direction.y);
  out.dir_z = static_cast<float>(ray.direction.z);
  out.tnear = 0.0F;
  out.tfar = static_cast<float>(ray.length);
  out.time = 0.0F;
  out.mask = ~0U;
  out.id = 0;
  out.flags = 0;
}

}  // namespace

Geometry::Geometry() : device_(rtcNewDevice(nullptr)) {
  if (device_ == nullptr) {
    error_.say(rtcGetDeviceError(nullptr), "no device");
    return;
  }
  rtcSetDeviceErrorFunction(device_, &embree::ErrorText::note, &error_);
}

Geometry::~Geometry() {
  release(solid_);
  release(blended_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

void Geometry::release(Part& part) {
  if (part.scene != nullptr) rtcReleaseScene(part.scene);
  part = {};
}

void Geometry::filter(const RTCFilterFunctionNArguments* arguments) {
  const auto* geometry = static_cast<const Geometry*>(arguments->geometryUserPtr);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const std::uint32_t triangle = geometry->solid_.triangles[kMasked][RTCHitN_primID(arguments->hit, arguments->N, i)];
    if (geometry->test_(geometry->snapshot_, triangle, RTCHitN_u(arguments->hit, arguments->N, i),
                        RTCHitN_v(arguments->hit, arguments->N, i)) == 0)
      arguments->valid[i] = 0;
  }
}

void Geometry::build(Part& part, RTCBuffer vertices, std::vector<std::vector<std::uint32_t>> triangles,
                     std::size_t masked) {
  release(part);
  if (std::ranges::all_of(triangles, [](const auto& list) { return list.empty(); })) return;
  part.triangles = std::move(triangles);
  part.scene = rtcNewScene(device_);
  rtcSetSceneFlags(part.scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(part.scene, RTC_BUILD_QUALITY_HIGH);
  for (std::size_t id = 0; id < part.triangles.size(); ++id)
    embree::attach_triangles(device_, part.scene, static_cast<unsigned>(id), vertices, positions_.size(), indices_,
                             part.triangles[id], id == masked ? &Geometry::filter : nullptr, this);
  rtcCommitScene(part.scene);
}

bool Geometry::update(const heddle_snapshot& snapshot) {
  if (is_built_ && revision_ == snapshot.revision) return true;
  if (device_ == nullptr) return false;
  error_.text[0] = '\0';
  is_built_ = false;
  const auto* positions = reinterpret_cast<const glm::vec3*>(snapshot.positions);
  const auto* indices = reinterpret_cast<const glm::uvec3*>(snapshot.indices);
  positions_.assign(positions, positions + snapshot.vertex_count);
  indices_.assign(indices, indices + snapshot.triangle_count);
  std::vector<std::vector<std::uint32_t>> solid(2), blended(1);
  for (std::uint32_t i = 0; i < snapshot.triangle_count; ++i) {
    const std::uint32_t flags = snapshot.flags[i];
    ((flags & HEDDLE_SURFACE_BLENDED) != 0 ? blended[0]
                                           : solid[(flags & HEDDLE_SURFACE_MASKED) != 0 ? kMasked : kOpaque])
        .push_back(i);
  }
  RTCBuffer vertices = embree::copy_vertices(device_, positions_);
  if (vertices == nullptr) return false;
  build(solid_, vertices, std::move(solid), kMasked);
  build(blended_, vertices, std::move(blended), ~std::size_t{0});
  rtcReleaseBuffer(vertices);
  revision_ = snapshot.revision;
  is_built_ = error_.text[0] == '\0';
  return is_built_;
}

bool Geometry::find(const Part& part, const Ray& ray, Hit& out) const {
  if (part.scene == nullptr) return false;
  RTCRayHit query;
  fill(query.ray, ray);
  query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(part.scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  out.triangle = part.triangles[query.hit.geomID][query.hit.primID];
  out.u = static_cast<double>(query.hit.u);
  out.v = static_cast<double>(query.hit.v);
  out.distance = static_cast<double>(query.ray.tfar);
  return true;
}

bool Geometry::find_blended(const Ray& ray, Hit& out) const {
  return find(blended_, ray, out);
}

bool Geometry::find_nearest(const Ray& ray, Hit& out) const {
  const bool is_solid = find(solid_, ray, out);
  if (!has_blended()) return is_solid;
  Ray rest = ray;
  if (is_solid) rest.length = out.distance;
  return find(blended_, rest, out) || is_solid;
}

bool Geometry::is_blocked(const Ray& ray) const {
  if (solid_.scene == nullptr) return false;
  RTCRay query;
  fill(query, ray);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(solid_.scene, &context, &query);
  return query.tfar < 0.0F;  // Embree's mark
}

Foot Geometry::foot(std::uint32_t triangle, double u, double v) const {
  const glm::uvec3 corner = indices_[triangle];
  const dvec3 p0 = positions_[corner.x], p1 = positions_[corner.y], p2 = positions_[corner.z];
  const dvec3 e1 = p1 - p0, e2 = p2 - p0;
  const dvec3 scaled = glm::cross(e1, e2);
  const double length = glm::length(scaled);
  Foot foot;
  foot.position = p0 + u * e1 + v * e2;
  foot.facet = length > 0.0 ? scaled / length : dvec3(0.0);
  foot.area = 0.5 * length;
  foot.lift =
      embree::kUncertainUlps * embree::kUlp *
      std::max({embree::largest_coordinate(p0), embree::largest_coordinate(p1), embree::largest_coordinate(p2)});
  return foot;
}

}  // namespace heddle::path_tracer
