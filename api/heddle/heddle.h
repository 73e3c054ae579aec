/* SPDX-License-Identifier: Apache-2.0 */
/* The application's side of libheddle: hosts, scenes, graphs, rendering, read-back, images. The command `heddle` and the
 * Python package use nothing else.
 *
 * Every function that can fail returns a heddle_status; heddle_error then gives the whole message in the form
 *   file:line:column: error: what was wrong / found / expected / help.
 * Text and data handed out belong to the object they were asked from and live until the next call of the same function
 * on it, or its destruction. */
#ifndef HEDDLE_H
#define HEDDLE_H

#include <heddle/abi.h>
#include <heddle/records.h>

HEDDLE_BEGIN_C

typedef struct heddle_host heddle_host;
typedef struct heddle_scene heddle_scene;
typedef struct heddle_graph heddle_graph;

/* ---- Host --------------------------------------------------------------------------------------------------------- */
#define HEDDLE_HOST_VALIDATION 1u /* Vulkan validation layer, with synchronization checks; its messages become errors */
/* Each frame is proven: every read-after-write, write-after-read, write-after-write and layout of the commands recorded
 * is covered by barriers, also across frames; and every image that a pass makes is searched for NaN, for Inf where its
 * role does not allow it, and for values outside of its role's range. What is found is an error of heddle_render. Slow:
 * for looking. Render three frames, so that what one leaves to the next has come round. */
#define HEDDLE_HOST_CHECK 2u
#define HEDDLE_HOST_REMAKE 4u /* artifacts that the cache holds are made again, and replaced */
/* Nothing waits for the GPU that need not: heddle_render submits its frame and returns, while up to two frames before it
 * may still run, and a cpu stage with latency k takes the copy of k frames ago if it is there, else the newest before
 * that that is. Frames then depend on time, and no bytes are promised. What is asked of a frame (heddle_read,
 * heddle_inspect) waits for it; so do frames whose scene has other meshes or materials than the last. Not together with
 * HEDDLE_HOST_CHECK. Without it, frames are repeatable: every copy arrives exactly k frames later. */
#define HEDDLE_HOST_LIVE 8u

typedef struct heddle_host_options {
  uint32_t struct_size;
  uint32_t flags;          /* HEDDLE_HOST_* */
  const char* device;      /* part of a device's name, or its index as text; NULL: HEDDLE_DEVICE, else lavapipe, else 0 */
  const char* plugin_path; /* folders with plugins, separated by ':'; NULL: HEDDLE_PLUGIN_PATH, else the library's own */
  const char* cache_path;  /* compiled shaders, artifacts; NULL: HEDDLE_CACHE, else ~/.cache/heddle */
  /* Told warnings and information, line by line; NULL: not told. Called on the thread of the call that causes it.
   * [main-thread] */
  void (*log)(void* user, uint32_t severity, const char* text);
  void* log_user;
  /* Told how far a call has come that may take long (loading a file, planning and rendering a frame): what it is at, and
   * how much of that is done, 0 to 1. Answers 0 to go on; else the call ends with HEDDLE_FAILED, and what it was to change
   * is as before. NULL: not told. On the thread of the call, which it must not enter again. [main-thread] */
  uint32_t (*progress)(void* user, const char* activity, double fraction);
  void* progress_user;
} heddle_host_options;

/* "0.1.0". [any-thread] */
HEDDLE_EXPORT const char* heddle_version(void);
/* Reads manifests and roles; opens no plugin and no device. options may be NULL. On failure *out is NULL and the message
 * is heddle_error(NULL) on the same thread. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_create(const heddle_host_options* options, heddle_host** out);
/* Destroy graphs and scenes first. NULL is ignored. [main-thread] */
HEDDLE_EXPORT void heddle_destroy(heddle_host* host);
/* Message of the last call on this host that failed; "" if none. NULL: of this thread's last heddle_create, heddle_compare
 * or heddle_comparison_map that failed. [main-thread] */
HEDDLE_EXPORT const char* heddle_error(const heddle_host* host);
/* The heddle_render, heddle_inspect or heddle_graph_check that runs, or else the next one, stops before its next stage or
 * shader, or where a long stage asks, and returns HEDDLE_CANCELLED; what the GPU has begun is waited for. What the graph kept of earlier frames is
 * lost. Touches one atomic flag: may be called in a signal handler. [any-thread] */
HEDDLE_EXPORT void heddle_cancel(heddle_host* host);
/* Techniques and roles, from manifests alone, as JSON: {"roles": [...], "techniques": [...]}. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_list(heddle_host* host, const char** out_json);
/* A JSON Schema (draft 7) for editors: of "graph" files, made from roles and manifests alone, or of "scene" overlays.
 * [main-thread] */
HEDDLE_EXPORT heddle_status heddle_schema(heddle_host* host, const char* kind, const char** out_json);
/* Vulkan devices as JSON. Opens Vulkan's loader, creates no device. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_devices(heddle_host* host, const char** out_json);
/* Driver, layers, optional libraries, and for each technique whether it runs on the chosen device, and if not, what
 * happens instead; JSON. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_doctor(heddle_host* host, const char** out_json);

/* ---- Scene -------------------------------------------------------------------------------------------------------- */
#define HEDDLE_NONE 0xffffffffu

/* Pixels, top row first, tightly packed. */
typedef struct heddle_image {
  uint32_t struct_size;
  uint32_t width, height, channels; /* 1 to 4 channels */
  const float* pixels;
} heddle_image;

#define HEDDLE_FILTER_NEAREST_MAGNIFIED 1u
#define HEDDLE_FILTER_NEAREST_MINIFIED 2u
#define HEDDLE_FILTER_NEAREST_LEVEL 4u /* of the mip chain */
#define HEDDLE_FILTER_FINEST_LEVEL 8u  /* no mip chain is used */
typedef struct heddle_texture {
  uint32_t struct_size;
  uint32_t width, height;
  uint32_t is_srgb;      /* 1: colour is encoded as sRGB */
  uint32_t wrap_u, wrap_v; /* 0 repeat, 1 mirror, 2 clamp */
  uint32_t filter;       /* HEDDLE_FILTER_*; 0: linear in all directions */
  const uint8_t* rgba;   /* width x height x 4, top row first; copied */
} heddle_texture;

typedef struct heddle_mesh {
  uint32_t struct_size;
  uint32_t vertex_count;
  uint32_t index_count;      /* triangles: a multiple of 3; 0: vertices in order */
  uint32_t reserved;
  const float* positions;    /* vertex_count x 3, metres; all arrays are copied */
  const float* normals;      /* x 3, or NULL: flat normals are made */
  const float* tangents;     /* x 4, or NULL: made from uv0 where a normal map needs them */
  const float* uv0;          /* x 2, or NULL */
  const float* uv1;          /* x 2, or NULL */
  const float* colors;       /* x 4, linear, or NULL */
  const uint32_t* indices;
  /* Faces with any number of corners, in place of triangles: `indices` then holds the corners of all, face after face,
   * counter-clockwise. They are drawn as fans of triangles around their first corners, so they should be convex and nearly
   * flat; what subdivides surfaces sees the faces. 0: triangles */
  uint32_t face_count;
  uint32_t crease_count;
  const uint32_t* face_sizes; /* face_count numbers of corners, 3 or more each */
  /* What a subdivided surface keeps sharp: crease_count edges as pairs of vertices, a vertex by itself as a pair of the
   * same, and how sharp each is: 0 smooth, n sharp for n levels, 10 and above for ever */
  const uint32_t* creases;
  const float* sharpness;
} heddle_mesh;

/* Material of the application: texture_layer and texture_group are ignored, `textures` are ids of textures. */
typedef struct heddle_material {
  uint32_t struct_size;
  uint32_t textures[HEDDLE_TEXTURE_COUNT]; /* HEDDLE_NONE: none */
  HeddleMaterial record;
} heddle_material;

/* Light of the application: the record's position_rel is ignored, `position` counts. */
typedef struct heddle_light {
  uint32_t struct_size;
  uint32_t reserved;
  double position[3];
  HeddleLight record;
} heddle_light;

typedef struct heddle_camera {
  uint32_t struct_size;
  uint32_t is_orthographic;
  double position[3];
  double rotation[4];      /* quaternion x y z w, unit; identity looks along -Z */
  double vertical_angle;   /* radians; orthographic: half height in metres */
  double aspect;           /* width / height; 0: the frame's */
  double near_distance;    /* metres; 0: 0.01, in a scene of less than 10 m a thousandth of its diagonal */
  double far_distance;     /* orthographic only; 0: beyond all of the scene */
} heddle_camera;

/* Light from infinitely far away, as an equirectangular image: -Z in its middle, +X to the right of that, +Y on top. */
typedef struct heddle_environment {
  uint32_t struct_size;
  uint32_t width, height;  /* 1 to 16384 */
  uint32_t channels;       /* 1 grey, 3, or 4, the fourth ignored */
  const float* pixels;     /* width x height x channels, top row first, linear Rec.709, 0 or above; copied */
  double scale;            /* cd/m^2 of 1; 0: 1 */
  double rotation[4];      /* quaternion x y z w, scene from image; all 0: none */
} heddle_environment;

/* An empty scene. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_create(heddle_host* host, heddle_scene** out);
/* NULL is ignored. [main-thread] */
HEDDLE_EXPORT void heddle_scene_destroy(heddle_scene* scene);
/* Adds everything in a glTF 2.0 file (.gltf, .glb), or applies a scene overlay (.toml). On an error the scene is as
 * before. A file's first animation is in use, and posed at the scene's time. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_load(heddle_scene* scene, const char* path);
#define HEDDLE_LOAD_TRUSTED 1u /* no limit, and files outside of the file's folder */
typedef struct heddle_load_options {
  uint32_t struct_size;
  uint32_t flags;        /* HEDDLE_LOAD_* */
  uint64_t memory_limit; /* bytes that loading may make, added up, which bounds its time too; 0: 4 GiB */
} heddle_load_options;
/* heddle_scene_load with limits of the caller's; without them a file is taken to come from a stranger. options may be
 * NULL. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_load_with(heddle_scene* scene, const char* path,
                                                   const heddle_load_options* options);
/* Each adds one thing and gives its id, counted from 0 by kind. Names may be NULL. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_add_texture(heddle_scene* scene, const char* name,
                                                     const heddle_texture* texture, uint32_t* out_id);
HEDDLE_EXPORT heddle_status heddle_scene_add_material(heddle_scene* scene, const char* name,
                                                      const heddle_material* material, uint32_t* out_id);
HEDDLE_EXPORT heddle_status heddle_scene_add_mesh(heddle_scene* scene, const char* name, const heddle_mesh* mesh,
                                                  uint32_t material, uint32_t* out_id);
/* A mesh placed by a 4x4 matrix, column-major float64, affine. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_add_instance(heddle_scene* scene, const char* name, uint32_t mesh,
                                                      const double scene_from_object[16], uint32_t* out_id);
HEDDLE_EXPORT heddle_status heddle_scene_add_light(heddle_scene* scene, const char* name, const heddle_light* light,
                                                   uint32_t* out_id);
HEDDLE_EXPORT heddle_status heddle_scene_add_camera(heddle_scene* scene, const char* name,
                                                    const heddle_camera* camera, uint32_t* out_id);
/* Moves an instance; where it was in the last frame is its previous place, however often it moves. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_set_instance(heddle_scene* scene, uint32_t id,
                                                      const double scene_from_object[16]);
/* Changes a light; it keeps its id and name. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_set_light(heddle_scene* scene, uint32_t id, const heddle_light* light);
/* An image that a light of type HEDDLE_LIGHT_RECTANGLE shines with: its radiance at a point is its intensity times the
 * texel there. Seen from the lit side, tangent points to the image's right and direction x tangent to its top. 1, 3 or 4
 * channels (the fourth is ignored), linear Rec.709, finite, 0 or above; copied. NULL: none. HEDDLE_BAD_INPUT names the
 * first texel that is wrong. The light keeps it through heddle_scene_set_light. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_set_light_texture(heddle_scene* scene, uint32_t id, const heddle_image* image);
/* Moves a camera. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_set_camera(heddle_scene* scene, uint32_t id, const heddle_camera* camera);
/* The scene's environment; NULL: none. Seen by graphs with a technique that reads it, sky/environment_map.
 * [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_set_environment(heddle_scene* scene, const heddle_environment* environment);
/* Puts a component on a thing of the scene (owner: HEDDLE_OWNER_* of components.h; id: its id, 0 for the scene), or
 * changes the properties of the one that it has. properties: a JSON object, {"priority": 2}; NULL: none. Roles declare
 * which components and properties there are (heddle_list); what nobody declares is HEDDLE_BAD_INPUT. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_set_component(heddle_scene* scene, uint32_t owner, uint32_t id,
                                                       const char* component, const char* properties);
/* Which camera renders; HEDDLE_NONE: one made to see the whole scene. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_use_camera(heddle_scene* scene, uint32_t id);
/* The camera in use, as it would render a frame of this shape. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_get_camera(heddle_scene* scene, uint32_t width, uint32_t height,
                                                    heddle_camera* out);
/* Counts, bounds, names of cameras, lights, materials and animations (with their durations), components, features, as JSON.
 * [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_describe(heddle_scene* scene, const char** out_json);
/* Files that were read for the scene, with those that they name, as a JSON array of paths. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_files(heddle_scene* scene, const char** out_json);

#define HEDDLE_ANIMATION_LOOP 1u /* after its end the animation begins again; else it holds its last pose */
/* Which animation of its file plays, counted over all loaded files in their order (describe lists them), with
 * HEDDLE_ANIMATION_*; other files keep theirs. HEDDLE_NONE: every file is at rest. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_use_animation(heddle_scene* scene, uint32_t id, uint32_t flags);
/* Poses what animations move (instances, skinned and morphed meshes, lights, cameras) at a time in seconds; heddle_render
 * does it too. An animation holds its first and last keys outside of them. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_set_time(heddle_scene* scene, double time);

/* All triangles of the scene in one list, as it is posed; for looking at, export and other programs. */
typedef struct heddle_triangles {
  uint32_t struct_size;
  uint32_t vertex_count, triangle_count;
  uint32_t reserved;
  double origin[3];          /* positions are relative to this scene point */
  const float* positions;    /* vertex_count x 3, metres */
  const float* normals;      /* vertex_count x 3, unit */
  const float* uvs;          /* vertex_count x 2, uv0 */
  const uint32_t* indices;   /* triangle_count x 3, counter-clockwise from the front */
  const uint32_t* materials; /* triangle_count, ids of materials */
} heddle_triangles;
/* The caller sets out->struct_size. The arrays are the scene's, valid until the next call or a change of the scene.
 * [main-thread] */
HEDDLE_EXPORT heddle_status heddle_scene_triangles(heddle_scene* scene, heddle_triangles* out);

/* ---- Graph -------------------------------------------------------------------------------------------------------- */
/* Reads a graph and applies settings "pass.technique=gtao", "pass.params.radius=1", "extent=[640,360]", "params.NAME=..."
 * in their order. Resolves, checks and orders; opens no plugin. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_load(heddle_host* host, const char* path, const char* const* settings,
                                              uint32_t setting_count, heddle_graph** out);
/* The same from text; `name` stands for the file in messages, `folder` is where `extends` looks. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_parse(heddle_host* host, const char* text, const char* name,
                                               const char* folder, const char* const* settings, uint32_t setting_count,
                                               heddle_graph** out);
/* The device is idle on return; plugins nobody else uses are unloaded. NULL is ignored. [main-thread] */
HEDDLE_EXPORT void heddle_graph_destroy(heddle_graph* graph);
/* What was decided and why: passes kept and dropped, order, resources, aliasing, barriers, memory; format "text", "json"
 * or "dot". Before the first frame: for a scene with every feature; this opens the device and the plugins, which alone
 * know how large things are. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_explain(heddle_graph* graph, const char* format, const char** out);
/* Why one pass runs or does not (who reads what it makes, down to the output; or what rules it out), why it stands where
 * it stands in the order, and where each of its settings comes from; format "text" or "json". Planned as for
 * heddle_graph_explain. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_explain_pass(heddle_graph* graph, const char* pass, const char* format,
                                                      const char** out);
/* What the graph says, without planning it: {"file", "kind": "frame" or "job", "extent", "output", "presets", "passes": [{"name", "role",
 * "technique", "is_left_out", "parameters", "inputs"}], "ports": [{"name", "type"}]} as JSON. Opens no device and no
 * plugin. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_describe(heddle_graph* graph, const char** out_json);
/* Ports that stay readable after a frame, "ao.visibility", beside the graph's own output. Before the first frame, or
 * the graph is planned again. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_keep(heddle_graph* graph, const char* port);
/* Changes anything between frames, as settings of heddle_graph_load do: "ao.params.radius=1.5", "ao.technique=gtao".
 * Passes that the change does not touch go on: their objects, pipelines and all that they kept between frames. On an
 * error the graph is as it was, its last frame included. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_set(heddle_graph* graph, const char* setting);
/* Reads again what changed on disk since: the graph's files, roles, manifests, libraries and shaders. Settings hold. What
 * did not change goes on, and on an error everything does, as in heddle_graph_set. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_reload(heddle_graph* graph);
/* Files that heddle_graph_reload would read, as a JSON array of paths. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_files(heddle_graph* graph, const char** out_json);

/* What a setting of that key says now, as JSON: "extent", "params.exposure", "ao.technique", "ao.params.radius" (its default
 * if nobody said otherwise), "ao.inputs.depth" (what it is bound to), "ao" (all of a pass); NULL: everything.
 * [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_get(heddle_graph* graph, const char* key, const char** out_json);

#define HEDDLE_RENDER_PROFILE 1u /* submit and wait pass by pass, and time each: slower, for looking */
#define HEDDLE_RENDER_ANEW 2u    /* render even what is complete and unchanged: for measuring. PROFILE does so too */
typedef struct heddle_render_options {
  uint32_t struct_size;
  uint32_t flags; /* HEDDLE_RENDER_* */
  double time, time_step;
  uint64_t seed;
  uint32_t cut; /* 1: forget the past */
  uint32_t reserved;
} heddle_render_options;

/* Renders one frame and waits for it (but see HEDDLE_HOST_LIVE); what moved since the last frame has then arrived. The scene is posed at the
 * options' time first; options may be NULL: no options, and the scene as it is posed. After a cut, and in
 * a graph's first frame, nothing has moved. A graph with loops, such as progressive supersampling, that are complete
 * submits nothing while nothing changes. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_render(heddle_graph* graph, heddle_scene* scene,
                                          const heddle_render_options* options);
/* Renders `frames` frames from the first on, again and again: in every order of stages that declared accesses allow (each
 * pair that nothing puts in order is seen both ways), with all memory that nobody wrote filled with two patterns,
 * without culling, and with what each stage appends to a list in two orders. A frame in which a list has no room is not
 * compared, and the next one is a cut; if each has one, it is HEDDLE_BAD_INPUT. Loops begin anew in every other frame, and go on, where they do, in those between.
 * Bytes of the output and of kept ports must agree; what differs depends on something undeclared and is HEDDLE_BUG, as
 * is everything that HEDDLE_HOST_CHECK finds, which the host must have. Says as JSON what was done: {"frames", "runs",
 * "orders", "unordered_pairs", "seen_both_ways", "poisons", "compared", "lists", "overflowed": frames that were not
 * compared}. A job runs once in each, without the cache; its artifacts and reports must agree. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_graph_check(heddle_graph* graph, heddle_scene* scene,
                                               const heddle_render_options* options, uint32_t frames,
                                               const char** out_json);
/* Renders one frame, as heddle_render does, and says what every image port held at some pixels of the frame (x, y from the
 * top left; 2 * pixel_count numbers): each version where a stage finished it, in the order of execution, kept or not. Ports
 * of another resolution show the texel under the pixel's centre; ports with an extent of their own (shadow maps) are named
 * without values; sRGB formats as stored. format "text", or "json": {"extent", "frame", "pixels": [{"pixel": [x, y],
 * "ports": [{"name", "pass", "port", "technique", "place", "stage", "format", "extent", "unit", "encoding", "changes",
 * "texel", "layers": [{"values", "problems": [{"channel", "problem"}]}]}]}]}; what JSON lacks is "nan", "inf", "-inf".
 * [main-thread] */
HEDDLE_EXPORT heddle_status heddle_inspect(heddle_graph* graph, heddle_scene* scene,
                                           const heddle_render_options* options, const uint32_t* pixels,
                                           uint32_t pixel_count, const char* format, const char** out);
/* Pixels of a kept port or of the output (NULL) after a frame, as float32 (unorm as 0..1), layer and mip chosen.
 * out->pixels belongs to the graph. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_read(heddle_graph* graph, const char* port, uint32_t layer, uint32_t mip,
                                        heddle_image* out);
/* The same into the caller's memory: `capacity` floats at `pixels`, of which width x height x channels are written, straight
 * from memory that the device shares. pixels NULL: only the shape, nothing is copied. out->pixels is `pixels`.
 * HEDDLE_BAD_INPUT, and a message with both numbers, if the capacity is too small. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_read_into(heddle_graph* graph, const char* port, uint32_t layer, uint32_t mip,
                                             float* pixels, uint64_t capacity, heddle_image* out);
/* Texels as the device has them, top row first, tightly packed. */
typedef struct heddle_texels {
  uint32_t struct_size;
  uint32_t width, height;
  uint32_t format;      /* VkFormat, by its number: 37 is VK_FORMAT_R8G8B8A8_UNORM */
  uint32_t texel_bytes; /* of one; 0: blocks of 4 x 4 texels */
  uint32_t reserved;
  uint64_t size; /* of all, in bytes */
  void* bytes;
} heddle_texels;
/* As heddle_read_into, but nothing is converted: `capacity` bytes at `bytes`, of which out->size are written; bytes NULL:
 * only the shape. For who shows a picture of 8 bits and would turn float32 back into them. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_read_texels(heddle_graph* graph, const char* port, uint32_t layer, uint32_t mip,
                                               void* bytes, uint64_t capacity, heddle_texels* out);
/* Of the last frame: wall time, pass times if profiled, counters of commands and pipelines, instances drawn and culled,
 * capacity, count and overflow of lists, memory with and without aliasing, libraries opened. "late": {"mode": "repeatable"
 * or "live", "waits": how often the host waited for the GPU, "reads": copies that stages with latency read, "stale": those
 * of them that were older than they should be, "total": the same since the graph was loaded}. "artifacts": of each stage that
 * is cached, where what it made last came from, since the graph was loaded: {"pass", "stage", "origin": "made" or "cache", "key",
 * "file" ("" if it could not be kept), "bytes"}; and of each artifact of a job that an input names, {"job": "links.toml",
 * "pass", "port", ...}. JSON. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_stats(heddle_graph* graph, const char** out_json);

/* ---- Jobs --------------------------------------------------------------------------------------------------------- */
/* Runs a graph that says kind = "job": makes what its passes leave, their artifacts and reports, unless the cache holds it
 * already. The scene is posed at the options' time; options may be NULL. Nothing is written half: a run that is cancelled,
 * or killed, leaves what was complete, and stages that can go on do so in the next run. Says as JSON what there is now:
 * {"wall_ms", "errors": rows of level error, "artifacts": [{"name": "bake.links", "origin": "made" or "cache", "key", "file" ("" if it
 * could not be kept), "bytes"}], "reports": [{"name", "origin", "key", "file", "rows": [{"level": "error", "warning" or
 * "info", "message", "values": {"vertex": 12}}]}]}; numbers that JSON lacks are "nan", "inf", "-inf". [main-thread] */
HEDDLE_EXPORT heddle_status heddle_job_run(heddle_graph* job, heddle_scene* scene, const heddle_render_options* options,
                                           const char** out_json);
/* Bytes of an artifact that the last run made or found; NULL: of the job's output, else of its only artifact. They belong to
 * the job until it runs again. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_job_artifact(heddle_graph* job, const char* artifact, const void** out,
                                                uint64_t* out_bytes);

/* ---- Images ------------------------------------------------------------------------------------------------------- */
/* Any format OpenImageIO reads or writes; float values of 8-bit files are 0..1 as stored. The file is written under a
 * temporary name and renamed. OpenImageIO is opened by the first call. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_image_read(heddle_host* host, const char* path, heddle_image* out);
HEDDLE_EXPORT heddle_status heddle_image_write(heddle_host* host, const char* path, const heddle_image* image);
/* Metrics of a against b (the reference) as JSON: {"mse", "rmse", "relmse", "psnr", "maximum", "mean_difference", ...}.
 * If difference_path is not NULL, writes |a - b| there. Non-finite values are an error that names the first pixel.
 * [main-thread] */
HEDDLE_EXPORT heddle_status heddle_image_compare(heddle_host* host, const heddle_image* a, const heddle_image* b,
                                                 const char* difference_path, const char** out_json);

/* ---- Comparing images ---------------------------------------------------------------------------------------------- */
/* Metrics of an image a against a reference b. Images are read where they are, nothing is copied. No host is needed, nor is
 * any library opened; a failed call's message is heddle_error(NULL) on the same thread. */
typedef struct heddle_comparison heddle_comparison;

/* [{"name", "formula", "better": "lower" or "higher", "map": what a pixel of its error image is}] as JSON; static data.
 * "percentile_P" stands for any number, as in percentile_99.9. [any-thread] */
HEDDLE_EXPORT const char* heddle_metrics(void);

#define HEDDLE_COMPARE_MAPS 1u /* keep each metric's error image, for heddle_comparison_map */
#define HEDDLE_TONE_MAPPER_ACES 0u
#define HEDDLE_TONE_MAPPER_HABLE 1u
#define HEDDLE_TONE_MAPPER_REINHARD 2u
typedef struct heddle_compare_options {
  uint32_t struct_size;
  uint32_t flags;           /* HEDDLE_COMPARE_* */
  const char* metrics;      /* names, separated by ','; NULL or "": all but flip and hdr_flip, which must be told how values
                             * are encoded: "flip" takes them as encoded in sRGB, 0 to 1; "hdr_flip" as linear radiance */
  double pixels_per_degree; /* of both FLIPs; 0: 67.02, a display 0.7 m and 3840 pixels wide that is seen from 0.7 m */
  double start_exposure;    /* of hdr_flip, in stops: values are multiplied by 2^exposure ... */
  double stop_exposure;
  uint32_t exposure_count;  /* ... evenly from start to stop; 0: all three from the reference (Andersson et al. 2021). Fix
                             * them wherever several comparisons are to be comparable */
  uint32_t tone_mapper;     /* of hdr_flip: HEDDLE_TONE_MAPPER_* */
  uint32_t threads;         /* 0: one for each processor. No bit of a result depends on it */
  uint32_t reserved;
} heddle_compare_options;

/* options may be NULL. HEDDLE_BAD_INPUT, and *out NULL, if shapes differ, a value is not finite (the message names the
 * first such pixel), or a metric is unknown or does not fit the images. [any-thread] */
HEDDLE_EXPORT heddle_status heddle_compare(const heddle_image* a, const heddle_image* b,
                                           const heddle_compare_options* options, heddle_comparison** out);
/* NULL is ignored. [any-thread] */
HEDDLE_EXPORT void heddle_comparison_destroy(heddle_comparison* comparison);
/* {"width", "height", "channels", "metrics": {NAME: {"value": null if infinite (psnr of equal images), "formula", "better",
 * and what it was measured with: "pixels_per_degree", "start_exposure", "stop_exposure", "exposures", "tone_mapper"; of
 * maximum "pixel", "channel"}}} as JSON, the comparison's. [any-thread] */
HEDDLE_EXPORT const char* heddle_comparison_describe(const heddle_comparison* comparison);
/* The error image of one of the metrics asked for, with HEDDLE_COMPARE_MAPS; out->pixels is the comparison's. Of as many
 * channels as the images, or of one (ssim, flip, hdr_flip). [any-thread] */
HEDDLE_EXPORT heddle_status heddle_comparison_map(const heddle_comparison* comparison, const char* metric,
                                                  heddle_image* out);
/* Writes an error image: as it is into .exr, .hdr and .pfm; else in false colours from black (0) to white (`white`).
 * [main-thread] */
HEDDLE_EXPORT heddle_status heddle_write_error_image(heddle_host* host, const char* path, const heddle_image* map,
                                                     double white);

HEDDLE_END_C
#endif
