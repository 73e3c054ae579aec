/* SPDX-License-Identifier: Apache-2.0 */
/* What every Heddle header stands on: version, export, status, thread tags.
 *
 * Rules of the border. C11. Fixed-width integers; no enums, bools or bit-fields in structures. Every structure that
 * crosses starts with `uint32_t struct_size`, set by whoever fills it to sizeof of its own definition; fields are only
 * appended; a reader never looks past struct_size. No build option changes a structure. Strings are UTF-8 and
 * NUL-terminated. Unless a comment says otherwise, what a caller passes is borrowed until the call returns, and what a
 * descriptor points to lives as long as the library is open.
 *
 * Thread tags, last in every function's comment (a comment also stands for the functions that follow the first one
 * without an empty line or another comment):
 *   [main-thread]    the thread that made the host; one at a time for each host
 *   [record-thread]  the thread that records a frame; never two at once for one pass
 *   [any-thread]     any, also several at once */
#ifndef HEDDLE_ABI_H
#define HEDDLE_ABI_H

#include <stddef.h>
#include <stdint.h>

/* 0.x: a plugin loads only into a host of the same MAJOR and MINOR. From 1.0 on: any minor up to the host's. */
#define HEDDLE_ABI_MAJOR 0u
#define HEDDLE_ABI_MINOR 1u

#define HEDDLE_EXPORT __attribute__((visibility("default")))

#ifdef __cplusplus
#define HEDDLE_BEGIN_C extern "C" {
#define HEDDLE_END_C }
#else
#define HEDDLE_BEGIN_C
#define HEDDLE_END_C
#endif

/* Also the exit status of the command: bad input 2, unsupported 3, failed 4, bug 5; an image comparison that exceeds
 * its bound exits with 1, and so does a job that reports an error. */
typedef int32_t heddle_status;
#define HEDDLE_OK 0
#define HEDDLE_BAD_INPUT 2   /* what came from outside is wrong: a file, a name, a value */
#define HEDDLE_UNSUPPORTED 3 /* right, but not on this device, driver or build */
#define HEDDLE_FAILED 4      /* circumstances: no memory, no space, device lost, library missing */
#define HEDDLE_BUG 5         /* a contract of these headers was broken by the caller or by a plugin */
#define HEDDLE_CANCELLED 6   /* heddle_cancel asked for it; the command then exits with 130 */
#define HEDDLE_MORE 7        /* record and execute alone: a slice of the work is done, and they want to be called again */

#endif
