// SPDX-License-Identifier: Apache-2.0
// Where the specular lobe of a point meets a light that has a size, and how much the light widens the lobe.
// Source  Karis 2013, "Real Shading in Unreal Engine 4", "Area Lights" (representative point, normalization);
//         Williams 1983, "Pyramidal Parametrics" (prefiltered texture);
//         equations (2) to (4) and (7) to (9) of lighting/deferred's README
#ifndef HEDDLE_SHARED_AREA_LIGHT_GLSL
#define HEDDLE_SHARED_AREA_LIGHT_GLSL
#include "light.glsl"

// sin^2 of the angular radius of the disc that gives the same irradiance to a plane facing it.
float sin_squared_of_form_factor(float form_factor) { return clamp(form_factor * kInversePi, 0.0, 1.0); }

// (2) Unit direction to the sphere's point nearest to the ray from the origin along R.
vec3 nearest_on_sphere(vec3 center, float radius, vec3 R) {
  vec3 off_ray = dot(center, R) * R - center;
  float distance_off = length(off_ray);
  vec3 to_light = center + off_ray * min(radius / max(distance_off, 1e-20), 1.0);
  float distance = length(to_light);
  // Inside the sphere every direction meets it.
  return dot(center, center) <= radius * radius || distance < 1e-20 ? R : to_light / distance;
}

// (3) Unit direction to the rectangle's point nearest to where the ray along R meets its plane.
vec3 nearest_on_rectangle(vec3 center, vec3 x_axis, vec3 y_axis, vec2 half_extent, vec3 R) {
  vec3 normal = cross(x_axis, y_axis);
  float approach = dot(R, normal);
  float height = dot(center, normal);
  // A ray that leaves the plane would meet it infinitely far along its own direction in the plane.
  float t = approach * height > 0.0 && abs(approach) > 1e-6 ? height / approach : 1e6 * length(center);
  vec3 from_center = R * t - center;
  vec2 q = clamp(vec2(dot(from_center, x_axis), dot(from_center, y_axis)), -half_extent, half_extent);
  vec3 to_light = center + x_axis * q.x + y_axis * q.y;
  float distance = length(to_light);
  return distance < 1e-20 ? R : to_light / distance;
}

// (4) Peak of the lobe widened by the light, over the peak of the lobe alone.
float widening(float alpha, float sin_squared, float VoH) {
  float a2 = alpha * alpha;
  return a2 / (a2 + sin_squared / (4.0 * max(VoH, 0.05)));
}

// A point that looks at a rectangle light, in the light's own axes: tangent, direction x tangent, against its direction.
struct FaceView {
  vec2 foot;     // metres: the point's foot on the light's plane, from the light's centre
  float height;  // metres of the point before that plane, > 0
  vec3 normal;   // the point's
};

FaceView face_view(HeddleLight light, vec3 position_rel, vec3 N) {
  vec3 center = light.position_rel - position_rel;
  vec3 y_axis = light_bitangent(light);
  return FaceView(-vec2(dot(center, light.tangent), dot(center, y_axis)), -dot(center, light.direction),
                  vec3(dot(N, light.tangent), dot(N, y_axis), -dot(N, light.direction)));
}

// (7) Of a plane that shines alike everywhere: whence most light comes to the point's own plane, metres from the centre.
vec2 brightest_on_face(FaceView view) {
  float b_squared = dot(view.normal.xy, view.normal.xy);
  float s = sqrt(4.0 * view.normal.z * view.normal.z + 3.0 * b_squared) + 2.0 * view.normal.z;
  return view.foot + view.normal.xy * (view.height / max(s, 1e-6));
}

// (8) Part of the face, metres from its centre: what a lobe around the point nearest to `middle` sees, which is
// `spread` metres wide to either side for each metre of distance.
struct FaceBox {
  vec2 low, high;
};

FaceBox face_box(FaceView view, vec2 middle, vec2 half_extent, float spread) {
  vec2 nearest = clamp(middle, -half_extent, half_extent);
  float radius = spread * length(vec3(nearest - view.foot, view.height));
  return FaceBox(max(nearest - radius, -half_extent), min(nearest + radius, half_extent));
}

// The mirror ray's lobe, whose trace on the face is longer the flatter it meets it.
FaceBox specular_face_box(HeddleLight light, FaceView view, vec3 L, float alpha) {
  vec3 local = vec3(dot(L, light.tangent), dot(L, light_bitangent(light)), max(-dot(L, light.direction), 1e-6));
  vec2 met = view.foot + local.xy * (view.height / local.z);
  return face_box(view, met, light.half_extent.xy, min(4.0 * alpha, 2.0) / max(local.z, 0.2));
}

#endif
