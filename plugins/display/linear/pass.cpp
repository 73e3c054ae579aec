// SPDX-License-Identifier: Apache-2.0
// display/linear: exposure, clipping and the sRGB curve; the reference of tone mappers.
#include <heddle/pass.hpp>

namespace {
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("radiance", "linear Rec.709 [cd/m^2]"),
    image_out("color", VK_FORMAT_R8G8B8A8_UNORM, "encoded for an sRGB display"),
};
constexpr heddle_parameter kParameters[] = {
    parameter("exposure", "EV100", -16, 24, 15, "a radiance of 1.2 * 2^exposure cd/m^2 shows as white"),
};
constexpr heddle_access kEncode[] = {sampled("radiance"), color_target("color")};
constexpr heddle_stage kStages[] = {gpu_stage("encode", kEncode)};
constexpr heddle_shader kShaders[] = {fullscreen_shader("encode", "encode", "encode.frag.glsl")};

struct Linear {
  heddle_status record(const Frame& frame) { return frame.fullscreen("encode"); }
};

constexpr heddle_technique kLinear = [] {
  heddle_technique t = technique<Linear>("display/linear", "Exposure, clipping, sRGB",
                                         "ISO 12232:2019; IEC 61966-2-1:1999", kPorts, kParameters, kStages, kShaders);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kLinear)
