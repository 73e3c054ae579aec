/* SPDX-License-Identifier: Apache-2.0 */
/* The C border between libheddle and libheddle_image.so, the only library that links OpenImageIO. Both are built
 * together, so a differing revision is an error and nothing is negotiated. */
#ifndef HEDDLE_IMAGE_MODULE_H
#define HEDDLE_IMAGE_MODULE_H

#include <heddle/abi.h>

HEDDLE_BEGIN_C

#define HEDDLE_IMAGE_MODULE_REVISION 3u

/* Pixels made by the module, top row first, tightly packed; given back through `release`. */
typedef struct heddle_image_pixels {
  uint32_t width, height, channels;
  void* data; /* float (read) or uint8_t (decode8) */
} heddle_image_pixels;

/* A file that is read part by part. */
typedef struct heddle_image_source heddle_image_source;
typedef struct heddle_image_source_level {
  uint32_t width, height, channels;
  uint32_t block_width, block_height; /* decoded at once */
  uint32_t sample_bits, is_float;
  uint32_t level_count; /* of the file */
} heddle_image_source_level;

/* Each answers HEDDLE_OK, or another status with a NUL-terminated reason in `error`. [any-thread] */
typedef struct heddle_image_module {
  uint32_t struct_size;
  uint32_t revision; /* HEDDLE_IMAGE_MODULE_REVISION */
  heddle_status (*read)(const char* path, heddle_image_pixels* out, char* error, size_t error_size);
  /* Bytes of a whole file, its kind known by `extension` ("png"); four channels. Refuses more than maximum_texels before
   * it takes memory for them. */
  heddle_status (*decode8)(const void* bytes, size_t size, const char* extension, uint64_t maximum_texels,
                           heddle_image_pixels* out, char* error, size_t error_size);
  /* is_float: float samples in `data` and in the file; else uint8_t. The kind of file is the path's extension. */
  heddle_status (*write)(const char* path, uint32_t width, uint32_t height, uint32_t channels, uint32_t is_float,
                         const void* data, char* error, size_t error_size);
  void (*release)(heddle_image_pixels* pixels);
  /* Nothing is decoded; *out is given back through `close`. */
  heddle_status (*open)(const char* path, heddle_image_source** out, char* error, size_t error_size);
  heddle_status (*level)(heddle_image_source* source, uint32_t level, heddle_image_source_level* out, char* error,
                         size_t error_size);
  /* A rectangle that lies in the level, four channels a pixel, as floats or as bytes. Takes memory for a row of blocks,
   * and no more than that. One call at a time for a source. */
  heddle_status (*read_part)(heddle_image_source* source, uint32_t level, const uint32_t x_y_width_height[4],
                             uint32_t is_float, void* out, size_t row_bytes, char* error, size_t error_size);
  void (*close)(heddle_image_source* source);
} heddle_image_module;

/* The one exported symbol: static data. [any-thread] */
HEDDLE_EXPORT const heddle_image_module* heddle_image_module_entry(void);
typedef const heddle_image_module* (*heddle_image_module_entry_function)(void);

HEDDLE_END_C
#endif
