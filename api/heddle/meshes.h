/* SPDX-License-Identifier: Apache-2.0 */
/* The scene's meshes and where they are placed, for techniques that make geometry of them on the CPU or size buffers by
 * them. Everything is the host's. A technique that asks in declare is declared again, its object going on, before the
 * first frame in which the scene's meshes or components are others; moving and bending are no such change. */
#ifndef HEDDLE_MESHES_H
#define HEDDLE_MESHES_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_MESHES_SERVICE "heddle.meshes/1"

typedef struct heddle_scene_content {
  uint32_t struct_size;
  uint32_t mesh_count, instance_count, reserved;
  uint64_t revision;        /* the same number: the same meshes (but for how they bend), instances and components */
  uint64_t motion_revision; /* ... placed and bent the same */
  /* Least and greatest corner of a box around all instances, and of what the animations in use do with them: metres, as
   * scene positions are. Zeros: there are none. What techniques make is not counted. */
  double bounds[6];
  double typical_size; /* metres: half of the instances have a box whose diagonal is no longer */
} heddle_scene_content;

typedef struct heddle_scene_mesh {
  uint32_t struct_size;
  uint32_t material;
  uint32_t vertex_count, index_count;
  const HeddleVertex* vertices; /* as they are bent now */
  /* Last frame's. The same pointer where the mesh has not bent since. */
  const HeddleVertex* previous_vertices;
  const uint32_t* indices; /* triangles, counter-clockwise from the front */
  /* Faces as they were given, each a number of corners; a face of n corners is n - 2 consecutive triangles that begin with
   * its first corner: (0 1 2) (0 2 3) ... NULL: every triangle is a face. */
  const uint32_t* face_sizes;
  uint32_t face_count;
  uint32_t crease_count;
  /* Edges and vertices that a subdivided surface keeps sharp: crease_count pairs of vertices, both the same for a vertex by
   * itself, and how sharp: 0 smooth, n sharp for n levels, 10 and above for ever. */
  const uint32_t* creases;
  const float* sharpness;
  uint64_t shape, previous_shape; /* a number for each way in which the mesh bends; 0: it never bends */
} heddle_scene_mesh;

typedef struct heddle_scene_instance {
  uint32_t struct_size;
  uint32_t mesh;
  double scene_from_object[16], previous_scene_from_object[16]; /* column-major; last frame's */
} heddle_scene_instance;

typedef struct heddle_meshes_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In declare, prepare, activity, record and execute. The scene that is rendered or planned for; nothing if there is none.
   * The caller has set out->struct_size; what it points to is valid until the running call returns. [record-thread] */
  heddle_status (*content)(const heddle_pass_host* self, heddle_scene_content* out);
  /* HEDDLE_BUG for a number that the scene does not have. [record-thread] */
  heddle_status (*mesh)(const heddle_pass_host* self, uint32_t mesh, heddle_scene_mesh* out);
  heddle_status (*instance)(const heddle_pass_host* self, uint32_t instance, heddle_scene_instance* out);
} heddle_meshes_service;

HEDDLE_END_C
#endif
