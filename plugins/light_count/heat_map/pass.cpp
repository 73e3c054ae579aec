// SPDX-License-Identifier: Apache-2.0
// light_count/heat_map: asks light_assignment at every pixel, as lighting does, and counts.
#include "light_loops.hpp"

#include <heddle/pass.hpp>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("depth", "gbuffer's"),
    value_in("camera", "the view that made depth"),
    value_in("lights", "every light of the frame"),
    image_out("count", VK_FORMAT_R32G32_SFLOAT, "r: lights met; g: lights that reach the pixel"),
    image_out("color", VK_FORMAT_R8G8B8A8_UNORM, "r of count as a heat map"),
};
constexpr heddle_access kAccesses[] = {sampled("depth"), value("camera"), value("lights"), storage_write("count"),
                                       storage_write("color")};
constexpr heddle_stage kStages[] = {gpu_stage("count", kAccesses)};
constexpr heddle_shader kShaders[] = {compute_shader("count", "count", "count.comp.glsl", "light_assignment")};

struct HeatMap {
  heddle_status record(const Frame& frame) {
    const heddle_status status = check_light_loops(frame, kLoopsToMeet);
    return status == HEDDLE_OK ? frame.dispatch_over("count", "count") : status;
  }
};

constexpr heddle_technique kHeatMap = technique<HeatMap>(
    "light_count/heat_map", "Lights met at each pixel, counted and coloured",
    "Oertegren and Persson 2016, Clustered Shading, GPU Pro 7 (bins in a ratio)", kPorts, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kHeatMap)
