/* SPDX-License-Identifier: Apache-2.0 */
/* Numbers of a technique's own beside those that the host counts: tiles drawn and kept, pages loaded, rays traced. */
#ifndef HEDDLE_COUNTERS_H
#define HEDDLE_COUNTERS_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_COUNTERS_SERVICE "heddle.counters/0"

typedef struct heddle_counters_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In activity, record, execute and counted: adds to a number of this frame, which heddle_stats tells by the names of
   * pass and counter. A counter begins at 0 in each frame that is submitted, and is told where something was added, 0
   * too. `name` is copied. [record-thread] */
  void (*add)(const heddle_pass_host* self, const char* name, uint64_t count);
} heddle_counters_service;

HEDDLE_END_C
#endif
