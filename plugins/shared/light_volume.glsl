// SPDX-License-Identifier: Apache-2.0
// The space that a HeddleLight lights as a convex body, and whether that body misses a cell of a view's frustum. Never
// says "misses" of a light that light.glsl lets reach a point of the cell; README of this folder, "Where lights reach".
// Source  Chung and Wang 1996, "Quick collision detection of polytopes in virtual environments", VRST (a separating
//         axis by reflections); support functions: Ericson 2005, "Real-Time Collision Detection", section 9.5
// Axes of a cell: x right, y up, z the distance along the view axis, so that a light in front of the camera has z > 0.
#ifndef HEDDLE_SHARED_LIGHT_VOLUME_GLSL
#define HEDDLE_SHARED_LIGHT_VOLUME_GLSL
#include "constants.glsl"

const uint kLightReachesNothing = 0u;
const uint kLightReachesAll = 1u;
const uint kLightReachesRound = 2u;  // a ball, or a cone with a spherical cap, swept along a segment
const uint kLightReachesBox = 3u;

// In place of no range, metres: its square is finite, and a float32 position so far away has steps of 64,000 km.
const float kLightUnlimited = 1e15;
// Rounding of some ten float32 operations on each side, relative to the lengths that went in: 60 steps of 2^-24.
const float kLightVolumeSlack = 4e-6;
// The same of cosines: light.glsl rounds one by less than 5 steps of 2^-24.
const float kLightCosineSlack = 1e-6;
// Axes of a box that are farther than this from unit and right angles bound nothing.
const float kLightAxesTolerance = 1e-4;

struct LightVolume {
  uint kind;           // kLightReaches*
  vec3 apex;           // middle of the segment on which the apex of the cone lies; middle of ball and box
  vec3 axis;           // unit, of the cone
  vec3 half_segment;
  float range;         // kLightUnlimited: no end
  float cos_outer;     // of the cone's half angle, 0..1; -1: a ball
  float sin_outer;
  mat3 half_axes;      // of the box, columns
  float slack;         // metres of rounding, for a cell of reach 1
};

// Between four planes through the eye (orthographic: parallel to the axis) and two across the axis.
struct FrustumCell {
  vec4 bounds;         // x from, x to, y from, y to: at distance 1 along the axis; orthographic: metres
  float near_distance, far_distance;
  bool is_orthographic;
};

bool light_is_dark(HeddleLight light) {
  return light.type == HEDDLE_LIGHT_ENVIRONMENT || all(equal(light.intensity, vec3(0.0)));
}

bool light_has_orthonormal_axes(HeddleLight light) {
  vec3 t = light.tangent, d = light.direction;
  vec3 off = abs(vec3(dot(t, t) - 1.0, dot(d, d) - 1.0, dot(t, d)));
  return all(lessThanEqual(off, vec3(kLightAxesTolerance)));
}

// Length that half of the segment may have: nobody says that `tangent` is unit.
float light_half_segment(HeddleLight light) {
  bool has_segment = light.type == HEDDLE_LIGHT_CAPSULE || light.type == HEDDLE_LIGHT_WEDGE;
  return has_segment ? 0.5 * abs(light.segment_length) * length(light.tangent) : 0.0;
}

// False only where the light reaches nothing at the point, by the ball around its centre. Cheap.
bool light_is_near(HeddleLight light, vec3 position_rel) {
  if (light_is_dark(light)) return false;
  bool is_box = light.type == HEDDLE_LIGHT_BOX;
  if (light.type == HEDDLE_LIGHT_DIRECTIONAL || (light.range <= 0.0 && !is_box)) return true;
  float reach = light.range > 0.0 ? light.range + light_half_segment(light) : kLightUnlimited;
  if (is_box && light_has_orthonormal_axes(light)) reach = min(reach, length(light.half_extent) * 1.001);
  vec3 away = position_rel - light.position_rel;
  // 1e-5: rounding of both squares. NaN is near.
  return !(dot(away, away) > reach * reach * (1.0 + 1e-5));
}

vec3 cell_axes(HeddleView view, vec3 direction) {
  vec3 v = mat3(view.view_from_rel) * direction;
  return vec3(v.x, v.y, -v.z);
}

LightVolume light_volume(HeddleLight light, HeddleView view) {
  vec3 apex = vec3(view.view_from_rel * vec4(light.position_rel, 1.0));
  LightVolume volume;
  volume.kind = kLightReachesRound;
  volume.apex = vec3(apex.x, apex.y, -apex.z);
  volume.axis = vec3(0.0, 0.0, 1.0);
  volume.half_segment = vec3(0.0);
  volume.range = light.range > 0.0 ? light.range : kLightUnlimited;
  volume.cos_outer = -1.0;
  volume.half_axes = mat3(0.0);
  bool has_cone = light.type == HEDDLE_LIGHT_SPOT || light.type == HEDDLE_LIGHT_CONE ||
                  light.type == HEDDLE_LIGHT_WEDGE || light.type == HEDDLE_LIGHT_RECTANGLE;
  if (has_cone) {
    // The cosine that light.glsl compares grows with the length of `direction`. A rectangle shines to one side.
    float size = length(light.direction);
    float cosine = light.type == HEDDLE_LIGHT_RECTANGLE ? 0.0 : light.cos_outer / max(size, 1e-20);
    if (size > 1e-6 && cosine >= 0.0) {
      volume.axis = cell_axes(view, light.direction / size);
      volume.cos_outer = clamp(cosine - kLightCosineSlack / min(size, 1.0), 0.0, 1.0);
    }
  }
  volume.sin_outer = sqrt(max(1.0 - volume.cos_outer * volume.cos_outer, 0.0));
  if (light.type == HEDDLE_LIGHT_CAPSULE || light.type == HEDDLE_LIGHT_WEDGE)
    volume.half_segment = cell_axes(view, light.tangent) * (0.5 * abs(light.segment_length));
  if (light.type == HEDDLE_LIGHT_BOX && light_has_orthonormal_axes(light)) {
    volume.kind = kLightReachesBox;
    vec3 h = abs(light.half_extent) * 1.001;
    vec3 across = cross(light.direction, light.tangent);
    volume.half_axes = mat3(cell_axes(view, light.tangent) * h.x, cell_axes(view, across) * h.y,
                            cell_axes(view, light.direction) * h.z);
  }
  bool is_ball = volume.kind == kLightReachesRound && volume.cos_outer < 0.0;
  if (light.type == HEDDLE_LIGHT_DIRECTIONAL || (is_ball && volume.range >= kLightUnlimited))
    volume.kind = kLightReachesAll;
  if (light_is_dark(light)) volume.kind = kLightReachesNothing;
  float lengths = length(light.position_rel) + length(vec3(view.rel_from_view[3])) + length(volume.apex) +
                  length(volume.half_segment) + length(light.half_extent);
  if (volume.range < kLightUnlimited) lengths += volume.range;
  volume.slack = kLightVolumeSlack * lengths;
  return volume;
}

// The body's farthest point along unit n, from the apex, and how far that is: xyz, w. w is never too small.
vec4 light_support(LightVolume volume, vec3 n) {
  float along_segment = dot(n, volume.half_segment);
  vec4 support = vec4(along_segment < 0.0 ? -volume.half_segment : volume.half_segment, abs(along_segment));
  if (volume.kind == kLightReachesBox) {
    vec3 along = n * volume.half_axes;
    float extent = abs(along.x) + abs(along.y) + abs(along.z);
    if (extent > volume.range) return support + vec4(n, 1.0) * volume.range;
    vec3 corner = volume.half_axes * vec3(along.x < 0.0 ? -1.0 : 1.0, along.y < 0.0 ? -1.0 : 1.0,
                                          along.z < 0.0 ? -1.0 : 1.0);
    return support + vec4(corner, extent);
  }
  float cosine = dot(n, volume.axis);
  if (cosine >= volume.cos_outer) return support + vec4(n, 1.0) * volume.range;  // on the cap
  // On the rim, or the apex itself where the whole cone looks away.
  // Not sqrt(1 - cosine^2): near -1 that is off by 3e-4.
  vec3 across = n - cosine * volume.axis;
  float sine = length(across);
  float extent = cosine * volume.cos_outer + sine * volume.sin_outer + 2.0 * kLightCosineSlack;
  if (extent <= 0.0) return support;
  vec3 rim = volume.axis * volume.cos_outer + across * (volume.sin_outer / max(sine, 1e-20));
  return support + vec4(rim, extent) * volume.range;
}

// True if the body lies wholly on one side of the plane through the eye (orthographic: along the axis) at `bound` of x
// or y, `side` 1: below it, -1: above it.
bool light_is_beyond(LightVolume volume, bool is_orthographic, bool is_y, float bound, float side) {
  float tilt = is_orthographic ? 0.0 : bound;
  vec3 n = (is_y ? vec3(0.0, 1.0, -tilt) : vec3(1.0, 0.0, -tilt)) * (side * inversesqrt(1.0 + tilt * tilt));
  float distance = is_orthographic ? bound * side : 0.0;
  return dot(n, volume.apex) + light_support(volume, n).w - distance < -volume.slack * (1.0 + abs(bound));
}

// Least and greatest distance along the axis at which there is light.
vec2 light_depths(LightVolume volume) {
  float least = volume.apex.z - light_support(volume, vec3(0.0, 0.0, -1.0)).w;
  float greatest = volume.apex.z + light_support(volume, vec3(0.0, 0.0, 1.0)).w;
  return vec2(least - volume.slack, greatest + volume.slack);
}

// The cell's farthest point against n.
vec3 cell_support(FrustumCell cell, vec3 n) {
  float x = n.x < 0.0 ? cell.bounds.y : cell.bounds.x;
  float y = n.y < 0.0 ? cell.bounds.w : cell.bounds.z;
  float along = cell.is_orthographic ? n.z : dot(n, vec3(x, y, 1.0));
  float z = along < 0.0 ? cell.far_distance : cell.near_distance;
  return cell.is_orthographic ? vec3(x, y, z) : vec3(x, y, 1.0) * z;
}

// Unit direction in which something near `point` is best told apart from the body: the normal of the cone's side or of
// the box's face that looks there.
vec3 light_first_axis(LightVolume volume, vec3 point) {
  vec3 away = point - volume.apex;
  float segment = dot(volume.half_segment, volume.half_segment);
  if (segment > 0.0) away -= volume.half_segment * clamp(dot(away, volume.half_segment) / segment, -1.0, 1.0);
  vec3 n = away;
  if (volume.kind == kLightReachesBox) {
    vec3 sizes = vec3(length(volume.half_axes[0]), length(volume.half_axes[1]), length(volume.half_axes[2]));
    sizes = max(sizes, vec3(1e-20));
    vec3 along = (away * volume.half_axes) / sizes;
    vec3 beyond = abs(along) - sizes;
    int face = beyond.x >= max(beyond.y, beyond.z) ? 0 : beyond.y >= beyond.z ? 1 : 2;
    n = volume.half_axes[face] * (along[face] < 0.0 ? -1.0 : 1.0);
  } else if (volume.cos_outer >= 0.0) {
    vec3 across = away - volume.axis * dot(away, volume.axis);
    vec3 side = across * (volume.cos_outer / max(length(across), 1e-20)) - volume.axis * volume.sin_outer;
    if (dot(side, away) > 0.0) n = side;
  }
  float size = length(n);
  return size > 0.0 ? n / size : vec3(0.0, 0.0, 1.0);
}

// True if a plane between body and cell is found in `steps` steps. More steps find more of them; what none of them
// finds counts as touched.
bool light_misses_cell(LightVolume volume, FrustumCell cell, uint steps) {
  vec4 bounds = cell.bounds;
  float slack = volume.slack * (1.0 + length(max(abs(vec2(bounds.x, bounds.z)), abs(vec2(bounds.y, bounds.w)))));
  float z = clamp(volume.apex.z, cell.near_distance, cell.far_distance);
  vec3 middle = vec3(0.5 * (bounds.x + bounds.y), 0.5 * (bounds.z + bounds.w), 1.0) * (cell.is_orthographic ? 1.0 : z);
  middle.z = z;
  vec3 n = light_first_axis(volume, middle);
  for (uint i = 0u; i < steps; ++i) {
    vec4 support = light_support(volume, n);
    vec3 between = cell_support(cell, n) - volume.apex;
    if (dot(n, between) - support.w > slack) return true;
    vec3 r = between - vec3(support);
    float size = length(r);
    if (!(size > 0.0)) return false;  // they share this point
    r /= size;
    n = normalize(n - 2.0 * dot(n, r) * r);
  }
  return false;
}

#endif
