// SPDX-License-Identifier: Apache-2.0
// Radiance -> what a display shows: exposed, then through the transform that OpenColorIO wrote.
// Source  OpenColorIO 2.1, GPU path; ISO 12232:2019 (saturation-based speed) for the exposure
// in      radiance  cd/m^2, linear Rec.709; anything, also NaN and Inf
//         lookups   tables of the transform
// out     color     encoded for the display
// params  exposure  EV100
#include "pass.glsl"
#include "lookup.glsl"
#include "generated/transform.glsl"

const float kLargest = 65504.0;  // transforms answer 0 or NaN to Inf; no display tells this from more

void main() {
  vec3 exposed = fetch_radiance(ivec2(gl_FragCoord.xy)).rgb / (1.2 * exp2(params.exposure));
  // Comparisons with NaN are false, so it becomes black; min and max would depend on the driver.
  vec3 positive = mix(vec3(0.0), exposed, greaterThan(exposed, vec3(0.0)));
  vec3 shown = ocio_transform(vec4(mix(vec3(kLargest), positive, lessThan(positive, vec3(kLargest))), 1.0)).rgb;
  vec3 above = mix(vec3(0.0), shown, greaterThan(shown, vec3(0.0)));
  color = vec4(mix(vec3(1.0), above, lessThan(above, vec3(1.0))), 1.0);
}
