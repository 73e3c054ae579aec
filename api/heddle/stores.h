/* SPDX-License-Identifier: Apache-2.0 */
/* Stores: what a job makes that is too large for memory. A store is a file beside an artifact, made with it, whole or not
 * at all, and gone with it; the artifact itself says what lies where in it. Who reads the artifact reads the store, part
 * by part, without waiting. */
#ifndef HEDDLE_STORES_H
#define HEDDLE_STORES_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_STORES_SERVICE "heddle.stores/0"

typedef struct heddle_store heddle_store; /* the host's; until `close`, at the latest until the pass is destroyed */

/* Since it was opened. */
typedef struct heddle_store_counts {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t reads;      /* of whole clusters, by the store's thread */
  uint64_t bytes_read; /* by them */
  uint64_t bytes_used; /* of these, those that were asked for */
  uint64_t waits;      /* how often the caller had to wait for it */
  uint64_t wait_ns;
} heddle_store_counts;

typedef struct heddle_stores_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In execute of a stage of a job, without cached_by. An empty store, to write and to read. `artifact`: the artifact of
   * this pass that it lies beside, which has one at most; NULL: it is scratch, and gone with the pass. HEDDLE_BAD_INPUT
   * after an error if it cannot be made. [record-thread] */
  heddle_status (*make)(const heddle_pass_host* self, heddle_frame* frame, const char* artifact, heddle_store** out);
  /* In declare, prepare, activity, record and execute. The store beside an artifact that comes in, to read; *out is NULL
   * where the port is unbound or its artifact has no store. HEDDLE_BAD_INPUT, after an error, where the file is not there
   * or not what was made. [record-thread] */
  heddle_status (*open)(const heddle_pass_host* self, const char* artifact, heddle_store** out);
  /* Bytes written so far; of a store that was opened: all. [record-thread] */
  uint64_t (*size)(const heddle_pass_host* self, heddle_store* store);
  /* Of a store that the pass makes: anywhere, also where it was written before; what was never written is 0.
   * HEDDLE_BAD_INPUT, after an error, where there is no room. [record-thread] */
  heddle_status (*write)(const heddle_pass_host* self, heddle_store* store, uint64_t offset, const void* data,
                         uint64_t bytes);
  /* Waits for it. HEDDLE_BAD_INPUT after an error with file and reason. [record-thread] */
  heddle_status (*read)(const heddle_pass_host* self, heddle_store* store, uint64_t offset, void* out, uint64_t bytes);
  /* Asks for bytes that `collect` gives later, and returns at once. They are read on a thread of the host's, in the order
   * in which they are asked for, past the system's cache where the file system can do that, in aligned clusters.
   * HEDDLE_BUG for bytes that the store does not have. [record-thread] */
  heddle_status (*request)(const heddle_pass_host* self, heddle_store* store, uint64_t offset, uint64_t bytes,
                           uint64_t* out_ticket);
  /* *out: the bytes, until `release`; NULL: not yet. They are there exactly when is_due says so, so that frames repeat to
   * the bit: with is_due 0 never, with 1 always, and the host waits if it must. A live host does not wait: they are there
   * when they have come. HEDDLE_BAD_INPUT, after an error with file and reason, where they cannot be read.
   * [record-thread] */
  heddle_status (*collect)(const heddle_pass_host* self, heddle_store* store, uint64_t ticket, uint32_t is_due,
                           const void** out);
  /* Whether the bytes have come or not. [record-thread] */
  void (*release)(const heddle_pass_host* self, heddle_store* store, uint64_t ticket);
  /* The caller has set out->struct_size. [record-thread] */
  void (*counts)(const heddle_pass_host* self, heddle_store* store, heddle_store_counts* out);
  /* The file, for messages; the host's, valid as long as the store. [record-thread] */
  const char* (*file)(const heddle_pass_host* self, heddle_store* store);
  /* Not of one that the pass makes beside an artifact: the host does it. [record-thread] */
  void (*close)(const heddle_pass_host* self, heddle_store* store);
} heddle_stores_service;

HEDDLE_END_C
#endif
