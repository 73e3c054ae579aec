// SPDX-License-Identifier: Apache-2.0
// Where the specular lobe of a point meets a light that has a size, and how much the light widens the lobe.
// Source  Karis 2013, "Real Shading in Unreal Engine 4", "Area Lights" (representative point, normalization);
//         equations (2) to (4) of lighting/deferred's README
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

#endif
