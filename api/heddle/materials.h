/* SPDX-License-Identifier: Apache-2.0 */
/* What the scene's surfaces are made of, for cpu stages that shade: materials, their textures as they were decoded, and
 * those attributes of a snapshot's vertices that heddle_snapshot has no room for. Everything is the host's, and nothing is
 * copied for it. */
#ifndef HEDDLE_MATERIALS_H
#define HEDDLE_MATERIALS_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_MATERIALS_SERVICE "heddle.materials/0"

#define HEDDLE_WRAP_REPEAT 0u
#define HEDDLE_WRAP_MIRROR 1u
#define HEDDLE_WRAP_CLAMP 2u
#define HEDDLE_NO_IMAGE 0xffffffffu

typedef struct heddle_scene_look {
  uint32_t struct_size;
  uint32_t material_count, texture_count, reserved;
  uint64_t revision; /* the same number: the same materials and textures */
} heddle_scene_look;

typedef struct heddle_scene_material {
  uint32_t struct_size;
  uint32_t reserved;
  const HeddleMaterial* record; /* texture_layer, texture_layer_4 and texture_group mean nothing here */
  uint32_t textures[HEDDLE_TEXTURE_COUNT]; /* by HEDDLE_TEXTURE_*: numbers for `texture`, or HEDDLE_NO_IMAGE */
} heddle_scene_material;

/* The finest level, without filtering. */
typedef struct heddle_scene_texture {
  uint32_t struct_size;
  uint32_t width, height;
  uint32_t is_srgb;  /* 1: colour is encoded by sRGB's transfer function, alpha is not */
  uint32_t wrap[2];  /* HEDDLE_WRAP_*, in u and v */
  uint32_t is_nearest; /* 1: the sampler does not blend texels where it magnifies */
  uint32_t reserved;
  const uint8_t* rgba; /* width x height x 4, top row first */
} heddle_scene_texture;

/* Parallel to heddle_snapshot's vertices. */
typedef struct heddle_snapshot_attributes {
  uint32_t struct_size;
  uint32_t reserved;
  const float* tangents;  /* vertex_count x 4: unit, world axes, or 0; w: handedness, as HeddleVertex::tangent's */
  const float* uvs_1;     /* vertex_count x 2, uv1 */
  const uint32_t* colors; /* vertex_count, rgba8 unorm, linear */
} heddle_snapshot_attributes;

typedef struct heddle_materials_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In declare, prepare, activity, record and execute of stages without cached_by. The scene that is rendered or planned
   * for; nothing if there is none. The caller has set out->struct_size; what it points to is valid until the running call
   * returns. [record-thread] */
  heddle_status (*look)(const heddle_pass_host* self, heddle_scene_look* out);
  /* HEDDLE_BUG for a number that the scene does not have. [record-thread] */
  heddle_status (*material)(const heddle_pass_host* self, uint32_t material, heddle_scene_material* out);
  /* HEDDLE_BUG for a number that the scene does not have. [record-thread] */
  heddle_status (*texture)(const heddle_pass_host* self, uint32_t texture, heddle_scene_texture* out);
  /* In execute: of a snapshot that heddle_pass_host.snapshot gave, by that very pointer; valid as long as it is.
   * [record-thread] */
  heddle_status (*attributes)(const heddle_pass_host* self, const heddle_snapshot* snapshot,
                              heddle_snapshot_attributes* out);
} heddle_materials_service;

HEDDLE_END_C
#endif
