// SPDX-License-Identifier: Apache-2.0
// What every technique of role function_image is: the image's format, and one compute shader that asks at each pixel.
#ifndef HEDDLE_SHARED_FUNCTION_IMAGE_HPP
#define HEDDLE_SHARED_FUNCTION_IMAGE_HPP

#include <heddle/pass.hpp>

namespace function_image {

/// Of a technique whose shader is "image" of stage "image".
struct Pass {
  heddle_status record(const heddle::pass::Frame& frame) { return frame.dispatch_over("image", "image"); }
};

}  // namespace function_image

#endif
