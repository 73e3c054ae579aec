// SPDX-License-Identifier: Apache-2.0
// Radiance -> a grey of the same luminance, exposed, clipped and encoded.
// Source  ITU-R BT.709-6 (2015): weights of luminance
// in      radiance   linear Rec.709
// out     color      rgba8, sRGB
// params  white      luminance that shows as white
//         encoding   0 linear, 1 sRGB
// threads 8x8, one an output pixel
#include "pass.glsl"
#include "srgb.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, size_color()))) return;
  float luminance = dot(fetch_radiance(pixel).rgb, vec3(0.2126, 0.7152, 0.0722)) / params.white;
  // Comparisons with NaN are false: it becomes black.
  vec3 grey = vec3(luminance > 0.0 ? (luminance < 1.0 ? luminance : 1.0) : 0.0);
  imageStore(color, pixel, vec4(params.encoding == 1u ? srgb_from_linear(grey) : grey, 1.0));
}
