// SPDX-License-Identifier: Apache-2.0
// lighting/forward: opaque and masked surfaces lit while they are drawn, each pixel once, over the sky.
#include "light_loops.hpp"

#include <heddle/pass.hpp>

namespace {
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what to draw; blended batches are left out"),
    value_in("camera", "where from"),
    value_in("lights", "every light of the frame"),
    value_in("light_textures", "images on rectangle lights", HEDDLE_PORT_OPTIONAL),
    image_in("visibility", "ambient occlusion: darkens the environment's light alone", HEDDLE_PORT_OPTIONAL),
    [] {
      heddle_port p = port("depth_buffer", HEDDLE_PORT_IMAGE, HEDDLE_INOUT,
                           "reversed depth of the same surfaces and view; unbound: drawn here", HEDDLE_PORT_OPTIONAL);
      p.format = VK_FORMAT_D32_SFLOAT;
      return p;
    }(),
    image_out("radiance", VK_FORMAT_R16G16B16A16_SFLOAT, "towards the camera [cd/m^2]; a: 1 where there is a surface"),
};

constexpr const char* kPrecisions[] = {"float16", "float32", nullptr};
constexpr double kPrecisionLadder[] = {0, 1};
constexpr heddle_parameter kParameters[] = {
    knob(choice("precision", kPrecisions, 0, "format of radiance; float16 ends at 65504 cd/m^2",
                HEDDLE_PARAMETER_REDECLARE),
         kPrecisionLadder),
};

constexpr heddle_access kDepth[] = {
    drawn("surfaces"),
    value("camera"),
    access("depth_buffer", HEDDLE_ACCESS_DEPTH, HEDDLE_LOAD_CLEAR_NEW),
};
constexpr heddle_access kShade[] = {
    drawn("surfaces"),
    value("camera"),
    value("lights"),
    value("light_textures"),
    sampled("visibility"),
    color_target("radiance"),
    depth_tested("depth_buffer"),
};
enum : std::uint32_t { kDepthStage, kShadeStage };
constexpr heddle_stage kStages[] = {gpu_stage("depth", kDepth), gpu_stage("shade", kShade)};

constexpr heddle_shader kShaders[] = {
    surfaces_shader("depth", "depth", ""),
    fullscreen_shader("background", "shade", "background.frag.glsl", "sky"),
    [] {
      heddle_shader s = surfaces_shader("surface", "shade", "surface.frag.glsl");
      s.calls = "light_assignment surface_material shadow sky texture_source";
      return s;
    }(),
};

struct Forward {
  heddle_status declare(const PassHost& host) {
    if (host.choice("precision") == 0) return HEDDLE_OK;
    return host.set_format("radiance", VK_FORMAT_R32G32B32A32_SFLOAT);
  }

  heddle_status record(const Frame& frame) {
    heddle_draw drawing = Frame::drawing(frame.stage() == kDepthStage ? "depth" : "surface");
    drawing.include = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_MASKED;
    if (frame.stage() == kShadeStage) {
      // Drawn infinitely far, it stays where no surface has left a depth; every other pixel gets exactly one surface.
      if (const heddle_status status = check_light_loops(frame, kLoopsToShade); status != HEDDLE_OK) return status;
      const heddle_status status = frame.fullscreen("background");
      return status == HEDDLE_OK ? frame.draw(drawing) : status;
    }
    if (frame.host().is_bound("depth_buffer")) return HEDDLE_OK;
    drawing.cull = HEDDLE_CULL_MATERIAL;  // as the surfaces themselves
    return frame.draw(drawing);
  }
};

constexpr heddle_technique kForward = [] {
  heddle_technique t =
      technique<Forward>("lighting/forward", "Every light at every surface while it is drawn",
                         "Karis 2013, Real Shading in Unreal Engine 4", kPorts, kParameters, kStages, kShaders);
  t.role_revision = 3;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kForward)
