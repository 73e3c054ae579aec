/* SPDX-License-Identifier: Apache-2.0 */
/* display/grayscale: a technique in plain C, of plugin.h alone. It counts its frames to show that its object lives. */
#include <heddle/plugin.h>

#include <stdlib.h>

#define COUNT(array) ((uint32_t)(sizeof(array) / sizeof *(array)))

struct heddle_pass {
  uint64_t frames;
};

static const heddle_port ports[] = {
    {.struct_size = sizeof(heddle_port),
     .name = "radiance",
     .type = HEDDLE_PORT_IMAGE,
     .direction = HEDDLE_IN,
     .help = "linear Rec.709"},
    {.struct_size = sizeof(heddle_port),
     .name = "color",
     .type = HEDDLE_PORT_IMAGE,
     .direction = HEDDLE_OUT,
     .format = VK_FORMAT_R8G8B8A8_UNORM,
     .help = "grey of the same luminance"},
};

static const char* const encodings[] = {"linear", "srgb", NULL};
static const heddle_parameter parameters[] = {
    {.struct_size = sizeof(heddle_parameter),
     .name = "white",
     .type = HEDDLE_TYPE_FLOAT,
     .unit = "cd/m^2",
     .minimum = 1e-6,
     .maximum = 1e9,
     .default_value = {1},
     .help = "luminance that shows as white"},
    {.struct_size = sizeof(heddle_parameter),
     .name = "encoding",
     .type = HEDDLE_TYPE_CHOICE,
     .unit = "1",
     .default_value = {1},
     .choices = encodings,
     .help = "of the output"},
};

static const heddle_access accesses[] = {
    {.struct_size = sizeof(heddle_access), .port = "radiance", .access = HEDDLE_ACCESS_SAMPLED},
    {.struct_size = sizeof(heddle_access), .port = "color", .access = HEDDLE_ACCESS_STORAGE_WRITE},
};
static const heddle_stage stages[] = {
    {.struct_size = sizeof(heddle_stage),
     .name = "convert",
     .kind = HEDDLE_STAGE_GPU,
     .access_count = COUNT(accesses),
     .accesses = accesses},
};
static const heddle_shader shaders[] = {
    {.struct_size = sizeof(heddle_shader),
     .name = "grayscale",
     .kind = HEDDLE_SHADER_COMPUTE,
     .stage = "convert",
     .file = "grayscale.comp.glsl"},
};

static heddle_status create(const heddle_pass_host* host, heddle_pass** out) {
  *out = calloc(1, sizeof **out);
  if (*out != NULL) return HEDDLE_OK;
  host->report(host, HEDDLE_SEVERITY_ERROR, "out of memory");
  return HEDDLE_FAILED;
}

static heddle_status record(heddle_pass* pass, const heddle_pass_host* host, uint32_t stage, heddle_frame* frame,
                            const heddle_frame_info* info) {
  (void)stage;
  if (info->index < pass->frames) {
    host->report(host, HEDDLE_SEVERITY_ERROR, "the frame index went backwards");
    return HEDDLE_BUG;
  }
  pass->frames = info->index;
  return host->dispatch_over(host, frame, "grayscale", "color", NULL, 0);
}

static void destroy(heddle_pass* pass) {
  free(pass);
}

static const heddle_technique technique = {
    .struct_size = sizeof(heddle_technique),
    .id = "display/grayscale",
    .title = "Luminance alone",
    .source = "ITU-R BT.709-6 (2015)",
    .role_revision = 1,
    .port_count = COUNT(ports),
    .ports = ports,
    .parameter_count = COUNT(parameters),
    .parameters = parameters,
    .stage_count = COUNT(stages),
    .stages = stages,
    .shader_count = COUNT(shaders),
    .shaders = shaders,
    .create = create,
    .record = record,
    .destroy = destroy,
};
static const heddle_technique* const techniques[] = {&technique};
static const heddle_plugin plugin = {
    .struct_size = sizeof(heddle_plugin),
    .abi_major = HEDDLE_ABI_MAJOR,
    .abi_minor = HEDDLE_ABI_MINOR,
    .technique_count = COUNT(techniques),
    .techniques = techniques,
};

const heddle_plugin* heddle_entry(void) {
  return &plugin;
}
