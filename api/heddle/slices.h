/* SPDX-License-Identifier: Apache-2.0 */
/* Slices that several stages of a pass do together: one draws, the next looks at what was drawn, and both come again.
 * A stage by itself needs only HEDDLE_MORE. */
#ifndef HEDDLE_SLICES_H
#define HEDDLE_SLICES_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_SLICES_SERVICE "heddle.slices/0"

typedef struct heddle_slices_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In record and execute of a stage in a job, in each call that will answer HEDDLE_MORE: the next slice begins with
   * `stage`, an earlier stage of the same pass. That one and all of the pass's stages up to this run again, in their
   * order, activity first; info->slice counts up in all of them alike. The device is idle in between, and all that was
   * written is there, but for outputs of which the first of these stages to touch them keeps nothing.
   * Where the technique has save_state, both it and load_state are called for the stage that answers HEDDLE_MORE, and what
   * that stage's ports hold is kept. In another process the pass's stages begin with slice 0; when they come to that stage,
   * load_state is called, and `stage` to it run for the slice that it came to.
   * HEDDLE_BUG outside of jobs and in loops, and for a stage that is not an earlier one. [record-thread] */
  heddle_status (*begin_with)(const heddle_pass_host* self, heddle_frame* frame, const char* stage);
} heddle_slices_service;

HEDDLE_END_C
#endif
