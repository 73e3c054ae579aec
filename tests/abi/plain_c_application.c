/* SPDX-License-Identifier: Apache-2.0 */
/* An application in plain C, of heddle.h alone: a triangle through a whole graph, with a display technique in plain C.
 * usage: plain_c_application PLUGIN_PATH */
#include <heddle/heddle.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#define WIDTH 64u
#define HEIGHT 48u

static int failures;

static void expect(int is_right, const char* what, int line) {
  if (is_right) return;
  ++failures;
  fprintf(stderr, "plain_c_application.c:%d: not so: %s\n", line, what);
}
#define EXPECT(condition) expect((condition), #condition, __LINE__)

static void log_line(void* user, uint32_t severity, const char* text) {
  (void)user, (void)severity;
  fprintf(stderr, "%s\n", text);
}

static const char graph_text[] =
    "extent = [64, 48]\n"
    "output = \"screen.color\"\n"
    "[[pass]]\n"
    "name = \"brdf\"\n"
    "role = \"surface_material\"\n"
    "technique = \"ggx\"\n"
    "[[pass]]\n"
    "name = \"gbuffer\"\n"
    "role = \"gbuffer\"\n"
    "technique = \"raster\"\n"
    "params.precision = \"float32\"\n"
    "[[pass]]\n"
    "name = \"light\"\n"
    "role = \"lighting\"\n"
    "technique = \"deferred\"\n"
    "params.precision = \"float32\"\n"
    "[[pass]]\n"
    "name = \"screen\"\n"
    "role = \"display\"\n"
    "technique = \"grayscale\"\n"
    "params.encoding = \"linear\"\n";

/* An unlit triangle that covers the middle of the view and leaves its corners free. */
static heddle_status build_scene(heddle_scene* scene) {
  static const float positions[] = {-1, -0.5f, -3, 1, -0.5f, -3, 0, 0.8f, -3};
  static const uint32_t indices[] = {0, 1, 2};
  static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  heddle_material material;
  heddle_mesh mesh;
  heddle_camera camera;
  uint32_t material_id = HEDDLE_NONE, mesh_id = HEDDLE_NONE, instance_id = HEDDLE_NONE, camera_id = HEDDLE_NONE, i;
  heddle_status status;

  memset(&material, 0, sizeof material);
  material.struct_size = sizeof material;
  for (i = 0; i < HEDDLE_TEXTURE_COUNT; ++i) material.textures[i] = HEDDLE_NONE;
  material.record.base_color[0] = 0.8f;
  material.record.base_color[1] = 0.4f;
  material.record.base_color[2] = 0.2f;
  material.record.base_color[3] = 1.0f;
  material.record.roughness = 1.0f;
  material.record.ior = 1.5f;
  material.record.normal_scale = 1.0f;
  material.record.occlusion_strength = 1.0f;
  material.record.uv_rotation_scale[0] = material.record.uv_rotation_scale[3] = 1.0f;
  material.record.flags = HEDDLE_MATERIAL_UNLIT;

  memset(&mesh, 0, sizeof mesh);
  mesh.struct_size = sizeof mesh;
  mesh.vertex_count = 3;
  mesh.index_count = 3;
  mesh.positions = positions;
  mesh.indices = indices;

  memset(&camera, 0, sizeof camera);
  camera.struct_size = sizeof camera;
  camera.rotation[3] = 1;
  camera.vertical_angle = 1.0;
  camera.near_distance = 0.1;

  status = heddle_scene_add_material(scene, "paint", &material, &material_id);
  if (status == HEDDLE_OK) status = heddle_scene_add_mesh(scene, "triangle", &mesh, material_id, &mesh_id);
  if (status == HEDDLE_OK) status = heddle_scene_add_instance(scene, NULL, mesh_id, identity, &instance_id);
  if (status == HEDDLE_OK) status = heddle_scene_add_camera(scene, "view", &camera, &camera_id);
  if (status == HEDDLE_OK) status = heddle_scene_use_camera(scene, camera_id);
  EXPECT(material_id != HEDDLE_NONE && mesh_id == 0 && instance_id == 0 && camera_id == 0);
  return status;
}

static float pixel(const heddle_image* image, uint32_t x, uint32_t y, uint32_t channel) {
  return image->pixels[(y * image->width + x) * image->channels + channel];
}

/* BT.709 luminance of the triangle's colour. 8-bit steps of base colour and output: 1.5 of 255. */
static void check_picture(heddle_graph* graph, float white) {
  const float luminance = (0.2126f * 0.8f + 0.7152f * 0.4f + 0.0722f * 0.2f) / white;
  heddle_image image;
  uint32_t y, x, covered = 0;
  memset(&image, 0, sizeof image);
  image.struct_size = sizeof image;
  EXPECT(heddle_read(graph, NULL, 0, 0, &image) == HEDDLE_OK);
  EXPECT(image.width == WIDTH && image.height == HEIGHT && image.channels == 4 && image.pixels != NULL);
  if (image.pixels == NULL) return;
  for (x = 0; x < 3; ++x) {
    EXPECT(fabsf(pixel(&image, WIDTH / 2, HEIGHT / 2, x) - luminance) < 1.5f / 255.0f);
    EXPECT(pixel(&image, 0, 0, x) == 0.0f);
    EXPECT(pixel(&image, WIDTH - 1, HEIGHT - 1, x) == 0.0f);
  }
  for (y = 0; y < HEIGHT; ++y) {
    for (x = 0; x < WIDTH; ++x) covered += pixel(&image, x, y, 0) > 0.0f;
  }
  /* 1.3 square metres at 3 m, where the view is 2 * 3 tan(0.5) = 3.278 m high: 279 pixels, and half of those on the
   * edges, whose length is 4.72 m or 69 pixels. */
  EXPECT(covered > 279 - 35 && covered < 279 + 35);
}

static void check_errors(heddle_host* host) {
  static const char* const setting = "screen.technique=greyscale";
  heddle_graph* graph = NULL;
  EXPECT(heddle_graph_parse(host, graph_text, "graph.toml", ".", &setting, 1, &graph) == HEDDLE_BAD_INPUT);
  EXPECT(graph == NULL);
  EXPECT(strstr(heddle_error(host), "greyscale") != NULL);
  EXPECT(strstr(heddle_error(host), "did you mean 'grayscale'?") != NULL);
}

static void render(heddle_host* host) {
  heddle_scene* scene = NULL;
  heddle_graph* graph = NULL;
  heddle_render_options options;
  memset(&options, 0, sizeof options);
  options.struct_size = sizeof options;
  options.time_step = 1.0 / 60.0;
  EXPECT(heddle_scene_create(host, &scene) == HEDDLE_OK);
  EXPECT(build_scene(scene) == HEDDLE_OK);
  EXPECT(heddle_graph_parse(host, graph_text, "graph.toml", ".", NULL, 0, &graph) == HEDDLE_OK);
  if (graph != NULL && scene != NULL) {
    EXPECT(heddle_render(graph, scene, NULL) == HEDDLE_OK);
    check_picture(graph, 1.0f);
    EXPECT(heddle_graph_set(graph, "screen.params.white=2") == HEDDLE_OK);
    EXPECT(heddle_render(graph, scene, &options) == HEDDLE_OK);
    check_picture(graph, 2.0f);
    EXPECT(heddle_graph_set(graph, "screen.params.white=-2") == HEDDLE_BAD_INPUT);
  }
  if (failures != 0) fprintf(stderr, "%s\n", heddle_error(host));
  heddle_graph_destroy(graph);
  heddle_scene_destroy(scene);
}

int main(int argc, char** argv) {
  heddle_host_options options;
  heddle_host* host = NULL;
  const char* list = NULL;
  if (argc != 2) {
    fprintf(stderr, "usage: plain_c_application PLUGIN_PATH\n");
    return HEDDLE_BAD_INPUT;
  }
  memset(&options, 0, sizeof options);
  options.struct_size = sizeof options;
  options.plugin_path = argv[1];
  options.log = log_line;
  if (heddle_create(&options, &host) != HEDDLE_OK) {
    fprintf(stderr, "%s\n", heddle_error(NULL));
    return 1;
  }
  EXPECT(heddle_list(host, &list) == HEDDLE_OK);
  EXPECT(list != NULL && strstr(list, "display/grayscale") != NULL);
  check_errors(host);
  render(host);
  heddle_destroy(host);
  return failures == 0 ? 0 : 1;
}
