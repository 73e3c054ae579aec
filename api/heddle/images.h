/* SPDX-License-Identifier: Apache-2.0 */
/* Image files for plugins, read part by part, so that they may be larger than memory. The library that reads them is
 * opened with the first file, and not before. */
#ifndef HEDDLE_IMAGES_H
#define HEDDLE_IMAGES_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_IMAGES_SERVICE "heddle.images/0"

typedef struct heddle_image_file heddle_image_file; /* the host's */

/* What a level of a file is; level 0 is the image itself, more are in files of mip-mapped textures (TIFF, EXR). */
typedef struct heddle_image_level {
  uint32_t struct_size;
  uint32_t width, height, channels; /* of the file */
  /* What is decoded at once: a tile, or, where the file has none, a row. Parts of such a file are read from top to bottom:
   * some kinds (PNG, JPEG) begin anew for a part above the last one. */
  uint32_t block_width, block_height;
  uint32_t level_count; /* of the file; at least 1 */
  uint32_t sample_bits;
  uint32_t is_float; /* 1: the file holds floats, as a rule linear; 0: integers, as a rule encoded as sRGB */
  uint32_t reserved;
} heddle_image_level;

#define HEDDLE_IMAGE_BYTES 0u  /* uint8_t: integers as stored, 0 to 255; of 16 bits and floats those of 0 to 1, rounded */
#define HEDDLE_IMAGE_FLOATS 1u /* float: floats as stored; integers as parts of their largest value */

typedef struct heddle_image_part {
  uint32_t struct_size;
  uint32_t level;
  uint32_t x, y, width, height; /* pixels of the level, from its top left */
  uint32_t samples;             /* HEDDLE_IMAGE_* */
  uint32_t reserved;
} heddle_image_part;

typedef struct heddle_images_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In declare, prepare, activity, record and execute of stages without cached_by. `path` is what a parameter of type TEXT
   * or NAMES says; it means what resolve_path says of it, and in a job it must be a parameter's. *out is the host's until
   * `close`, at the latest until the pass is destroyed; nothing is decoded yet. HEDDLE_BAD_INPUT after an error that names
   * file and reason; HEDDLE_FAILED where the host has no library for images. [record-thread] */
  heddle_status (*open)(const heddle_pass_host* self, const char* path, heddle_image_file** out);
  /* The caller has set out->struct_size. HEDDLE_BAD_INPUT, after an error, for a level that the file does not have.
   * [record-thread] */
  heddle_status (*level)(const heddle_pass_host* self, heddle_image_file* file, uint32_t level, heddle_image_level* out);
  /* Writes a part of a level to `out`, four samples a pixel: grey is spread to colour, what has no alpha is opaque,
   * further channels are left out, colour is not multiplied by alpha. Rows are row_bytes apart. Beyond `out` it takes the
   * memory of one row of blocks as far as the part is wide, of a file without blocks 8 MiB or one row of the image (some
   * kinds of files can only be decoded whole: interlaced PNG). HEDDLE_BAD_INPUT, after an error with file and reason, for
   * a file that is damaged; HEDDLE_BUG for a part that does not lie in the level. [record-thread] */
  heddle_status (*read)(const heddle_pass_host* self, heddle_image_file* file, const heddle_image_part* part, void* out,
                        uint64_t row_bytes);
  /* [record-thread] */
  void (*close)(const heddle_pass_host* self, heddle_image_file* file);
} heddle_images_service;

HEDDLE_END_C
#endif
