// SPDX-License-Identifier: Apache-2.0
// Embree behind the estimator: one scene of two geometries (solid, with holes), robust intersection.
#include "tracer.hpp"

#include <heddle/records.h>

#include <algorithm>

namespace heddle::ambient_occlusion {
namespace {

constexpr unsigned kOpaqueGeometry = 0;
constexpr unsigned kMaskedGeometry = 1;

using embree::kUlp;
using embree::kUncertainUlps;
using embree::largest_coordinate;

// Sine of the angle between ray and surface below which a larger search along the ray brings nothing: about half a
// degree, where an image has no more than a line of pixels.
constexpr double kLeastSlope = 0.01;

}  // namespace

void Tracer::filter(const RTCFilterFunctionNArguments* arguments) {
  const auto* tracer = static_cast<const Tracer*>(arguments->geometryUserPtr);
  if (tracer->alpha_test_.is_surface == nullptr) {
    return;
  }
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) {
      continue;
    }
    const std::uint32_t triangle = tracer->masked_[RTCHitN_primID(arguments->hit, arguments->N, i)];
    const float u = RTCHitN_u(arguments->hit, arguments->N, i);
    const float v = RTCHitN_v(arguments->hit, arguments->N, i);
    if (!tracer->alpha_test_.is_surface(tracer->alpha_test_.user, triangle, u, v)) {
      arguments->valid[i] = 0;
    }
  }
}

Tracer::Tracer() : device_(rtcNewDevice(nullptr)) {
  if (device_ == nullptr) {
    error_.say(rtcGetDeviceError(nullptr), "no device");
    return;
  }
  rtcSetDeviceErrorFunction(device_, &embree::ErrorText::note, &error_);
}

Tracer::~Tracer() {
  if (scene_ != nullptr) {
    rtcReleaseScene(scene_);
  }
  if (device_ != nullptr) {
    rtcReleaseDevice(device_);
  }
}

bool Tracer::build(const Triangles& triangles) {
  if (device_ == nullptr) {
    return false;
  }
  error_.text[0] = '\0';
  if (scene_ != nullptr) {
    rtcReleaseScene(scene_);
    scene_ = nullptr;
  }
  positions_.assign(triangles.positions.begin(), triangles.positions.end());
  indices_.assign(triangles.indices.begin(), triangles.indices.end());
  largest_coordinate_ = 0.0;
  for (const glm::vec3& position : positions_) {
    largest_coordinate_ = std::max(largest_coordinate_, largest_coordinate(position));
  }
  opaque_.clear();
  masked_.clear();
  for (std::uint32_t i = 0; i < indices_.size(); ++i) {
    if ((triangles.flags[i] & HEDDLE_SURFACE_BLENDED) != 0) {
      continue;
    }
    ((triangles.flags[i] & HEDDLE_SURFACE_MASKED) != 0 ? masked_ : opaque_).push_back(i);
  }

  scene_ = rtcNewScene(device_);
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
  RTCBuffer vertices = embree::copy_vertices(device_, positions_);
  if (vertices == nullptr) {
    return false;
  }
  embree::attach_triangles(device_, scene_, kOpaqueGeometry, vertices, positions_.size(), indices_, opaque_, nullptr,
                           nullptr);
  embree::attach_triangles(device_, scene_, kMaskedGeometry, vertices, positions_.size(), indices_, masked_,
                           &Tracer::filter, this);
  rtcReleaseBuffer(vertices);
  rtcCommitScene(scene_);
  return error_.text[0] == '\0';
}

SurfacePoint Tracer::anchor(const glm::dvec3& point, const glm::dvec3& view, const glm::dvec3& normal,
                            double tolerance) const {
  const double uncertain = kUncertainUlps * kUlp * std::max(largest_coordinate_, largest_coordinate(point));
  const double reach = (tolerance + uncertain) / std::max(std::abs(glm::dot(view, normal)), kLeastSlope);
  const glm::dvec3 start = point - reach * view;
  RTCRayHit ray{};
  ray.ray.org_x = static_cast<float>(start.x);
  ray.ray.org_y = static_cast<float>(start.y);
  ray.ray.org_z = static_cast<float>(start.z);
  ray.ray.dir_x = static_cast<float>(view.x);
  ray.ray.dir_y = static_cast<float>(view.y);
  ray.ray.dir_z = static_cast<float>(view.z);
  ray.ray.tnear = 0.0F;
  ray.ray.tfar = static_cast<float>(2.0 * reach);
  ray.ray.mask = ~0U;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene_, &context, &ray);

  if (ray.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
    const std::uint32_t triangle = (ray.hit.geomID == kMaskedGeometry ? masked_ : opaque_)[ray.hit.primID];
    const glm::uvec3 corner = indices_[triangle];
    const glm::dvec3 p0 = positions_[corner.x];
    const glm::dvec3 p1 = positions_[corner.y];
    const glm::dvec3 p2 = positions_[corner.z];
    const glm::dvec3 scaled_normal = glm::cross(p1 - p0, p2 - p0);
    const double length = glm::length(scaled_normal);
    if (length > 0.0) {
      // Surfaces have two sides: the facet's normal is turned to the normal that the depth image came with.
      const glm::dvec3 facet = scaled_normal * ((glm::dot(scaled_normal, normal) < 0.0 ? -1.0 : 1.0) / length);
      const double height = glm::dot(p0 - point, facet);
      if (std::abs(height) <= tolerance + uncertain) {
        // Along the facet's normal, not along the view: the foot point is well defined at grazing angles too.
        const glm::dvec3 on_plane = point + height * facet;
        const double scale = std::max(
            {largest_coordinate(p0), largest_coordinate(p1), largest_coordinate(p2), largest_coordinate(point)});
        return {on_plane + facet * (kUncertainUlps * kUlp * scale), normal, facet};
      }
    }
  }
  return {point + normal * tolerance, normal, normal};
}

void Tracer::trace(const glm::dvec3& origin, double radius, bool nearest, RayBatch& batch) const {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  alignas(64) std::array<int, kBatch> valid{};
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  const auto fill = [&](RTCRay16& ray) {
    for (std::uint32_t i = 0; i < kBatch; ++i) {
      valid[i] = i < batch.count ? -1 : 0;
      ray.org_x[i] = static_cast<float>(origin.x);
      ray.org_y[i] = static_cast<float>(origin.y);
      ray.org_z[i] = static_cast<float>(origin.z);
      ray.dir_x[i] = batch.direction[i].x;
      ray.dir_y[i] = batch.direction[i].y;
      ray.dir_z[i] = batch.direction[i].z;
      ray.tnear[i] = 0.0F;
      ray.tfar[i] = static_cast<float>(radius);
      ray.time[i] = 0.0F;
      ray.mask[i] = ~0U;
      ray.id[i] = i;
      ray.flags[i] = 0;
    }
  };
  if (nearest) {
    RTCRayHit16 rays;
    fill(rays.ray);
    std::fill_n(rays.hit.geomID, kBatch, RTC_INVALID_GEOMETRY_ID);
    std::fill_n(rays.hit.instID[0], kBatch, RTC_INVALID_GEOMETRY_ID);
    rtcIntersect16(valid.data(), scene_, &context, &rays);
    for (std::uint32_t i = 0; i < batch.count; ++i) {
      batch.distance[i] = rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID ? rays.ray.tfar[i] : kInfinity;
    }
  } else {
    RTCRay16 rays;
    fill(rays);
    rtcOccluded16(valid.data(), scene_, &context, &rays);
    for (std::uint32_t i = 0; i < batch.count; ++i) {
      // Embree marks an occluded ray by tfar = -infinity.
      batch.distance[i] = rays.tfar[i] < 0.0F ? 0.0F : kInfinity;
    }
  }
}

}  // namespace heddle::ambient_occlusion
