// SPDX-License-Identifier: Apache-2.0
// The role's functions, read from the images that the stages made; all are over the sun's illuminance.
#include "sky_mapping.glsl"

vec3 sky_radiance(vec3 direction) {
  float horizon = horizon_elevation(params.altitude * 1e-3);
  vec2 uv = sky_map_coordinate(sky_angles(direction, params.sun_azimuth), horizon, vec2(size_sky_map()));
  return params.sun_illuminance * sample_sky_map(uv).rgb;
}

vec3 sky_irradiance(vec3 normal) {
  vec2 uv = filtered_coordinate(sky_angles(normal, params.sun_azimuth), false, vec2(size_irradiance()));
  return params.sun_illuminance * sample_irradiance(uv).rgb;
}

vec3 sky_specular(vec3 direction, float alpha) {
  vec2 uv = filtered_coordinate(sky_angles(direction, params.sun_azimuth), true, vec2(size_specular().xy));
  float level = specular_level(alpha);
  float below = floor(level);
  // Level 0 is the radiance itself, level i layer i - 1.
  vec3 sharp = below < 0.5 ? sky_radiance(direction)
                           : params.sun_illuminance * sample_specular(vec3(uv, below - 1.0)).rgb;
  vec3 soft = params.sun_illuminance * sample_specular(vec3(uv, min(below, kSpecularLayers - 1.0))).rgb;
  return mix(sharp, soft, level - below);
}
