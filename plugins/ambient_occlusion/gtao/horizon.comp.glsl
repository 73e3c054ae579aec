// SPDX-License-Identifier: Apache-2.0
// Depth -> visibility with the noise of a 4x4 tile: the horizon of every slice, and what it leaves open.
// Source  Jimenez, Wu, Pesce and Jarabo 2016, "Practical Realtime Strategies for Accurate Indirect Occlusion", with the
//         changes that README.md lists; its equations (1) to (7)
// in      depth             r32f  distance along the view axis, metres; +inf where there is no surface
//         normal_geometric  octahedral, world axes
// out     noisy             r16   1 = open, 0 = closed; 1 where there is no surface
// params  radius [m], falloff, directions [1], steps [1]
// loops   directions x 2 x steps <= 64 x 2 x 256 = 32768 rounds of an invocation
#include "pass.glsl"
#include "octahedral.glsl"
#include "view.glsl"
#include "facing.glsl"
#include "gtao.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

const float kGoldenRatio = 0.61803398875;  // fraction of the golden ratio: spreads any number of shifts evenly

// How far along t, which is normal to the line of sight, a point must go to project as far as anything within the
// radius does: to the tangent from the eye to that circle. At most five radii, and never past the eye.
float reach_along(vec3 t, vec3 position, float radius) {
  if (camera.is_orthographic != 0u) return radius;
  float reach = radius * inversesqrt(max(0.04, 1.0 - radius * radius / dot(position, position)));
  return t.z > 0.0 ? min(reach, 0.95 * -position.z / t.z) : reach;
}

// The part of a line from a point inside the image that stays inside.
vec2 clip_to_image(vec2 start, vec2 delta, vec2 size) {
  vec2 border = mix(vec2(0.0), size, greaterThan(delta, vec2(0.0)));
  vec2 t = mix((border - start) / delta, vec2(1.0), equal(delta, vec2(0.0)));
  return delta * min(1.0, min(t.x, t.y));
}

// Weighted, occluded arc of one side.
float march(vec2 center, vec3 position, vec3 n, vec3 v, vec3 t, float n_v, float offset, ivec2 size) {
  float n_t = dot(n, t);
  vec2 end = raster_from_view(camera, position + t * reach_along(t, position, params.radius));
  vec2 delta = clip_to_image(center, end - center, vec2(size));
  float length_px = length(delta);
  vec2 direction = delta / max(length_px, 1.0);
  int steps = length_px > 1.0 ? params.steps : 0;

  vec2 horizon = vec2(0.0, 1.0);
  float below = 0.0;     // arc below the horizon
  float occluded = 0.0;  // the same, weighted sector by sector
  for (int i = 0; i < steps; ++i) {
    ivec2 pixel = clamp(ivec2(center + direction * step_distance(i, steps, offset, length_px)), ivec2(0), size - 1);
    float depth = fetch_depth(pixel).x;
    if (is_background(depth)) continue;
    vec3 to_sample = position_view_from_depth(camera, pixel_center(pixel), depth) - position;
    float weight = occlusion_weight(constant_falloff, dot(to_sample, to_sample), params.radius);
    vec2 elevation = sample_elevation(to_sample, n, v);
    if (weight <= 0.0 || elevation.x <= 0.0 || elevation.y >= horizon.y) continue;
    horizon = elevation;
    if (constant_falloff != 0u) {
      float arc = occluded_arc(n_v, n_t, clamp_to_view(horizon, n_v, n_t));
      occluded += weight * max(0.0, arc - below);
      below = arc;
    }
  }
  return constant_falloff != 0u ? occluded : occluded_arc(n_v, n_t, clamp_to_view(horizon, n_v, n_t));
}

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = size_noisy();
  if (any(greaterThanEqual(pixel, size))) return;
  float depth = fetch_depth(pixel).x;
  if (is_background(depth)) {
    imageStore(noisy, pixel, vec4(1.0));
    return;
  }
  vec2 center = pixel_center(pixel);
  vec3 position = position_view_from_depth(camera, center, depth);
  vec3 v = camera.is_orthographic != 0u ? vec3(0.0, 0.0, 1.0) : normalize(-position);
  vec3 n = face_viewer(mat3(camera.view_from_rel) * decode_octahedral(fetch_normal_geometric(pixel).xy), v);
  float n_v = dot(n, v);
  // Slices are spread evenly around the line of sight, not around the image's axis.
  vec3 tangent = normalize(vec3(v.z, 0.0, -v.x));
  vec3 bitangent = cross(v, tangent);
  vec2 noise = tile_noise(pixel);

  float open = 0.0;
  float occluded = 0.0;
  for (int i = 0; i < params.directions; ++i) {
    float phi = kPi * (float(i) + noise.x) / float(params.directions);
    vec3 t = cos(phi) * tangent + sin(phi) * bitangent;
    float offset = fract(noise.y + kGoldenRatio * float(2 * i));
    open += open_arcs(n_v, dot(n, t));
    for (int side = 0; side < 2; ++side) {
      occluded += march(center, position, n, v, side == 0 ? t : -t, n_v, fract(offset + kGoldenRatio * float(side)), size);
    }
  }
  // Equation (6): a ratio, so that an open slice is exactly open whatever its direction.
  imageStore(noisy, pixel, vec4(clamp(1.0 - occluded / open, 0.0, 1.0)));
}
