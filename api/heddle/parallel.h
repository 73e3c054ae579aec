/* SPDX-License-Identifier: Apache-2.0 */
/* Work of one cpu stage on several processors. Plugins have no threads of their own: the host lends its. */
#ifndef HEDDLE_PARALLEL_H
#define HEDDLE_PARALLEL_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_PARALLEL_SERVICE "heddle.parallel/0"

/* One piece of the work. `thread` is less than the number that for_each got by `most_threads`, and no two pieces run at
 * once with the same one: it may choose memory. Nothing may be thrown out of it, and it calls nothing of the host but what
 * is [any-thread]. [any-thread] */
typedef void (*heddle_parallel_work)(void* user, uint64_t index, uint32_t thread);

typedef struct heddle_parallel_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* How many threads for_each uses where it is asked for `wanted` of them, 0: one a processor. At least 1.
   * [record-thread] */
  uint32_t (*most_threads)(const heddle_pass_host* self, uint32_t wanted);
  /* In execute: calls `work` once for each index below `count`, in any order, on most_threads(wanted) threads, of which
   * the caller's is one; returns when all are done. What it makes must not depend on order or number of threads.
   * `user` is passed on. Where the system lends fewer threads, these do it all. HEDDLE_FAILED, after an error and with
   * nothing done, where memory runs out.
   * [record-thread] */
  heddle_status (*for_each)(const heddle_pass_host* self, uint32_t wanted, uint64_t count, heddle_parallel_work work,
                            void* user);
} heddle_parallel_service;

HEDDLE_END_C
#endif
