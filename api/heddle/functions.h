/* SPDX-License-Identifier: Apache-2.0 */
/* Who answers the functions that a pass calls: what the caller has to know of them. */
#ifndef HEDDLE_FUNCTIONS_H
#define HEDDLE_FUNCTIONS_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_FUNCTIONS_SERVICE "heddle.functions/0"

typedef struct heddle_functions_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* Passes that answer the functions of a role for this pass; 0: the role's neutral body does, or the technique calls
   * none of them. In every call but create and destroy. [record-thread] */
  uint32_t (*provider_count)(const heddle_pass_host* self, const char* role);
  /* A parameter of provider `index`, in the graph's order; the first is whom function_service is of. As
   * heddle_pass_host.parameter: the number of components, 0 if there is no such provider or parameter. [record-thread] */
  uint32_t (*provider_parameter)(const heddle_pass_host* self, const char* role, uint32_t index, const char* name,
                                 double out[3]);
} heddle_functions_service;

HEDDLE_END_C
#endif
