/* SPDX-License-Identifier: Apache-2.0 */
/* Pieces of what a job makes: kept one by one, so that a scene that has changed makes anew what the change matters to and
 * nothing else. The job's artifact has a key of everything; a piece has one of what its technique says it depends on. */
#ifndef HEDDLE_PIECES_H
#define HEDDLE_PIECES_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_PIECES_SERVICE "heddle.pieces/0"

#define HEDDLE_NO_INSTANCE 0xffffffffu

/* Part of a surfaces port, and what it looks like. */
typedef struct heddle_surface_item {
  uint32_t struct_size;
  uint32_t instance; /* id of the scene's; HEDDLE_NO_INSTANCE: all that passes have made */
  uint32_t flags;    /* HEDDLE_SURFACE_*; of what passes have made all that are opaque, masked and blended */
  uint32_t reserved;
  double low[3], high[3]; /* its box in the scene, metres; -Inf and Inf where it is not known */
  /* The same numbers, in any process: the same triangles in the same places, with the same holes. Colours are not in it */
  uint64_t content[2];
} heddle_surface_item;

typedef struct heddle_pieces_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In execute of a pass that makes artifacts: what a surfaces port of its holds, as it is posed, in the scene's order,
   * without instances in whose place passes have put something, or nothing.
   * *out is the host's, valid until the call returns that the pass is in. HEDDLE_BUG elsewhere and for another port.
   * [record-thread] */
  heddle_status (*items)(const heddle_pass_host* self, heddle_frame* frame, const char* port,
                         const heddle_surface_item** out, uint32_t* out_count);
  /* In execute of a pass that makes artifacts: what was kept under the key, by whichever process; NULL and 0 if nothing
   * was, or if all is to be made again. In the key already: the technique, its library and shaders, and with gpu stages
   * device and driver. All else that the piece depends on, parameters too, is in `key_bytes` bytes at `key`, borrowed.
   * *out is the host's, valid until the next call of keep. [record-thread] */
  heddle_status (*find)(const heddle_pass_host* self, heddle_frame* frame, const void* key, uint64_t key_bytes,
                        const void** out, uint64_t* out_bytes);
  /* ... keeps it, on disk with the pass's artifacts when they are, in one file with others; may be gone when it is looked
   * for. Copied. [record-thread] */
  heddle_status (*keep)(const heddle_pass_host* self, heddle_frame* frame, const void* key, uint64_t key_bytes,
                        const void* data, uint64_t bytes);
} heddle_pieces_service;

HEDDLE_END_C
#endif
