// SPDX-License-Identifier: Apache-2.0
// What stages of bake_visibility/depth_maps and their shaders agree on.
#ifndef HEDDLE_BAKE_VISIBILITY_PARAMS_H
#define HEDDLE_BAKE_VISIBILITY_PARAMS_H

#define BAKE_GROUP_SIZE 64
#define BAKE_TARGET_WIDTH 1024  // elements in a row of the target of `split_ramp`
// vec4 of a direction: the rows of clip_from_position that give x, y and reversed depth, and the direction, unit
#define BAKE_VECTORS_PER_DIRECTION 4
// vec4 of an element: position, normal, and normal of the surface itself
#define BAKE_VECTORS_PER_ELEMENT 3
// vec4 of an element's sums: (weight, open, tests, 0), (open N.s s, 0)
#define BAKE_VECTORS_PER_SUM 2

// Push constants: 48 bytes.
#ifdef VULKAN
#define BAKE_UINT uint
#define BAKE_FLOAT float
#else
#include <stdint.h>
#define BAKE_UINT uint32_t
#define BAKE_FLOAT float
#endif
struct BakePush {
  BAKE_UINT element_count;    // float_sums: the element behind the last
  BAKE_UINT first_direction;  // of the slice
  BAKE_UINT direction_count;  // in the slice
  BAKE_UINT layer;            // split_ramp: the one direction's depth map
  BAKE_FLOAT bias_slope;      // depth that a texel spans at 45 degrees, times the bias in texels
  BAKE_FLOAT bias_constant;   // depth: rounding, or the step of a coarse format
  BAKE_FLOAT bias_limit;      // most of tan: 0 none
  BAKE_FLOAT depth_steps;     // 0, or that many steps of depth are told apart
  BAKE_UINT first_element;    // float_sums
  BAKE_UINT reserved0, reserved1, reserved2;
};
#ifndef VULKAN
#ifdef __cplusplus
static_assert(sizeof(BakePush) == 48, "as the shaders lay it out");
#endif
#endif

#endif
