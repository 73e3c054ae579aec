/* SPDX-License-Identifier: Apache-2.0 */
/* CPU twins of roles' functions, in float64. Each is a C table; `struct_size` first, fields appended only. */
#ifndef HEDDLE_SERVICES_H
#define HEDDLE_SERVICES_H

#include <heddle/abi.h>

HEDDLE_BEGIN_C

/* A point of a surface after textures: what `surface_material` shades. Colours linear Rec.709. */
typedef struct heddle_surface_point {
  uint32_t struct_size;
  uint32_t reserved;
  double base_color[3];
  double metalness;
  double roughness; /* perceptual, alpha = roughness^2 */
  double ior;
} heddle_surface_point;

/* Role surface_material. Directions are unit vectors in the frame where the normal is +Z, pointing away from the
 * surface. Below the horizon every function answers 0. */
typedef struct heddle_surface_material_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* BRDF f(view, light) without the cosine, per steradian; lobe: 0 all, 1 diffuse, 2 specular (with compensation).
   * multiple_scattering: 1 compensates the energy that single scattering loses. [any-thread] */
  void (*evaluate)(const heddle_surface_point* point, const double view[3], const double light[3], uint32_t lobe,
                   uint32_t multiple_scattering, double out_rgb[3]);
  /* Draws a light direction from two numbers in [0,1); the density per steradian goes to out_pdf (0: no sample).
   * [any-thread] */
  void (*sample)(const heddle_surface_point* point, const double view[3], const double u[2], double u_lobe,
                 double out_light[3], double* out_pdf);
  /* The density per steradian with which `sample` draws this direction. [any-thread] */
  double (*pdf)(const heddle_surface_point* point, const double view[3], const double light[3]);
  /* Directional albedo of a lobe: the cosine-weighted integral of evaluate over the hemisphere, tabulated.
   * [any-thread] */
  void (*albedo)(const heddle_surface_point* point, double n_dot_v, uint32_t lobe, uint32_t multiple_scattering,
                 double out_rgb[3]);
  /* evaluate of lobe 1, of lobe 2, and pdf, for what one of them costs; where struct_size says that it is there.
   * [any-thread] */
  void (*evaluate_parts)(const heddle_surface_point* point, const double view[3], const double light[3],
                         uint32_t multiple_scattering, double out_diffuse[3], double out_specular[3], double* out_pdf);
  /* sample, with evaluate_parts of the direction that it draws; where struct_size says that it is there. Of no sample all
   * is 0. [any-thread] */
  void (*sample_parts)(const heddle_surface_point* point, const double view[3], const double u[2], double u_lobe,
                       uint32_t multiple_scattering, double out_light[3], double out_diffuse[3], double out_specular[3],
                       double* out_pdf);
} heddle_surface_material_service;

HEDDLE_END_C
#endif
