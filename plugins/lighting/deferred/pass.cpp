// SPDX-License-Identifier: Apache-2.0
// lighting/deferred: one shader over the gbuffer that asks the graph's material, shadow and sky functions.
#include "light_loops.hpp"

#include <heddle/pass.hpp>

namespace {
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("depth", "gbuffer's"),
    image_in("normal", "gbuffer's"),
    image_in("normal_geometric", "gbuffer's"),
    image_in("base_color", "gbuffer's"),
    image_in("material", "gbuffer's"),
    image_in("emissive", "gbuffer's", HEDDLE_PORT_OPTIONAL),
    image_in("visibility", "ambient occlusion: darkens the environment's light alone", HEDDLE_PORT_OPTIONAL),
    value_in("camera", "the view that made depth"),
    value_in("lights", "every light of the frame"),
    value_in("light_textures", "images on rectangle lights", HEDDLE_PORT_OPTIONAL),
    image_out("radiance", VK_FORMAT_R16G16B16A16_SFLOAT, "towards the camera [cd/m^2]; a: 1 where there is a surface"),
};

constexpr const char* kPrecisions[] = {"float16", "float32", nullptr};
constexpr double kPrecisionLadder[] = {0, 1};
constexpr heddle_parameter kParameters[] = {
    knob(choice("precision", kPrecisions, 0, "format of radiance; float16 ends at 65504 cd/m^2",
                HEDDLE_PARAMETER_REDECLARE),
         kPrecisionLadder),
};

constexpr heddle_access kShade[] = {
    sampled("depth"),    sampled("normal"),       sampled("normal_geometric"), sampled("base_color"),
    sampled("material"), sampled("emissive"),     sampled("visibility"),       value("camera"),
    value("lights"),     value("light_textures"), color_target("radiance"),
};
constexpr heddle_stage kStages[] = {gpu_stage("shade", kShade)};
constexpr heddle_shader kShaders[] = {
    fullscreen_shader("shade", "shade", "shade.frag.glsl", "light_assignment surface_material shadow sky"),
};

struct Deferred {
  heddle_status declare(const PassHost& host) {
    if (host.choice("precision") == 0) return HEDDLE_OK;
    return host.set_format("radiance", VK_FORMAT_R32G32B32A32_SFLOAT);
  }
  heddle_status record(const Frame& frame) {
    const heddle_status status = check_light_loops(frame, kLoopsToShade);
    return status == HEDDLE_OK ? frame.fullscreen("shade") : status;
  }
};

constexpr heddle_technique kDeferred = [] {
  heddle_technique t =
      technique<Deferred>("lighting/deferred", "Every light at every pixel, one after the other",
                          "Karis 2013, Real Shading in Unreal Engine 4", kPorts, kParameters, kStages, kShaders);
  t.role_revision = 3;
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kDeferred)
