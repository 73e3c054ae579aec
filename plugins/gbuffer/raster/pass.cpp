// SPDX-License-Identifier: Apache-2.0
// gbuffer/raster: opaque and masked surfaces drawn once into seven images.
#include <heddle/pass.hpp>

namespace {
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what to draw; blended batches are left out: role transparency draws them"),
    value_in("camera", "where from"),
    image_out("depth", VK_FORMAT_R32_SFLOAT, "distance along the view axis [m]; +inf where there is no surface"),
    image_out("normal", VK_FORMAT_R16G16_SNORM, "shading normal, octahedral, world axes"),
    image_out("normal_geometric", VK_FORMAT_R16G16_SNORM, "the same without normal map"),
    image_out("base_color", VK_FORMAT_R8G8B8A8_SRGB, "linear when sampled; a: 1 lit, 0 unlit"),
    image_out("material", VK_FORMAT_R8G8B8A8_UNORM, "metalness, perceptual roughness, occlusion, (ior - 1) / 2"),
    image_out("emissive", VK_FORMAT_R16G16B16A16_SFLOAT, "emitted radiance [cd/m^2]"),
    image_out("motion", VK_FORMAT_R16G16_SFLOAT, "previous minus current position [px]"),
    image_out("depth_buffer", VK_FORMAT_D32_SFLOAT, "reversed depth of the raster test; 0 is infinitely far"),
};

// What the knob buys: the formats above, or float32 throughout.
struct Precise {
  const char* port;
  VkFormat format;
};
constexpr Precise kFloat32[] = {
    {"normal", VK_FORMAT_R32G32_SFLOAT},           {"normal_geometric", VK_FORMAT_R32G32_SFLOAT},
    {"base_color", VK_FORMAT_R32G32B32A32_SFLOAT}, {"material", VK_FORMAT_R32G32B32A32_SFLOAT},
    {"emissive", VK_FORMAT_R32G32B32A32_SFLOAT},   {"motion", VK_FORMAT_R32G32_SFLOAT},
};

constexpr const char* kPrecisions[] = {"packed", "float32", nullptr};
constexpr double kPrecisionLadder[] = {0, 1};
constexpr heddle_parameter kParameters[] = {
    knob(choice("precision", kPrecisions, 0, "formats of the images: 36 bytes a pixel, or 84",
                HEDDLE_PARAMETER_REDECLARE),
         kPrecisionLadder),
};

constexpr float kInfinity = __builtin_huge_valf();
constexpr heddle_access kDraw[] = {
    drawn("surfaces"),
    value("camera"),
    color_cleared("depth", {kInfinity, 0, 0, 1}),
    color_cleared("normal", {0, 0, 0, 1}),
    color_cleared("normal_geometric", {0, 0, 0, 1}),
    color_cleared("base_color", {0, 0, 0, 1}),
    color_cleared("material", {0, 1, 1, 0}),
    color_cleared("emissive", {0, 0, 0, 0}),
    color_cleared("motion", {0, 0, 0, 0}),
    depth_cleared("depth_buffer"),
};
constexpr heddle_stage kStages[] = {gpu_stage("draw", kDraw)};
constexpr heddle_shader kShaders[] = {[] {
  heddle_shader s = surfaces_shader("raster", "draw", "raster.frag.glsl");
  s.calls = "texture_source";
  return s;
}()};

struct Raster {
  heddle_status declare(const PassHost& host) {
    if (host.choice("precision") == 0) return HEDDLE_OK;
    for (const Precise& output : kFloat32)
      if (const heddle_status status = host.set_format(output.port, output.format); status != HEDDLE_OK) return status;
    return HEDDLE_OK;
  }
  heddle_status record(const Frame& frame) {
    heddle_draw drawing = Frame::drawing("raster");
    drawing.include = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_MASKED;
    return frame.draw(drawing);
  }
};

constexpr heddle_technique kRaster = [] {
  heddle_technique t = technique<Raster>("gbuffer/raster", "Surfaces drawn into images of their data",
                                         "Saito and Takahashi 1990, Comprehensible Rendering of 3-D Shapes", kPorts,
                                         kParameters, kStages, kShaders);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kRaster)
