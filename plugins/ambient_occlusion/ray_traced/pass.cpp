// SPDX-License-Identifier: Apache-2.0
// ambient_occlusion/ray_traced: depth, normal and the scene's triangles -> visibility, row by row on the CPU's
// processors. The reference of its role.
#include "tracer.hpp"

#include <heddle/contents.hpp>
#include <heddle/parallel.hpp>
#include <heddle/pass.hpp>

#include <glm/gtc/packing.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <cstring>

namespace {

using namespace heddle::ambient_occlusion;
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("depth", "distance along the view axis, m; +inf where there is no surface"),
    image_in("normal_geometric", "octahedral, world axes"),
    value_in("camera", "the view that made depth"),
    surfaces_in("surfaces", "what occludes; blended batches do not"),
    image_out("visibility", VK_FORMAT_R32_SFLOAT, "1 open, 0 closed; 1 where there is no surface"),
};

constexpr const char* kFalloffs[] = {"none", "linear", nullptr};
constexpr double kSampleLadder[] = {1, 4, 16, 64, 256, 1024};
constexpr heddle_parameter kParameters[] = {
    parameter("radius", "m", 1e-6, 1e6, 0.5, "distance from which on a surface no longer occludes"),
    choice("falloff", kFalloffs, 0, "weight of a hit by its distance: none (1 within the radius), linear (down to 0)"),
    knob(integer("samples", "1", 1, 65536, 64, "rays a pixel; powers of two fill the hemisphere most evenly"),
         kSampleLadder),
};

constexpr heddle_access kTrace[] = {host_read("depth"), host_read("normal_geometric"), value("camera"),
                                    host_read("surfaces"), host_write("visibility")};
constexpr heddle_stage kStages[] = {cpu_stage("trace", kTrace)};

/// Texel of a two-channel image as the shaders would see it. Formats: those that is_readable_normal accepts.
glm::dvec2 read_pair(const heddle_mapped& image, std::uint32_t x, std::uint32_t y) {
  const auto* row = static_cast<const std::byte*>(image.data) + y * image.row_bytes;
  if (image.shape.format == VK_FORMAT_R32G32_SFLOAT) {
    glm::vec2 value;
    std::memcpy(&value, row + x * sizeof value, sizeof value);
    return value;
  }
  std::uint32_t packed = 0;
  std::memcpy(&packed, row + x * sizeof packed, sizeof packed);
  return image.shape.format == VK_FORMAT_R16G16_SNORM ? glm::unpackSnorm2x16(packed) : glm::unpackHalf2x16(packed);
}

bool is_readable_normal(std::uint32_t format) {
  return format == VK_FORMAT_R32G32_SFLOAT || format == VK_FORMAT_R16G16_SNORM || format == VK_FORMAT_R16G16_SFLOAT;
}

/// The inverse of plugins/shared/octahedral.glsl, in float64.
glm::dvec3 decode_octahedral(const glm::dvec2& encoded) {
  glm::dvec3 v(encoded, 1.0 - std::abs(encoded.x) - std::abs(encoded.y));
  const double fold = std::fmax(-v.z, 0.0);
  v.x -= v.x >= 0.0 ? fold : -fold;
  v.y -= v.y >= 0.0 ? fold : -fold;
  return glm::normalize(v);
}

struct Alpha {
  const heddle_snapshot* snapshot = nullptr;
  heddle_alpha_test test = nullptr;

  static bool is_surface(void* self, std::uint32_t triangle, float u, float v) {
    const auto* alpha = static_cast<const Alpha*>(self);
    return alpha->test(alpha->snapshot, triangle, u, v) != 0;
  }
};

/// A view in float64, as plugins/shared/view.glsl reads it; positions relative to the triangles' origin.
class View {
 public:
  View(const HeddleView& view, const glm::dvec3& origin)
      : view_(view), rel_from_view_(glm::dmat4(glm::make_mat4(view.rel_from_view))), origin_(origin) {}

  [[nodiscard]] glm::dvec3 position(std::uint32_t x, std::uint32_t y, double depth) const {
    return origin_ + glm::dvec3(rel_from_view_ * glm::dvec4(position_view(x, y, depth), 1.0));
  }
  /// Unit, from the eye through the pixel's centre.
  [[nodiscard]] glm::dvec3 direction(std::uint32_t x, std::uint32_t y) const {
    const glm::dvec3 ray = view_.is_orthographic != 0 ? glm::dvec3(0, 0, -1) : position_view(x, y, 1.0);
    return glm::normalize(glm::dmat3(rel_from_view_) * ray);
  }
  /// Metres that a pixel spans at a depth.
  [[nodiscard]] double pixel_size(double depth) const {
    const double size = 2.0 * static_cast<double>(view_.half_size[1]) / view_.extent[1];
    return view_.is_orthographic != 0 ? size : size * depth;
  }

 private:
  [[nodiscard]] glm::dvec3 position_view(std::uint32_t x, std::uint32_t y, double depth) const {
    const double ndc_x = (x + 0.5 - static_cast<double>(view_.jitter[0])) * 2.0 / view_.extent[0] - 1.0;
    const double ndc_y = (y + 0.5 - static_cast<double>(view_.jitter[1])) * 2.0 / view_.extent[1] - 1.0;
    const double scale = view_.is_orthographic != 0 ? 1.0 : depth;
    return {ndc_x * static_cast<double>(view_.half_size[0]) * scale,
            -ndc_y * static_cast<double>(view_.half_size[1]) * scale, -depth};
  }

  HeddleView view_;
  glm::dmat4 rel_from_view_;
  glm::dvec3 origin_;
};

// How far the depth image may lie off the triangle that it shows: rasterizers snap vertices to 1/256 of a pixel, which
// moves a plane by less than 1/128 of the pixel's size; eight times that, as a wider search costs nothing. Float32
// depth, rounded a few times on its way, adds 2^-20 of the distance.
constexpr double kDepthErrorPixels = 1.0 / 16.0;
constexpr double kDepthErrorRelative = 0x1p-20;

class RayTraced {
 public:
  std::uint32_t activity(const Frame& frame) const {
    return is_neutral(frame, "depth") ? HEDDLE_NOTHING : HEDDLE_RUN;  // nothing in view: all is open
  }

  heddle_status execute(const Frame& frame) {
    heddle_mapped depth;
    heddle_mapped normal;
    heddle_mapped visibility;
    for (const heddle_status status :
         {frame.map("depth", depth), frame.map("normal_geometric", normal), frame.map("visibility", visibility)}) {
      if (status != HEDDLE_OK) {
        return status;
      }
    }
    if (const heddle_status status = check(frame.host(), depth.shape, normal.shape, visibility.shape);
        status != HEDDLE_OK) {
      return status;
    }
    const auto camera = frame.value<HeddleView>("camera");
    if (camera.empty()) {
      return frame.host().fail(HEDDLE_BUG, "camera has no value");
    }
    const heddle_snapshot* snapshot = nullptr;
    Alpha alpha;
    if (const heddle_status status = frame.snapshot("surfaces", snapshot, alpha.test); status != HEDDLE_OK) {
      return status;
    }
    alpha.snapshot = snapshot;
    if (!update(*snapshot)) {
      return frame.host().fail(HEDDLE_FAILED, tracer_.error());
    }
    tracer_.set_alpha_test(alpha.test != nullptr ? AlphaTest{&Alpha::is_surface, &alpha} : AlphaTest{});
    // In large worlds both origins are far from the scene's zero: their difference is taken in float64.
    const View view(camera.front(), glm::make_vec3(frame.info().origin) - glm::make_vec3(snapshot->origin));
    const heddle_status status = trace(frame, view, depth, normal, visibility);
    tracer_.set_alpha_test({});
    return status;
  }

 private:
  static heddle_status check(const PassHost& host, const heddle_shape& depth, const heddle_shape& normal,
                             const heddle_shape& visibility) {
    if ((depth.format != VK_FORMAT_R32_SFLOAT && depth.format != VK_FORMAT_D32_SFLOAT) ||
        !is_readable_normal(normal.format)) {
      return host.fail(
          HEDDLE_UNSUPPORTED,
          "reads depth as r32f or d32, normal_geometric as rg16 snorm, rg16f or rg32f; found the formats " +
              std::to_string(depth.format) + " and " + std::to_string(normal.format) + " (VkFormat)");
    }
    for (const heddle_shape& shape : {depth, normal}) {
      if (shape.width != visibility.width || shape.height != visibility.height) {
        return host.fail(HEDDLE_BAD_INPUT, "depth, normal_geometric and visibility must have one size");
      }
    }
    return HEDDLE_OK;
  }

  bool update(const heddle_snapshot& snapshot) {
    if (is_built_ && revision_ == snapshot.revision) {
      return true;
    }
    static_assert(sizeof(glm::vec3) == 12 && sizeof(glm::uvec3) == 12);
    is_built_ = tracer_.build({{reinterpret_cast<const glm::vec3*>(snapshot.positions), snapshot.vertex_count},
                               {reinterpret_cast<const glm::uvec3*>(snapshot.indices), snapshot.triangle_count},
                               {snapshot.flags, snapshot.triangle_count}});
    revision_ = snapshot.revision;
    return is_built_;
  }

  heddle_status trace(const Frame& frame, const View& view, const heddle_mapped& depth, const heddle_mapped& normal,
                      const heddle_mapped& visibility) const {
    const double radius = frame.host().parameter("radius");
    const auto falloff = static_cast<Falloff>(frame.host().choice("falloff"));
    const auto samples = static_cast<std::uint32_t>(frame.host().integer("samples"));
    const bool is_nearest = falloff != Falloff::kNone;
    const std::uint64_t seed = frame.info().seed;
    return for_each_index(frame.host(), visibility.shape.height, [&](std::uint64_t row) {
      const auto y = static_cast<std::uint32_t>(row);
      const auto* depths =
          reinterpret_cast<const float*>(static_cast<const std::byte*>(depth.data) + y * depth.row_bytes);
      auto* out = reinterpret_cast<float*>(static_cast<std::byte*>(visibility.data) + y * visibility.row_bytes);
      for (std::uint32_t x = 0; x < visibility.shape.width; ++x) {
        const auto d = static_cast<double>(depths[x]);
        if (!std::isfinite(d)) {
          out[x] = 1.0F;
          continue;
        }
        const glm::dvec3 n = decode_octahedral(read_pair(normal, x, y));
        const double tolerance = kDepthErrorPixels * view.pixel_size(d) + kDepthErrorRelative * d;
        const SurfacePoint point = tracer_.anchor(view.position(x, y, d), view.direction(x, y), n, tolerance);
        out[x] = static_cast<float>(estimate_visibility(point, radius, falloff, samples, pixel_seed(seed, x, y),
                                                        [&](const glm::dvec3& origin, double reach, RayBatch& batch) {
                                                          tracer_.trace(origin, reach, is_nearest, batch);
                                                        }));
      }
    });
  }

  Tracer tracer_;
  std::uint64_t revision_ = 0;  // of the triangles in tracer_
  bool is_built_ = false;
};

constexpr heddle_technique kRayTraced = [] {
  heddle_technique t = technique<RayTraced>(
      "ambient_occlusion/ray_traced", "Ambient occlusion by rays through the scene's triangles, on the CPU",
      "Zhukov, Iones and Kronin 1998, An Ambient Light Illumination Model; Wald et al. 2014, Embree", kPorts,
      kParameters, kStages);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kRayTraced)
