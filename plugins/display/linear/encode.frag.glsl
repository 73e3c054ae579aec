// SPDX-License-Identifier: Apache-2.0
// Radiance -> what an sRGB screen shows: exposed, clipped, encoded.
// Source  ISO 12232:2019 (saturation-based speed): a luminance of 1.2 * 2^EV100 just saturates
// in      radiance  cd/m^2, linear Rec.709; anything, also NaN and Inf
// out     color     rgba8  sRGB
// params  exposure  EV100
#include "pass.glsl"
#include "srgb.glsl"

void main() {
  vec3 exposed = fetch_radiance(ivec2(gl_FragCoord.xy)).rgb / (1.2 * exp2(params.exposure));
  // Comparisons with NaN are false, so it becomes black; min and max would depend on the driver.
  vec3 positive = mix(vec3(0.0), exposed, greaterThan(exposed, vec3(0.0)));
  vec3 clipped = mix(vec3(1.0), positive, lessThan(positive, vec3(1.0)));
  color = vec4(srgb_from_linear(clipped), 1.0);
}
