// SPDX-License-Identifier: Apache-2.0
#include "geometry.hpp"

#include <algorithm>
#include <cmath>

namespace heddle::path_tracer {
namespace {

using glm::dvec3;

constexpr std::size_t kOpaque = 0, kMasked = 1;  // geometries of what is solid

Query query_of(const Ray& ray, Query::Kind kind) {
  const auto f = [](double x) { return static_cast<float>(x); };
  return {{f(ray.origin.x), f(ray.origin.y), f(ray.origin.z)},
          {f(ray.direction.x), f(ray.direction.y), f(ray.direction.z)},
          f(ray.length),
          kind};
}

void fill(RTCRay& out, const Query& query) {
  out.org_x = query.origin[0];
  out.org_y = query.origin[1];
  out.org_z = query.origin[2];
  out.dir_x = query.direction[0];
  out.dir_y = query.direction[1];
  out.dir_z = query.direction[2];
  out.tnear = 0.0F;
  out.tfar = query.length;
  out.time = 0.0F;
  out.mask = ~0U;
  out.id = 0;
  out.flags = 0;
}

/// hit.geomID says whether there is one.
void intersect(RTCScene scene, const Query& query, RTCRayHit& out) {
  fill(out.ray, query);
  out.hit.geomID = out.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &out);
}

bool is_occluded(RTCScene scene, const Query& query) {
  RTCRay ray;
  fill(ray, query);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &ray);
  return ray.tfar < 0.0F;  // Embree's mark
}

void note(Queries* record, const Query& query, bool is_hit) {
  if (record == nullptr) return;
  record->list.push_back(query);
  record->hits += is_hit ? 1U : 0U;
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
  planes_.resize(snapshot.triangle_count);
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    const dvec3 p0 = positions_[indices_[i].x], p1 = positions_[indices_[i].y], p2 = positions_[indices_[i].z];
    const dvec3 scaled = glm::cross(p1 - p0, p2 - p0);
    const double length = glm::length(scaled);
    const double largest =
        std::max({embree::largest_coordinate(p0), embree::largest_coordinate(p1), embree::largest_coordinate(p2)});
    planes_[i] = {length > 0.0 ? scaled / length : dvec3(0.0), 0.5 * length,
                  embree::kUncertainUlps * embree::kUlp * largest};
  }
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

bool Geometry::find(const Part& part, const Ray& ray, Hit& out, Query::Kind kind, Queries* record) const {
  if (part.scene == nullptr) return false;
  const Query query = query_of(ray, kind);
  RTCRayHit found;
  intersect(part.scene, query, found);
  const bool is_hit = found.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  note(record, query, is_hit);
  if (!is_hit) return false;
  out.triangle = part.triangles[found.hit.geomID][found.hit.primID];
  out.u = static_cast<double>(found.hit.u);
  out.v = static_cast<double>(found.hit.v);
  out.distance = static_cast<double>(found.ray.tfar);
  return true;
}

bool Geometry::find_blended(const Ray& ray, Hit& out, Queries* record) const {
  return find(blended_, ray, out, Query::kNearestBlended, record);
}

bool Geometry::find_nearest(const Ray& ray, Hit& out, Queries* record) const {
  const bool is_solid = find(solid_, ray, out, Query::kNearestSolid, record);
  if (!has_blended()) return is_solid;
  Ray rest = ray;
  if (is_solid) rest.length = out.distance;
  return find_blended(rest, out, record) || is_solid;
}

bool Geometry::is_blocked(const Ray& ray, Queries* record) const {
  if (solid_.scene == nullptr) return false;
  const Query query = query_of(ray, Query::kBlocked);
  const bool is_hit = is_occluded(solid_.scene, query);
  note(record, query, is_hit);
  return is_hit;
}

std::uint64_t Geometry::replay(std::span<const Query> queries) const {
  std::uint64_t hits = 0;
  for (const Query& query : queries) {
    if (query.kind == Query::kBlocked) {
      hits += is_occluded(solid_.scene, query) ? 1U : 0U;
      continue;
    }
    RTCRayHit found;
    intersect(query.kind == Query::kNearestSolid ? solid_.scene : blended_.scene, query, found);
    hits += found.hit.geomID != RTC_INVALID_GEOMETRY_ID ? 1U : 0U;
  }
  return hits;
}

Foot Geometry::foot(std::uint32_t triangle, double u, double v) const {
  const glm::uvec3 corner = indices_[triangle];
  const dvec3 p0 = positions_[corner.x], p1 = positions_[corner.y], p2 = positions_[corner.z];
  const Plane& plane = planes_[triangle];
  return {p0 + u * (p1 - p0) + v * (p2 - p0), plane.facet, plane.area, plane.lift};
}

}  // namespace heddle::path_tracer
