// SPDX-License-Identifier: Apache-2.0
// Triangles -> geometries of Embree scenes, and how far off float32 intersections with them may be. For techniques that
// link embree3.
#pragma once

#include <embree3/rtcore.h>

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <span>

namespace embree {

// Half a unit in the last place of float32 near 1, and how many of them an intersection may be off by, relative to the
// largest coordinate in play: 1 for each rounded vertex coordinate, 1 for the rounded origin, the rest for Embree's
// Pluecker test, which subtracts the origin first (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle
// Intersection").
inline constexpr double kUlp = 0x1p-24;
inline constexpr double kUncertainUlps = 8.0;

inline double largest_coordinate(const glm::dvec3& p) {
  return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
}

/// What a device's last error was, for people.
struct ErrorText {
  char text[160] = "";
  void say(RTCError code, const char* message) {
    std::snprintf(text, sizeof text, "Embree error %d: %s", static_cast<int>(code), message != nullptr ? message : "");
  }
  /// An RTCErrorFunction; `self` is an ErrorText.
  static void note(void* self, RTCError code, const char* message) {
    static_cast<ErrorText*>(self)->say(code, message);
  }
};

/// A device that builds with one thread, and an empty scene of it in robust mode. False: there is none; why is in
/// `error`.
inline bool make_scene(RTCDevice& device, RTCScene& scene, ErrorText& error) {
  device = rtcNewDevice("threads=1");
  if (device == nullptr) {
    error.say(rtcGetDeviceError(nullptr), "there is no device");
    return false;
  }
  rtcSetDeviceErrorFunction(device, &ErrorText::note, &error);
  scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  return true;
}

/// NULL: out of memory, and the device's error function was told. Embree reads 16 bytes at the last vertex.
inline RTCBuffer copy_vertices(RTCDevice device, std::span<const glm::vec3> positions) {
  static_assert(sizeof(glm::vec3) == 12 && sizeof(glm::uvec3) == 12);
  RTCBuffer vertices = rtcNewBuffer(device, positions.size_bytes() + 16);
  if (vertices != nullptr && !positions.empty())
    std::memcpy(rtcGetBufferData(vertices), positions.data(), positions.size_bytes());
  return vertices;
}

/// Adds those of all triangles that `chosen` numbers as geometry `id`: Embree's primitive i is triangle chosen[i].
/// `filter`, with `user`, judges every hit; nullptr: none does.
inline void attach_triangles(RTCDevice device, RTCScene scene, unsigned id, RTCBuffer vertices,
                             std::size_t vertex_count, std::span<const glm::uvec3> triangles,
                             std::span<const std::uint32_t> chosen, RTCFilterFunctionN filter, void* user) {
  if (chosen.empty()) return;
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices, 0, sizeof(glm::vec3),
                       vertex_count);
  auto* corners = static_cast<glm::uvec3*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(glm::uvec3), chosen.size()));
  if (corners != nullptr) {
    for (std::size_t i = 0; i < chosen.size(); ++i) corners[i] = triangles[chosen[i]];
    if (filter != nullptr) {
      rtcSetGeometryUserData(geometry, user);
      rtcSetGeometryIntersectFilterFunction(geometry, filter);
      rtcSetGeometryOccludedFilterFunction(geometry, filter);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, id);
  }
  rtcReleaseGeometry(geometry);
}

}  // namespace embree
