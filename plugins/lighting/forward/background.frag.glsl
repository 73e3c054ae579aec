// SPDX-License-Identifier: Apache-2.0
// Where no surface is: the sky.
// in      camera
// out     radiance  rgb cd/m^2, a 0
// params  precision  0 float16, 1 float32
#include "pass.glsl"
#include "role/sky.glsl"
#include "constants.glsl"
#include "view.glsl"

void main() {
  vec3 background = sky_radiance(view_ray(camera, gl_FragCoord.xy));
  radiance = vec4(clamp(background, 0.0, params.precision_ == 0u ? kMaxHalf : kMaxFloat), 0.0);
}
