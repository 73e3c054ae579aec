// SPDX-License-Identifier: Apache-2.0
// The role's functions, read from the images that the stages made. Directions are turned into the image's axes first.

vec3 to_environment(vec3 direction) {
  return vec3(dot(environment_from_scene[0].xyz, direction), dot(environment_from_scene[1].xyz, direction),
              dot(environment_from_scene[2].xyz, direction));
}

// Of a direction in the image's axes. The image is padded by one texel on each side.
vec3 background_radiance(vec3 d) {
  float across = length(d.xz);
  // atan alone: acos is off by 2e-4 on some drivers.
  float azimuth = across > 0.0 ? atan(d.x, -d.z) : 0.0;
  vec2 uv = vec2(azimuth * 0.159154943091895336 + 0.5, atan(across, d.y) * 0.318309886183790672);
  vec2 padded = vec2(size_background());
  return sample_background((uv * (padded - 2.0) + 1.0) / padded).rgb;
}

vec3 sky_radiance(vec3 direction) { return environment_scale * background_radiance(to_environment(direction)); }

vec3 sky_irradiance(vec3 normal) { return environment_scale * sample_irradiance(to_environment(normal)).rgb; }

vec3 sky_specular(vec3 direction, float alpha) {
  vec3 d = to_environment(direction);
  // Level 0 is the radiance itself, level i cube i - 1; even in roughness.
  float level = clamp(sqrt(max(alpha, 0.0)), 0.0, 1.0) * float(params.levels);
  float below = min(floor(level), float(params.levels) - 1.0), above = below + 1.0;
  vec3 sharp = below < 0.5 ? background_radiance(d) : sample_specular(vec4(d, below - 1.0)).rgb;
  vec3 soft = sample_specular(vec4(d, below)).rgb;
  // (7) Linear in 1 / alpha; in roughness where the sharper one has no alpha.
  float share = below < 0.5 ? level
                            : (level * level - below * below) * above * above /
                                  ((above * above - below * below) * level * level);
  return environment_scale * mix(sharp, soft, share);
}
