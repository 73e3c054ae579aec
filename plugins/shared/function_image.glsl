// SPDX-License-Identifier: Apache-2.0
// main() of role function_image: the pixel's point -> answer() -> image. Included after pass.glsl by a shader that defines
//   vec4 answer(vec3 position_rel, vec3 normal)  at a surface: relative to the view's origin; geometric, unit, world axes
//   vec4 answer_background(vec3 direction)       where there is none: unit, world axes, from the camera
// and whose stage has the ports depth, normal_geometric, camera and image.
#ifndef HEDDLE_SHARED_FUNCTION_IMAGE_GLSL
#define HEDDLE_SHARED_FUNCTION_IMAGE_GLSL
#include "octahedral.glsl"
#include "view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_image()))) return;
  float depth_here = fetch_depth(pixel).r;
  vec4 value;
  if (is_background(depth_here)) {
    value = answer_background(view_ray(camera, pixel_center(pixel)));
  } else {
    value = answer(position_rel_from_depth(camera, pixel_center(pixel), depth_here),
                   decode_octahedral(fetch_normal_geometric(pixel).xy));
  }
  imageStore(image, pixel, value);
}

#endif
