// SPDX-License-Identifier: Apache-2.0
// ambient_occlusion/ssao: depth and normal -> visibility, by points around each surface point that the depth image
// shows something in front of.
#include "samples.hpp"

#include <heddle/contents.hpp>
#include <heddle/pass.hpp>

#include <glm/gtc/packing.hpp>

#include <algorithm>
#include <cstring>

namespace {

using namespace heddle::pass;

constexpr std::uint32_t kMostSamples = 4096;
constexpr std::uint32_t kVariableFactor = 4;  // = samples_for_footprint in ssao.glsl

constexpr heddle_port kPorts[] = {
    image_in("depth", "distance along the view axis, m; +inf where there is no surface"),
    image_in("normal_geometric", "octahedral, world axes"),
    value_in("camera", "the view that made depth"),
    value_out("offsets", std::uint64_t{kMostSamples} * kVariableFactor * sizeof(std::array<float, 4>),
              "where samples lie, in units of the radius", "vec4 offsets[];"),
    image_out_sized("pattern", VK_FORMAT_R16G16B16A16_SNORM, 4, 4, "unit vectors or quaternions that turn the samples",
                    HEDDLE_PORT_KEPT),
    image_out("reduced_depth", VK_FORMAT_R32_SFLOAT, "depth as samples look it up, m; 1e30 where there is no surface"),
    // 16 bits: one step of 8 would be 8 % of a visibility of 0.05, which the display shows as bands.
    image_out_sized("noisy", VK_FORMAT_R16_UNORM, 1, 1, "occlusion of the sets, in two layers that take turns", 0, 2),
    image_out("visibility", VK_FORMAT_R16_UNORM, "1 open, 0 closed; 1 where there is no surface"),
};

constexpr const char* kFalloffs[] = {"none", "linear", "power", "quadratic", "curve", nullptr};
constexpr const char* kDirections[] = {"fibonacci", "octants", "random", nullptr};
constexpr const char* kRandomizers[] = {"reflect", "rotate", "none", nullptr};
constexpr const char* kHemispheres[] = {"flip", "basis", "none", nullptr};
constexpr const char* kCombinations[] = {"before_blur", "after_blur", nullptr};
constexpr const char* kDepthFilters[] = {"point", "mean", "max", "min", "checkerboard", "median", nullptr};
constexpr const char* kDepthFetches[] = {"nearest", "bilinear", nullptr};
constexpr const char* kDepthFormats[] = {"float32", "float16", nullptr};
constexpr const char* kBorders[] = {"open", "clamp", nullptr};
constexpr const char* kLimiters[] = {"radius", "samples", "none", nullptr};
constexpr const char* kBlurs[] = {"separable", "square", "plain", nullptr};
constexpr const char* kEdges[] = {"plane", "depth", nullptr};
constexpr double kPointLadder[] = {8, 16, 32, 64, 128};
constexpr double kDivisorLadder[] = {4, 2, 1};
constexpr double kBlurLadder[] = {0, 1, 2};

constexpr std::uint32_t kConstant = HEDDLE_PARAMETER_CONSTANT;
constexpr std::uint32_t kRedeclare = HEDDLE_PARAMETER_REDECLARE;
constexpr heddle_parameter kParameters[] = {
    parameter("radius", "m", 1e-6, 1e6, 0.5, "distance of the farthest samples of the wide set"),
    choice("falloff", kFalloffs, 0, "occlusion of a sample by how far it is behind the visible surface", kConstant),
    parameter("full", "1", 0, 10, 0.2, "power: up to here, in radii, a sample is occluded fully; quadratic: by half"),
    parameter("range", "1", 1e-3, 1000, 1.5, "from here on, in radii, a sample is not occluded"),
    parameter("power", "1", 0, 16, 1, "power: exponent of the way down between the two"),
    triple("curve_near", "1", 0, 1, {1, 1, 1}, "curve: occlusion at 0, 1/6 and 2/6 of the range"),
    triple("curve_far", "1", 0, 1, {1, 0.6, 0.3}, "curve: occlusion at 3/6, 4/6 and 5/6 of the range"),
    knob(integer("points", "1", 1, kMostSamples, 16, "samples around a surface point"), kPointLadder),
    choice("directions", kDirections, 0, "how the points are spread"),
    parameter("shortest", "1", 0, 1, 0.5, "distance of the nearest points, in radii"),
    choice("randomize", kRandomizers, 0, "what turns the points from pixel to pixel", kConstant),
    integer("tile", "px", 1, 64, 4, "side of the tile of that pattern", kRedeclare),
    integer("seed", "1", 0, 2147483647, 0, "of the points and the pattern"),
    choice("hemisphere", kHemispheres, 0, "what keeps points out of the surface itself", kConstant),
    toggle("above_plane", true, "only what rises above a point's tangent plane occludes it", kConstant),
    parameter("tight_share", "1", 0, 0.75, 0.25, "share of the points in a second, tight set; 0: one set",
              HEDDLE_TYPE_FLOAT, kRedeclare),
    parameter("tight_radius", "1", 1e-3, 1, 0.25, "its radius, in radii of the wide set"),
    parameter("tight_full", "1", 0, 10, 0.2, "as full, in radii of the tight set"),
    parameter("tight_range", "1", 1e-3, 1000, 3, "as range, in radii of the tight set"),
    parameter("tight_power", "1", 0, 16, 1, "as power"),
    choice("combine", kCombinations, 1, "when the darker set is taken", kConstant | kRedeclare),
    knob(integer("depth_divisor", "1", 1, 4, 1, "by what the depth that points look up is reduced", kRedeclare),
         kDivisorLadder),
    choice("depth_filter", kDepthFilters, 0, "which depth stands for the pixels that it replaces", kConstant),
    choice("depth_fetch", kDepthFetches, 0, "how it is looked up", kConstant),
    choice("depth_format", kDepthFormats, 0, "how it is stored", kConstant | kRedeclare),
    choice("border", kBorders, 0, "points beyond the image: open, or as the border", kConstant),
    choice("limiter", kLimiters, 0, "close-ups: cut the radius, take up to four times the samples, or neither",
           kConstant),
    parameter("footprint", "1", 1e-3, 10, 0.25, "of which radius on, in heights of the image"),
    toggle("scale_curve", true, "the limiter scales full and range with the radius", kConstant),
    knob(integer("evaluate_divisor", "1", 1, 4, 1, "by what the image of occlusion is reduced", kConstant | kRedeclare),
         kDivisorLadder),
    choice("blur", kBlurs, 0, "edge-aware in rows, then columns; edge-aware over the square; not edge-aware",
           kConstant),
    knob(integer("blur_passes", "1", 0, 4, 1, "how often the occlusion is blurred"), kBlurLadder),
    integer("blur_radius", "px", 1, 16, 3, "half width of the window"),
    parameter("blur_sigma", "px", 0.1, 16, 1.5, "of the Gaussian"),
    choice("blur_edges", kEdges, 0, "a neighbour must lie near the pixel's plane, or have its depth", kConstant),
    parameter("blur_distance", "1", 0, 10, 0.03, "how near, in radii"),
    parameter("blur_normal", "1", -1, 1, 0.9, "least cosine between the normals"),
    parameter("contrast", "1", 0.01, 16, 1, "exponent of the visibility"),
};

constexpr heddle_access kPattern[] = {host_write("pattern")};
constexpr heddle_access kReduce[] = {sampled("depth"), storage_write("reduced_depth")};
constexpr heddle_access kOcclude[] = {
    sampled("depth"), sampled("normal_geometric"), sampled_linear("reduced_depth"), sampled("pattern"), value("camera"),
    value("offsets"), storage_write("noisy")};
constexpr heddle_access kBlur[] = {sampled("depth"), sampled("normal_geometric"), value("camera"),
                                   storage_read_write("noisy")};
constexpr heddle_access kResolve[] = {sampled("depth"), sampled("normal_geometric"), sampled("noisy"), value("camera"),
                                      storage_write("visibility")};
enum : std::uint32_t { kPatternStage, kReduceStage, kOccludeStage, kBlurStage, kResolveStage };
constexpr heddle_stage kStages[] = {cpu_stage("pattern", kPattern), gpu_stage("reduce", kReduce),
                                    gpu_stage("occlude", kOcclude), gpu_stage("blur", kBlur),
                                    gpu_stage("resolve", kResolve)};
constexpr heddle_shader kShaders[] = {
    compute_shader("reduce", "reduce", "reduce.comp.glsl"), compute_shader("occlude", "occlude", "occlude.comp.glsl"),
    compute_shader("blur", "blur", "blur.comp.glsl"), compute_shader("resolve", "resolve", "resolve.comp.glsl")};

constexpr std::uint32_t kRotate = 1;           // of kRandomizers
constexpr std::uint32_t kBasis = 1;            // of kHemispheres
constexpr std::uint32_t kVariableSamples = 1;  // of kLimiters
constexpr std::uint32_t kBlurSquare = 1;       // of kBlurs

std::uint32_t divided(std::uint32_t size, std::uint32_t divisor) {
  return (size + divisor - 1) / divisor;
}

// As the shaders declare them.
struct OccludePush {
  std::int32_t tight, wide;
};
struct BlurPush {
  std::int32_t reach_x, reach_y, source, reserved;
};
struct ResolvePush {
  std::int32_t source;
};

class Ssao {
 public:
  heddle_status declare(const PassHost& host) {
    const heddle_shape depth = host.shape("depth");
    heddle_shape pattern{};
    pattern.width = pattern.height = static_cast<std::uint32_t>(host.integer("tile"));
    heddle_shape reduced{};
    const auto depth_divisor = static_cast<std::uint32_t>(host.integer("depth_divisor"));
    reduced.width = divided(depth.width, depth_divisor);
    reduced.height = divided(depth.height, depth_divisor);
    reduced.format = host.choice("depth_format") == 0 ? VK_FORMAT_R32_SFLOAT : VK_FORMAT_R16_SFLOAT;
    heddle_shape noisy{};
    const auto divisor = static_cast<std::uint32_t>(host.integer("evaluate_divisor"));
    noisy.width = divided(depth.width, divisor);
    noisy.height = divided(depth.height, divisor);
    // Two sets stay apart only where they are blurred apart.
    const bool is_pair = host.parameter("tight_share") > 0.0 && host.choice("combine") != 0;
    noisy.format = is_pair ? VK_FORMAT_R16G16_UNORM : VK_FORMAT_R16_UNORM;
    pattern_of_ = {};
    heddle_status status = host.set_shape("pattern", pattern);
    if (status == HEDDLE_OK) status = host.set_shape("reduced_depth", reduced);
    return status != HEDDLE_OK ? status : host.set_shape("noisy", noisy);
  }

  std::uint32_t activity(const Frame& frame) const {
    if (frame.stage() == kPatternStage)
      return pattern_of_ == pattern_parameters(frame.host()) ? HEDDLE_KEEP : HEDDLE_RUN;
    return is_neutral(frame, "depth") ? HEDDLE_NOTHING : HEDDLE_RUN;  // nothing in view: all is open
  }

  heddle_status execute(const Frame& frame) {
    heddle_mapped pattern;
    if (const heddle_status status = frame.map("pattern", pattern); status != HEDDLE_OK) return status;
    pattern_of_ = pattern_parameters(frame.host());
    const auto seed = static_cast<std::uint64_t>(frame.host().integer("seed"));
    const auto made = frame.host().choice("randomize") == kRotate ? ssao::make_rotations(pattern.shape.width, seed)
                                                                  : ssao::make_reflections(pattern.shape.width, seed);
    auto* texels = static_cast<std::byte*>(pattern.data);
    for (std::size_t i = 0; i < made.size(); ++i) {
      const std::uint64_t texel = glm::packSnorm4x16(glm::vec4(made[i]));
      std::memcpy(texels + i * sizeof texel, &texel, sizeof texel);
    }
    return HEDDLE_OK;
  }

  heddle_status record(const Frame& frame) {
    switch (frame.stage()) {
      case kReduceStage:
        return frame.dispatch_over("reduce", "reduced_depth");
      case kOccludeStage:
        return occlude(frame);
      case kBlurStage:
        return blur(frame);
      default:
        return frame.dispatch_over("resolve", "visibility", ResolvePush{blurred_layer(frame.host())});
    }
  }

 private:
  static std::vector<double> pattern_parameters(const PassHost& host) {
    return {host.parameter("tile"), host.parameter("seed"), host.parameter("randomize")};
  }

  static heddle_status occlude(const Frame& frame) {
    const PassHost host = frame.host();
    const auto samples = static_cast<double>(host.integer("points"));
    const double share = host.parameter("tight_share");
    const auto tight = static_cast<std::uint32_t>(share > 0.0 ? std::max(1.0, std::round(share * samples)) : 0.0);
    const std::uint32_t wide = std::max(static_cast<std::uint32_t>(samples), tight + 1) - tight;
    const bool is_variable = host.choice("limiter") == kVariableSamples;
    std::vector<std::array<float, 4>> offsets;
    for (const std::uint32_t count : {tight, wide}) {
      const auto set = ssao::make_offsets(static_cast<ssao::Directions>(host.choice("directions")),
                                          count * (is_variable ? kVariableFactor : 1), host.parameter("shortest"),
                                          host.choice("hemisphere") == kBasis, is_variable,
                                          static_cast<std::uint64_t>(host.integer("seed")) + offsets.size());
      offsets.insert(offsets.end(), set.begin(), set.end());
    }
    if (const heddle_status status = frame.set_value("offsets", std::span<const std::array<float, 4>>(offsets));
        status != HEDDLE_OK) {
      return status;
    }
    const heddle_shape noisy = host.shape("noisy");
    return frame.dispatch("occlude", divided(noisy.width, 8), divided(noisy.height, 8), 1,
                          OccludePush{static_cast<std::int32_t>(tight), static_cast<std::int32_t>(wide)});
  }

  static bool is_square(const PassHost& host) { return host.choice("blur") == kBlurSquare; }

  /// The layer that the last blur wrote.
  static std::int32_t blurred_layer(const PassHost& host) {
    return is_square(host) ? host.integer("blur_passes") % 2 : 0;
  }

  static heddle_status blur(const Frame& frame) {
    const PassHost host = frame.host();
    const heddle_shape noisy = host.shape("noisy");
    const std::int32_t radius = host.integer("blur_radius");
    const std::int32_t count = host.integer("blur_passes") * (is_square(host) ? 1 : 2);
    for (std::int32_t i = 0; i < count; ++i) {
      if (i > 0) frame.barrier();
      const bool is_column = i % 2 == 1;
      const BlurPush push{is_square(host) || !is_column ? radius : 0, is_square(host) || is_column ? radius : 0, i % 2,
                          0};
      const heddle_status status = frame.dispatch("blur", divided(noisy.width, 8), divided(noisy.height, 8), 1, push);
      if (status != HEDDLE_OK) return status;
    }
    return HEDDLE_OK;
  }

  std::vector<double> pattern_of_;  // parameters that the pattern was made from; empty: none yet
};

constexpr heddle_technique kSsao = technique<Ssao>(
    "ambient_occlusion/ssao", "Screen-space ambient occlusion by point samples",
    "Filion and McNaughton 2008, Effects & Techniques (StarCraft II)", kPorts, kParameters, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kSsao)
