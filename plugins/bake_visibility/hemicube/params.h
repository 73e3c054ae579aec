// SPDX-License-Identifier: Apache-2.0
// What stages of bake_visibility/hemicube and their shader agree on.
#ifndef HEDDLE_BAKE_HEMICUBE_PARAMS_H
#define HEDDLE_BAKE_HEMICUBE_PARAMS_H

#define HEMICUBE_GROUP_SIZE 64
// vec4 of an element: two tangents and the normal, world axes, orthonormal; w: how much of each the surface's own
// normal is
#define HEMICUBE_VECTORS_PER_ELEMENT 3
// vec4 of an element's sums: (weight, open, 0, 0), (open weight times direction, 0)
#define HEMICUBE_VECTORS_PER_SUM 2
#define HEMICUBE_FACES 5

// Push constants: 16 bytes.
#ifdef VULKAN
#define HEMICUBE_UINT uint
#else
#include <stdint.h>
#define HEMICUBE_UINT uint32_t
#endif
struct HemicubePush {
  HEMICUBE_UINT first_element;  // of the slice; layer i is its element i
  HEMICUBE_UINT side;           // pixels of the upper face
  HEMICUBE_UINT reserved0, reserved1;
};
#ifndef VULKAN
#ifdef __cplusplus
static_assert(sizeof(HemicubePush) == 16, "as the shader lays it out");
#endif
#endif

#endif
