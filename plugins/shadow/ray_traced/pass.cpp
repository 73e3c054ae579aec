// SPDX-License-Identifier: Apache-2.0
// shadow/ray_traced: the scene's triangles to a tree of boxes, made anew when they change, and the function that sends
// rays through it. The reference of its role.
#include "casters.hpp"

#include <heddle/pass.hpp>
#include <heddle/views.hpp>

#include <bit>

namespace {

using namespace heddle::pass;
using ray_traced_shadow::Casters;
using ray_traced_shadow::kMostBytes;

constexpr double kSamplesLadder[] = {1, 4, 16, 64, 256};
constexpr double kMaskLadder[] = {3, 4, 5, 6, 7};
constexpr heddle_parameter kParameters[] = {
    knob(integer("samples", "1", 1, 4096, 16,
                 "rays to a light that has a size; others take one. Powers of two fill it most evenly"),
         kSamplesLadder),
    parameter("near_distance", "m", 0, 100, 0.02,
              "what is nearer than this to a light with a position casts no shadow"),
    knob(integer("mask_levels", "1", 0, 10, 6,
                 "an alpha-masked triangle is 4^n micro-triangles, each there or a hole by the alpha at its middle"),
         kMaskLadder),
};

/// Three vec4 that ray_traced.glsl reads.
struct RayFrame {
  std::array<float, 3> shift;  // metres, of the tree's frame from the frame's origin
  float seed;                  // bits of an integer
  std::array<float, 4> ball;   // Casters::ball
  float samples, near_distance;
  std::array<float, 2> unused;
};

constexpr heddle_port kPorts[] = {
    value_in("lights", "the lights that `light` indexes"),
    surfaces_in("surfaces", "what casts"),
    value_in("camera", "the main view: how far points may be off their surface"),
    value_in("shadow_settings_light", nullptr),
    value_out("bvh_nodes", kMostBytes, "the tree of boxes, two uvec4 a node", "uvec4 bvh_nodes[];"),
    value_out("bvh_triangles", kMostBytes, "corners, three uvec4 a triangle", "uvec4 bvh_triangles[];"),
    value_out("bvh_masks", kMostBytes, "bits of alpha masks", "uint bvh_masks[];"),
    value_out("ray_frame", sizeof(RayFrame), "where the tree is, and the parameters", "vec4 ray_frame[];"),
    list_out("cut_short", 1U << 16U, 4, "uint cut_short[];", "lights at which a pixel had no steps left"),
};

constexpr heddle_access kBuildAccesses[] = {host_read("surfaces"),  value("lights"),    value("bvh_nodes"),
                                            value("bvh_triangles"), value("bvh_masks"), value("ray_frame")};
constexpr heddle_stage kStages[] = {cpu_stage("build", kBuildAccesses)};
constexpr heddle_access kFunctionAccesses[] = {
    value("lights"),    value("camera"),    value("shadow_settings_light"), value("bvh_nodes"), value("bvh_triangles"),
    value("bvh_masks"), value("ray_frame"), appended("cut_short")};
constexpr heddle_function kFunctions[] = {function("shadow", "ray_traced.glsl", kFunctionAccesses)};

bool casts_shadow(const HeddleLight& light) {
  const bool shines = light.intensity[0] > 0 || light.intensity[1] > 0 || light.intensity[2] > 0;
  return shines && light.type != HEDDLE_LIGHT_ENVIRONMENT && (light.flags & HEDDLE_LIGHT_CASTS_SHADOW) != 0;
}

class RayTraced {
 public:
  /// The values may be others than before.
  heddle_status prepare(const PassHost&) {
    is_built_ = false;
    return HEDDLE_OK;
  }

  heddle_status execute(const Frame& frame) {
    bool is_wanted = false;
    for (const HeddleLight& light : frame.value<HeddleLight>("lights")) is_wanted |= casts_shadow(light);
    // Before the first light that casts there is nothing to build.
    if (!is_wanted && !is_built_) return HEDDLE_OK;
    if (is_wanted) {
      if (const heddle_status status = update(frame); status != HEDDLE_OK) return status;
    }
    RayFrame rays{};
    for (std::size_t k = 0; k < 3; ++k) rays.shift[k] = static_cast<float>(frame.info().origin[k] - origin_[k]);
    const std::uint64_t seed = frame.info().seed;
    rays.seed = std::bit_cast<float>(static_cast<std::uint32_t>(seed ^ seed >> 32U));
    rays.ball = ball_;
    rays.samples = static_cast<float>(frame.host().parameter("samples"));
    rays.near_distance = static_cast<float>(frame.host().parameter("near_distance"));
    return frame.set_value("ray_frame", std::span<const RayFrame>(&rays, 1));
  }

  void counted(const PassHost& host, const heddle_list_count& count) {
    const std::uint64_t cut = std::uint64_t{count.count} + count.overflow;
    if (cut == 0 || is_told_) return;
    is_told_ = true;
    host.warn(
        std::to_string(cut) +
        " pixels take more steps than a shader has, and see the mean of the rays that were done; lower 'samples', or "
        "let fewer lights cast shadows");
  }

 private:
  heddle_status update(const Frame& frame) {
    const heddle_snapshot* snapshot = nullptr;
    heddle_alpha_test test = nullptr;
    heddle_status status = frame.snapshot("surfaces", snapshot, test);
    if (status != HEDDLE_OK) return status;
    const auto levels = static_cast<std::uint32_t>(frame.host().integer("mask_levels"));
    if (is_built_ && revision_ == snapshot->revision && levels_ == levels) return HEDDLE_OK;
    is_built_ = false;
    Casters casters;
    std::string error;
    if (!make_casters(builder_, *snapshot, test, levels, casters, error))
      return frame.host().fail(HEDDLE_UNSUPPORTED, error);
    if (status = frame.set_value("bvh_nodes", std::span<const bvh::Node>(casters.tree.nodes)); status == HEDDLE_OK)
      status = frame.set_value("bvh_triangles", std::span<const ray_traced_shadow::Triangle>(casters.triangles));
    if (status == HEDDLE_OK) status = frame.set_value("bvh_masks", std::span<const std::uint32_t>(casters.masks));
    if (status != HEDDLE_OK) return status;
    std::copy(std::begin(snapshot->origin), std::end(snapshot->origin), origin_.begin());
    ball_ = casters.ball;
    revision_ = snapshot->revision;
    levels_ = levels;
    is_built_ = true;
    heddle::pass::count(frame.host(), "trees_built", 1);
    heddle::pass::count(frame.host(), "triangles_in_tree", casters.triangles.size());
    return HEDDLE_OK;
  }

  bvh::Builder builder_;
  bool is_built_ = false;
  std::uint64_t revision_ = 0;      // of the triangles in the tree
  std::uint32_t levels_ = 0;        // of its masks
  std::array<double, 3> origin_{};  // of the tree's frame, in the scene
  std::array<float, 4> ball_{};
  bool is_told_ = false;
};

constexpr heddle_technique kRayTraced = [] {
  heddle_technique t = technique<RayTraced>(
      "shadow/ray_traced", "Shadows by rays through the scene's triangles: hard, and soft from lights with a size",
      "Whitted 1980, An Improved Illumination Model for Shaded Display; Cook, Porter and Carpenter 1984, Distributed "
      "Ray "
      "Tracing; Woop, Benthin and Wald 2013, Watertight Ray/Triangle Intersection",
      kPorts, kParameters, kStages, kFunctions);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  t.components = "shadow.settings";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kRayTraced)
