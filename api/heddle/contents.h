/* SPDX-License-Identifier: Apache-2.0 */
/* What images are known to hold before any shader has looked at them: nothing, where a view sees nothing. */
#ifndef HEDDLE_CONTENTS_H
#define HEDDLE_CONTENTS_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_CONTENTS_SERVICE "heddle.contents/0"

typedef struct heddle_contents_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In activity, record and execute, of an image that the stage declares: 1 where every texel of it is the neutral value
   * of the role's port. So it is where the port is unbound; where its maker has cleared it to that in this frame and has
   * drawn nothing since, as nothing of the surfaces is in view; and where its maker has answered HEDDLE_NOTHING. A stage
   * that would make its own neutral values of that answers HEDDLE_NOTHING itself, and dispatches nothing.
   * 0: it holds something else, or nobody knows. HEDDLE_BUG is reported for another port, and 0 answered.
   * [record-thread] */
  uint32_t (*is_neutral)(const heddle_pass_host* self, heddle_frame* frame, const char* port);
} heddle_contents_service;

HEDDLE_END_C
#endif
