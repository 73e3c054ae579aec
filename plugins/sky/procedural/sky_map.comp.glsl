// SPDX-License-Identifier: Apache-2.0
// Tables -> radiance from every direction, over the sun's illuminance; laid out as sky_mapping.glsl says.
// threads 8x8, one a texel; loop over `samples`
#include "pass.glsl"
#include "sky_mapping.glsl"
#include "tables.glsl"
#include "radiance.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = size_sky_map();
  if (texel.x >= size.x || texel.y >= size.y) return;
  float height = params.altitude * 1e-3;
  vec3 angles = sky_map_angles(texel, horizon_elevation(height), vec2(size));
  vec3 direction = sky_direction(angles.xy);
  vec3 sun = sky_direction(vec2(0.0, params.sun_elevation));
  vec3 ground_source = params.ground_albedo / kSkyPi * fetch_ground_irradiance(ivec2(0)).rgb;
  vec3 radiance = radiance_along_ray(height, direction.y, sun.y, clamp(dot(direction, sun), -1.0, 1.0), angles.z > 0.5,
                                     params.ground_albedo, ground_source, params.mie_density, params.samples);
  imageStore(sky_map, texel, vec4(max(radiance, vec3(0.0)), 1.0));
}
