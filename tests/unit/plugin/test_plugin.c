/* SPDX-License-Identifier: Apache-2.0 */
/* The smallest right plugin; each HEDDLE_TEST_* breaks one rule. */
#include <heddle/plugin.h>

static const heddle_port ports[] = {
    {.struct_size = sizeof(heddle_port), .name = "radiance", .type = HEDDLE_PORT_IMAGE, .direction = HEDDLE_IN},
    {.struct_size = sizeof(heddle_port),
     .name = "color",
     .type = HEDDLE_PORT_IMAGE,
     .direction = HEDDLE_OUT,
     .format = VK_FORMAT_R8G8B8A8_UNORM},
};
static const heddle_access accesses[] = {
    {.struct_size = sizeof(heddle_access), .port = "radiance", .access = HEDDLE_ACCESS_SAMPLED},
    {.struct_size = sizeof(heddle_access), .port = "color", .access = HEDDLE_ACCESS_STORAGE_WRITE},
};
static const heddle_stage stages[] = {
    {.struct_size = sizeof(heddle_stage),
     .name = "main",
     .kind = HEDDLE_STAGE_GPU,
     .access_count = 2,
     .accesses = accesses},
};

#ifdef HEDDLE_TEST_OTHER_TITLE
#define TITLE "Another title"
#else
#define TITLE "A test"
#endif

static const heddle_technique technique = {
    .struct_size = sizeof(heddle_technique),
    .id = "display/test",
    .title = TITLE,
    .source = "none",
    .role_revision = 1,
    .port_count = 2,
    .ports = ports,
    .stage_count = 1,
    .stages = stages,
};

#ifdef HEDDLE_TEST_TWO_TECHNIQUES
static const heddle_technique other = {
    .struct_size = sizeof(heddle_technique),
    .id = "display/other",
    .title = "The other",
    .role_revision = 1,
    .port_count = 2,
    .ports = ports,
    .stage_count = 1,
    .stages = stages,
};
static const heddle_technique* const techniques[] = {&technique, &other};
#else
static const heddle_technique* const techniques[] = {&technique};
#endif

#ifdef HEDDLE_TEST_OTHER_ABI
#define MINOR 77u
#else
#define MINOR HEDDLE_ABI_MINOR
#endif

static const heddle_plugin plugin = {.struct_size = sizeof(heddle_plugin),
                                     .abi_major = HEDDLE_ABI_MAJOR,
                                     .abi_minor = MINOR,
                                     .technique_count = sizeof techniques / sizeof *techniques,
                                     .techniques = techniques};

#ifdef HEDDLE_TEST_UNDEFINED_SYMBOL
extern int heddle_test_symbol_that_nobody_defines(void);
#endif
#if defined HEDDLE_TEST_WITH_THREAD || defined HEDDLE_TEST_WITHOUT_COMPANION
extern void heddle_test_start_thread(void);
#endif

#ifdef HEDDLE_TEST_NO_ENTRY
HEDDLE_EXPORT const heddle_plugin* heddle_entree(void);
HEDDLE_EXPORT const heddle_plugin* heddle_entree(void) {
  return &plugin;
}
#else
const heddle_plugin* heddle_entry(void) {
#ifdef HEDDLE_TEST_NULL_ENTRY
  if (plugin.struct_size != 0) return 0;
#endif
#ifdef HEDDLE_TEST_UNDEFINED_SYMBOL
  if (heddle_test_symbol_that_nobody_defines() != 0) return 0;
#endif
#if defined HEDDLE_TEST_WITH_THREAD || defined HEDDLE_TEST_WITHOUT_COMPANION
  heddle_test_start_thread();
#endif
  return &plugin;
}
#endif
