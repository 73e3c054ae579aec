/* SPDX-License-Identifier: Apache-2.0 */
/* What the device's driver does that Vulkan's limits do not tell. */
#ifndef HEDDLE_DEVICE_H
#define HEDDLE_DEVICE_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_DEVICE_SERVICE "heddle.device/0"

typedef struct heddle_device_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* After so many iterations in all the loops of a shader's invocation end, without a word, wherever they are; 0: they do
   * not. [any-thread] */
  uint64_t (*loop_limit)(const heddle_pass_host* self);
  /* What images of a VkFormat can be used for, as VkFormatFeatureFlags of optimal tiling: whether colours can be blended into
   * them, filtered, stored. [any-thread] */
  uint32_t (*format_features)(const heddle_pass_host* self, uint32_t format);
} heddle_device_service;

HEDDLE_END_C
#endif
