// SPDX-License-Identifier: Apache-2.0
// transparency/sorted: blended surfaces from the farthest to the nearest, each over what is there.
#include "light_loops.hpp"

#include <heddle/pass.hpp>

namespace {
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "blended batches are drawn, the others left out"),
    value_in("camera", "the view that made radiance and depth_buffer"),
    value_in("lights", "every light of the frame"),
    value_in("light_textures", "images on rectangle lights", HEDDLE_PORT_OPTIONAL),
    image_in("depth_buffer", "reversed depth of the surfaces that are in radiance already"),
    port("radiance", HEDDLE_PORT_IMAGE, HEDDLE_INOUT, "towards the camera [cd/m^2]; a: share that surfaces cover"),
};

constexpr const char* kOrders[] = {"unsorted", "instances", "triangles", nullptr};
constexpr std::uint32_t kDrawOrders[] = {HEDDLE_ORDER_STATE, HEDDLE_ORDER_BACK_TO_FRONT,
                                         HEDDLE_ORDER_TRIANGLES_BACK_TO_FRONT};
constexpr double kOrderLadder[] = {0, 1, 2};
constexpr heddle_parameter kParameters[] = {
    knob(choice("order", kOrders, 2, "what is sorted by depth: nothing, instances, or each one's triangles as well"),
         kOrderLadder),
};

constexpr heddle_access kDraw[] = {
    drawn("surfaces"),
    value("camera"),
    value("lights"),
    value("light_textures"),
    color_blended("radiance", HEDDLE_BLEND_TINT),
    depth_tested("depth_buffer"),
};
constexpr heddle_stage kStages[] = {gpu_stage("draw", kDraw)};
constexpr heddle_shader kShaders[] = {
    [] {
      heddle_shader s = surfaces_shader("blend", "draw", "blend.frag.glsl");
      s.calls = "light_assignment surface_material shadow sky texture_source";
      return s;
    }(),
};

struct Push {
  float largest;
};

struct Sorted {
  heddle_status record(const Frame& frame) {
    if (const heddle_status status = check_light_loops(frame, kLoopsToShade); status != HEDDLE_OK) return status;
    constexpr float kMaxHalf = 65504.0F, kMaxFloat = 3.40282347e38F;
    const bool is_half = frame.host().shape("radiance").format == VK_FORMAT_R16G16B16A16_SFLOAT;
    const Push push = {is_half ? kMaxHalf : kMaxFloat};
    heddle_draw drawing = Frame::drawing("blend");
    drawing.include = HEDDLE_SURFACE_BLENDED;
    drawing.order = kDrawOrders[frame.host().choice("order")];
    drawing.push = &push;
    drawing.push_bytes = sizeof push;
    return frame.draw(drawing);
  }
};

constexpr heddle_technique kSorted = [] {
  heddle_technique t =
      technique<Sorted>("transparency/sorted", "Blended surfaces from the farthest to the nearest",
                        "Porter and Duff 1984, Compositing Digital Images", kPorts, kParameters, kStages, kShaders);
  t.role_revision = 2;
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  t.features = "blended";
  t.device_features = "dualSrcBlend";
  t.fallback = "none: without it blended surfaces are not drawn; choose transparency.technique = \"none\"";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kSorted)
