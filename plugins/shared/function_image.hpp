// SPDX-License-Identifier: Apache-2.0
// What every technique of role function_image is: the image's format, and one compute shader that asks at each pixel.
#ifndef HEDDLE_SHARED_FUNCTION_IMAGE_HPP
#define HEDDLE_SHARED_FUNCTION_IMAGE_HPP

#include <cstddef>
#include <iterator>

#include <heddle/pass.hpp>

namespace function_image {

constexpr heddle_port kDepth = heddle::pass::image_in("depth", "gbuffer's");
constexpr heddle_port kNormalGeometric = heddle::pass::image_in("normal_geometric", "gbuffer's");
constexpr heddle_port kCamera = heddle::pass::value_in("camera", "the view that made depth");
constexpr heddle_port kLights = heddle::pass::value_in("lights", "every light of the frame");

constexpr heddle_port image(VkFormat format, const char* help) {
  return heddle::pass::image_out("image", format, help);
}

/// How the shader reaches each port: images that it reads are sampled, the one that it makes is stored to.
template <std::size_t kCount>
struct Accesses {
  heddle_access all[kCount];

  constexpr explicit Accesses(const heddle_port (&ports)[kCount]) : all{} {
    for (std::size_t i = 0; i < kCount; ++i) {
      const heddle_port& port = ports[i];
      all[i] = port.type == HEDDLE_PORT_VALUE ? heddle::pass::value(port.name)
               : port.direction == HEDDLE_IN  ? heddle::pass::sampled(port.name)
                                              : heddle::pass::storage_write(port.name);
    }
  }
};

/// kPorts: kDepth, kNormalGeometric, kCamera, what else image.comp.glsl reads, and image(); kRole: whose functions it
/// asks.
template <const auto& kPorts, const auto& kRole>
struct Asked {
  static constexpr Accesses<std::size(kPorts)> kAccesses{kPorts};
  static constexpr heddle_stage kStages[] = {heddle::pass::gpu_stage("image", kAccesses.all)};
  static constexpr heddle_shader kShaders[] = {
      heddle::pass::compute_shader("image", "image", "image.comp.glsl", kRole)};

  heddle_status record(const heddle::pass::Frame& frame) { return frame.dispatch_over("image", "image"); }

  static constexpr heddle_technique technique(const char* id, const char* title) {
    return heddle::pass::technique<Asked>(id, title, "definition; README equation (1)", kPorts, kStages, kShaders);
  }
};

}  // namespace function_image

#endif
