/* SPDX-License-Identifier: Apache-2.0 */
/* What a technique's library exports, and what the host gives it.
 *
 * A library exports one symbol, heddle_entry. It returns static descriptors; the build writes a manifest from them, so
 * the host resolves graphs without opening a library, and a manifest that disagrees with its library is an error.
 *
 * Life of a pass: create -> declare -> prepare -> each frame: execute / record of its stages, in the order of the graph
 * -> destroy. After a parameter with HEDDLE_PARAMETER_REDECLARE changed, and after request_redeclare: declare and
 * prepare again.
 *
 * Shaders are text. The host writes, for every shader, the include "pass.glsl" with exactly what its stage declares:
 * the ports (bindings chosen by the host), the parameters, and accessors; plugins never choose a binding. See "Shaders"
 * below. Functions of roles ("role/shadow.glsl") are joined in by the host from the providers of the graph. */
#ifndef HEDDLE_PLUGIN_H
#define HEDDLE_PLUGIN_H

#include <heddle/abi.h>
#include <heddle/records.h>
#include <heddle/vulkan_table.h>

HEDDLE_BEGIN_C

typedef struct heddle_pass heddle_pass;         /* the plugin's object for one pass; the plugin's own definition */
typedef struct heddle_pass_host heddle_pass_host; /* the host's side of that pass; alive from create until destroy */
typedef struct heddle_frame heddle_frame;       /* the host's; valid during one record or execute call */

/* ---- Ports -------------------------------------------------------------------------------------------------------- */
#define HEDDLE_PORT_IMAGE 0u    /* a 2D image or 2D array, mips allowed */
#define HEDDLE_PORT_BUFFER 1u   /* a storage buffer */
#define HEDDLE_PORT_VALUE 2u    /* small data known on the CPU before the frame is recorded, also visible to shaders */
#define HEDDLE_PORT_SURFACES 3u /* triangles to draw */
/* Bytes for the CPU, any number of them, that a job makes and the host keeps on disk ("Jobs" below). Stages declare it as
 * VALUE and use it through value and set_value. An input is there before the pass is declared: in declare and prepare too,
 * where its shape says the byte_size; with other bytes the pass is another one, created anew. */
#define HEDDLE_PORT_ARTIFACT 4u
#define HEDDLE_PORT_REPORT 5u /* out: what a job has found, in rows (add_row); declared as VALUE. Kept as artifacts are */

#define HEDDLE_IN 0u
#define HEDDLE_OUT 1u
#define HEDDLE_INOUT 2u /* makes a new version of what it is bound to */

#define HEDDLE_PORT_OPTIONAL 1u /* in: unbound is legal; shaders then see the role's neutral value through fetch_NAME */
#define HEDDLE_PORT_KEPT 2u     /* out: keeps its contents between frames, never aliased */
#define HEDDLE_PORT_CUBE 4u     /* image: layers come in sixes, also sampled as cubes */
/* out, kept: every frame in which its stages run writes all of it. Keeping its history then costs a second memory, which
 * takes turns with the first, and no copy. */
#define HEDDLE_PORT_REWRITTEN 8u
/* buffer: a list that shaders append to (HEDDLE_ACCESS_APPEND) and read as count and elements. `glsl` is one array
 * without length, "uvec4 tiles[];". The host empties the list before the first stage of a frame (in a loop: of an
 * iteration) that touches it; if it is HEDDLE_PORT_KEPT without HEDDLE_PORT_REWRITTEN, only after a cut or where a stage
 * of its maker, being that first one, answers HEDDLE_NOTHING. Elements beyond the capacity are left out and counted.
 * What one stage appends follows what earlier ones did, and has no order itself, nor has which of it is left out. No CUBE */
#define HEDDLE_PORT_LIST 16u

/* Extent of an out image. */
#define HEDDLE_EXTENT_FRAME 0u    /* the graph's extent times extent_scale, rounded up; jobs need not have one */
#define HEDDLE_EXTENT_ABSOLUTE 1u /* width, height */

typedef struct heddle_port {
  uint32_t struct_size;
  const char* name; /* of the role's contract, or the technique's own (then only its own functions and stages use it) */
  uint32_t type;      /* HEDDLE_PORT_* */
  uint32_t direction; /* HEDDLE_IN ... */
  uint32_t flags;     /* HEDDLE_PORT_OPTIONAL ... */
  uint32_t format;    /* image, out: VkFormat; in: 0 */
  uint32_t extent_rule;
  float extent_scale;     /* 0 = 1 */
  uint32_t width, height; /* HEDDLE_EXTENT_ABSOLUTE */
  uint32_t layers, mips;  /* 0 = 1 */
  uint64_t byte_size;     /* buffer or value, out: capacity */
  const char* glsl;       /* buffer, value: members of the block as shaders see them, e.g. "HeddleLight lights[];"; NULL:
                             what the role's contract says. Types of records.h are in scope */
  const char* help;       /* one line: meaning, unit, range */
  /* in: unless the graph binds it, last frame's version of this output of the same technique, which is kept. What any
     input reads of the past is neutral (buffers: zero bytes; values: empty, zeros in shaders) in the first frame and
     after a cut. NULL: nothing */
  const char* previous_of;
  /* list that the pass makes: elements that it holds, 0 is legal; and bytes of one, as std430 lays them out in the array:
     a multiple of 4. byte_size is 0 */
  uint32_t capacity, element_bytes;
  /* surfaces, out or inout: the technique's own out buffers that its batches lie in (heddle_batch). HeddleVertex[]; uint[];
     where it places its batches itself also HeddleInstance[] and, as an array or a list, VkDrawIndexedIndirectCommand[].
     NULL: it has none; vertices NULL: they are what its function of role surface_program answers */
  const char* vertices;
  const char* indices;
  const char* instances;
  const char* commands;
} heddle_port;

/* ---- Parameters --------------------------------------------------------------------------------------------------- */
#define HEDDLE_TYPE_FLOAT 0u
#define HEDDLE_TYPE_INT 1u
#define HEDDLE_TYPE_BOOL 2u
#define HEDDLE_TYPE_CHOICE 3u /* one of `choices`; shaders see its index */
#define HEDDLE_TYPE_COLOR 4u  /* three floats, linear Rec.709 */
#define HEDDLE_TYPE_FLOAT3 5u
#define HEDDLE_TYPE_NAMES 6u  /* a list of names (of lights, ...); not visible to shaders */
#define HEDDLE_TYPE_TEXT 7u   /* a line of text, "" by default; not visible to shaders */

#define HEDDLE_PARAMETER_KNOB 1u      /* buys accuracy with time: `ladder` goes from cheap to accurate */
#define HEDDLE_PARAMETER_REDECLARE 2u /* a change needs declare and prepare again */
#define HEDDLE_PARAMETER_CONSTANT 4u  /* shaders see it as a compile-time constant (specialization constant) */

typedef struct heddle_parameter {
  uint32_t struct_size;
  const char* name;
  uint32_t type; /* HEDDLE_TYPE_* */
  uint32_t flags;
  const char* unit; /* "m", "s", "rad", "lx", "cd/m^2", "px", "1" */
  double minimum, maximum; /* each component; equal bounds: unbounded */
  double default_value[3]; /* bool 0/1; choice: index; names: empty */
  const char* const* choices; /* NULL-terminated, HEDDLE_TYPE_CHOICE only */
  const double* ladder;
  uint32_t ladder_count;
  const char* help; /* one line */
} heddle_parameter;

/* ---- Stages and shaders --------------------------------------------------------------------------------------------*/
#define HEDDLE_STAGE_GPU 0u
#define HEDDLE_STAGE_CPU 1u

/* How a stage touches a port. The host makes barriers from these, compares them with what the shaders really use, and
 * writes each shader's bindings from them. */
#define HEDDLE_ACCESS_SAMPLED 0u       /* image: sampler2D NAME (sampler2DArray if layers > 1), nearest unless _LINEAR */
#define HEDDLE_ACCESS_SAMPLED_LINEAR 1u
#define HEDDLE_ACCESS_STORAGE_READ 2u  /* image: readonly image2D; buffer: readonly block */
#define HEDDLE_ACCESS_STORAGE_WRITE 3u /* image: writeonly image2D; buffer: block */
#define HEDDLE_ACCESS_STORAGE_READ_WRITE 4u
#define HEDDLE_ACCESS_COLOR 5u         /* colour attachment; order in the stage = location */
#define HEDDLE_ACCESS_DEPTH 6u         /* depth attachment, tested and written */
#define HEDDLE_ACCESS_DEPTH_READ 7u    /* depth attachment, tested only */
#define HEDDLE_ACCESS_VALUE 8u         /* value: uniform or readonly block for shaders; host value for the CPU */
#define HEDDLE_ACCESS_DRAW 9u          /* surfaces drawn */
#define HEDDLE_ACCESS_HOST_READ 10u    /* cpu stage: mapped for reading (surfaces: as a snapshot) */
#define HEDDLE_ACCESS_HOST_WRITE 11u   /* cpu stage: mapped for writing */
#define HEDDLE_ACCESS_TRANSFER_READ 12u
#define HEDDLE_ACCESS_TRANSFER_WRITE 13u
#define HEDDLE_ACCESS_SAMPLED_COMPARE 14u /* depth image: sampler2DShadow / sampler2DArrayShadow, linear, GREATER_OR_EQUAL */
#define HEDDLE_ACCESS_APPEND 15u          /* list: bool append_NAME(element), and nothing else in the same stage */
#define HEDDLE_ACCESS_BATCHES 16u         /* surfaces, out or inout: the one stage, gpu or cpu, that calls set_batches */

#define HEDDLE_LOAD_KEEP 0u
#define HEDDLE_LOAD_CLEAR 1u
#define HEDDLE_LOAD_DONT_CARE 2u
#define HEDDLE_LOAD_CLEAR_NEW 3u /* an optional inout port: clear if nobody made it above, else keep what is there */

/* How colours that a stage draws meet those in a colour attachment: each attachment has its own. */
#define HEDDLE_BLEND_NONE 0u     /* they take their place */
#define HEDDLE_BLEND_OVER 1u     /* new + (1 - new.a) old: premultiplied colour over what is behind */
#define HEDDLE_BLEND_ADD 2u      /* new + old */
#define HEDDLE_BLEND_MULTIPLY 3u /* new * old */
#define HEDDLE_BLEND_TINT 4u     /* new + NAME_tint old, a second output of the shader; a stage's only colour attachment.
                                    Needs the Vulkan feature dualSrcBlend */
#define HEDDLE_BLEND_CONSTANT 5u /* c new + (1 - c) old, c for each channel from set_blend_constant */

typedef struct heddle_access {
  uint32_t struct_size;
  const char* port;
  uint32_t access;
  uint32_t load;  /* attachments: HEDDLE_LOAD_* at the stage's first drawing into each layer */
  float clear[4]; /* depth: [0] */
  uint32_t blend; /* HEDDLE_ACCESS_COLOR: HEDDLE_BLEND_* */
  uint32_t reserved;
} heddle_access;

#define HEDDLE_SHADER_COMPUTE 0u
#define HEDDLE_SHADER_FULLSCREEN 1u /* a fragment shader over the whole target: `in vec2 uv` (0..1, y down) */
#define HEDDLE_SHADER_SURFACES 2u   /* a fragment shader behind every surface program; sees the block `surface`. With an
                                       empty file name: depth only, alpha masks tested by the host's own fragment shader */

typedef struct heddle_shader {
  uint32_t struct_size;
  const char* name;  /* unique in the technique */
  uint32_t kind;     /* HEDDLE_SHADER_* */
  const char* stage; /* the stage that uses it */
  const char* file;  /* in the technique's folder: <what>.comp.glsl or <what>.frag.glsl */
  const char* calls; /* roles whose functions it calls, separated by spaces: "shadow surface_material" */
  uint32_t depth_compare; /* VkCompareOp for raster kinds with a depth attachment; 0 = GREATER_OR_EQUAL (reversed) */
  float depth_bias_constant, depth_bias_slope; /* raster kinds; towards the light when negative (reversed depth) */
} heddle_shader;

typedef struct heddle_stage {
  uint32_t struct_size;
  const char* name;
  uint32_t kind; /* HEDDLE_STAGE_* */
  uint32_t access_count;
  const heddle_access* accesses;
  /* cpu: images and buffers that it declares as HOST_READ are what they were this many frames ago, when its commands are
   * long done: nothing waits, and no cycle is closed. Frame n is seen in frame n + latency exactly; heddle_mapped says
   * which one it is. Values and surfaces are this frame's. 0: all is this frame's, and the GPU is waited for */
  uint32_t latency;
  uint32_t loop_part; /* HEDDLE_LOOP_*; only techniques with a heddle_loop */
  /* cpu: what the stage writes is an artifact, which the host keeps on disk: execute is not called where the same was
   * made before, by whichever process. It is the same where the library's file, the stage, the contents and shapes of the
   * ports that it declares, and these parameters, separated by spaces, are the same ("": no parameter matters). In execute
   * all else is HEDDLE_BUG to ask for: other parameters and ports, components, files, services of functions; frame, time,
   * seed and origins are 0, `cut` is 1, `environment` is unturned, of scale 1 and revision 0. It leaves nothing behind but
   * its outputs: HOST_WRITE of out ports, whose bytes are 0 before, and out values. No surfaces, no latency, no loop_part.
   * With HEDDLE_HOST_CHECK it is always called. NULL: not cached */
  const char* cached_by;
  /* "PARAMETER=CHOICE": the stage is there only while that parameter, of HEDDLE_TYPE_CHOICE with
   * HEDDLE_PARAMETER_REDECLARE, is that. Else it is not scheduled: nothing of it is compiled, recorded or waited for. Stages
   * keep their numbers. NULL: always */
  const char* only_if;
} heddle_stage;
#define HEDDLE_MOST_LATENCY 16u
#define HEDDLE_LOOP_OUTSIDE 0u /* once a frame: before the iterations if it stands before their stages, else after */
#define HEDDLE_LOOP_BEFORE 1u  /* in each iteration, before the body: sets what is overridden */
#define HEDDLE_LOOP_AFTER 2u   /* in each iteration, after the body: gathers. Its outputs are HEDDLE_PORT_KEPT */

/* ---- Loops ---------------------------------------------------------------------------------------------------------
 * A technique that repeats other passes: for samples of a camera, layers, views, objects. Its body is found by the host:
 * every pass between the values that it overrides and the inputs that it gathers, and nothing else. In each iteration
 * its BEFORE stages set the overriding values, the body runs, its AFTER stages gather. Each iteration is a submission of
 * its own, so a value may differ from one to the next.
 * In the body, what a pass keeps in place from one iteration to the next is refused; histories stand still; stages with
 * latency run in the first iteration only. A loop within a loop is refused. */
typedef struct heddle_override {
  uint32_t struct_size;
  uint32_t reserved;
  const char* input;  /* in, value: passes of the body that are bound to the same one ... */
  const char* output; /* out, value: ... read this one instead */
} heddle_override;

typedef struct heddle_loop {
  uint32_t struct_size;
  uint32_t override_count;
  const heddle_override* overrides;
  const char* gathers; /* in or inout, images or buffers, separated by spaces: what the body makes for the AFTER stages */
} heddle_loop;

/* The iterations of one frame: `first` to first + count - 1 of `total`. A loop may do all in a frame, or go on in the
 * frames that follow while heddle_frame_info says is_still. Where the loops of a graph answer 0 in a still frame, there
 * is nothing to do, and the host submits nothing. */
typedef struct heddle_iterations {
  uint32_t struct_size;
  uint32_t first, count, total;
} heddle_iterations;

/* A function of a role, provided as text. The text may use the ports listed (declared for it under their names), the
 * technique's parameters as `params.NAME`, the includes of plugins/shared and functions of roles in `calls`. File-scope
 * names are the text's own: the host renames them where two providers clash. No #version, #extension or layout(). */
typedef struct heddle_function {
  uint32_t struct_size;
  const char* role;
  const char* file;
  uint32_t access_count;
  const heddle_access* accesses; /* SAMPLED*, STORAGE_*, VALUE, APPEND */
  const char* calls;
  const void* service; /* CPU twin, float64: the role's own C table (heddle/services.h), or NULL */
} heddle_function;

/* ---- The host's side of a pass -------------------------------------------------------------------------------------*/
#define HEDDLE_SEVERITY_ERROR 0u
#define HEDDLE_SEVERITY_WARNING 1u
#define HEDDLE_SEVERITY_INFO 2u

/* A resource's shape. */
typedef struct heddle_shape {
  uint32_t struct_size;
  uint32_t type; /* HEDDLE_PORT_* */
  uint32_t format, width, height, layers, mips;
  uint64_t byte_size; /* list: of its memory, 16 bytes and the elements that it can hold; `width` is their number */
  uint32_t is_bound; /* 0: the optional input is absent; of an inout port: nobody made it above, this pass does */
} heddle_shape;

typedef struct heddle_frame_info {
  uint32_t struct_size;
  uint32_t cut; /* 1: nothing of the past is valid (first frame, camera cut) */
  uint64_t index;
  double time, time_step; /* seconds of scene time */
  uint64_t seed;
  double origin[3]; /* the frame's origin in the scene, metres: the main camera's position */
  double previous_origin[3]; /* last frame's, to which its positions are relative; after a cut: this frame's */
  uint32_t is_still; /* 1: scene, camera, lights, time, seed and all parameters are last frame's, and it was no cut */
  uint32_t iteration, iteration_count; /* of the loop in whose body the stage runs; count 0: in none */
  uint32_t slice; /* record and execute: how often the stage has answered HEDDLE_MORE before, in earlier processes too */
} heddle_frame_info;

/* Memory of a port during execute (cpu stages). Rows are tightly packed, layer by layer, and all layers mip by mip, the
 * finest first. */
typedef struct heddle_mapped {
  uint32_t struct_size;
  void* data; /* readable and/or writable as the stage declared; valid until execute returns */
  heddle_shape shape;
  uint64_t row_bytes; /* of mip 0 */
  uint64_t frame; /* index of the frame that made the contents; HEDDLE_NO_FRAME: a stage with latency, too early after the
                     first frame or a cut: all bytes are 0 */
  uint32_t count, overflow; /* list: elements at `data`, and how many more were appended and left out */
} heddle_mapped;
#define HEDDLE_NO_FRAME 0xffffffffffffffffull

/* What a frame appended to a list. */
typedef struct heddle_list_count {
  uint32_t struct_size;
  uint32_t capacity;
  const char* port; /* the host's, valid until the call returns */
  uint64_t frame;   /* index of the frame */
  uint32_t count;   /* elements that the list holds */
  uint32_t overflow; /* elements that were left out; of a list in a loop: the most of the frame's iterations */
} heddle_list_count;

/* Contents that outlast frames, where they were and where they will be. Shapes and names are the host's, valid until the
 * call returns. */
typedef struct heddle_migration {
  uint32_t struct_size;
  uint32_t is_history; /* 1: last frame's version of the port */
  const char* port;    /* out, HEDDLE_PORT_KEPT */
  const heddle_shape* old_shape;
  const heddle_shape* new_shape;
  VkCommandBuffer commands; /* outside of rendering */
  /* An image is to be read in TRANSFER_SRC_OPTIMAL, and to be written in TRANSFER_DST_OPTIMAL; both are left there. What
   * is not written stays neutral. VK_NULL_HANDLE where the port is of the other type. */
  VkImage old_image, new_image;
  VkBuffer old_buffer, new_buffer;
} heddle_migration;

/* The triangles of a surfaces port in host memory, one list, object transforms applied in float64. Owned by the host,
 * valid until the pass's execute returns; the same `revision` means the same bytes as last time. */
typedef struct heddle_snapshot {
  uint32_t struct_size;
  uint32_t vertex_count, triangle_count;
  double origin[3];          /* positions are relative to this scene point, fixed while revision is */
  uint64_t revision;
  const float* positions;    /* vertex_count x 3 */
  const float* normals;      /* vertex_count x 3, unit */
  const float* uvs;          /* vertex_count x 2, uv0 */
  const uint32_t* indices;   /* triangle_count x 3 */
  const uint32_t* materials; /* triangle_count, index into the scene's materials */
  const uint32_t* flags;     /* triangle_count, HEDDLE_SURFACE_* */
} heddle_snapshot;

/* ---- Jobs ----------------------------------------------------------------------------------------------------------
 * A graph of kind "job" bakes, encodes or inspects: its stages run once, frame 0 after a cut. It has no camera, and no
 * extent unless it says one. Techniques with outputs of type ARTIFACT or REPORT run in jobs alone.
 *
 * Their passes do not run where the same was made before, by whichever process. It is the same where these are: the
 * library's file, the shaders' texts, all parameters, the files that parameters of type TEXT and NAMES name, what is bound
 * to the inputs (of the scene: its contents; of other passes: the same of these), providers of functions, components that
 * the technique names, extent, time and seed; with gpu stages also device and driver. Where neither surfaces nor lights
 * are bound, the frame's origin is 0. resolve_path is for files that a parameter names. Other passes see nothing but such a
 * pass's artifacts.
 *
 * Slices. record or execute answers HEDDLE_MORE and is called again, until it answers something else; in between, the
 * device is idle, the application may stop the job, and nothing is written half. The ports stay mapped and hold what they
 * held. With load_state and save_state a job that was stopped goes on at the slice that it came to. */
typedef struct heddle_report_value {
  uint32_t struct_size;
  uint32_t reserved;
  const char* name; /* "vertex", "area" */
  double number;
  const char* text; /* the value, in place of `number`; NULL: the number */
} heddle_report_value;

typedef struct heddle_report_row {
  uint32_t struct_size;
  uint32_t level;      /* HEDDLE_SEVERITY_*; an error makes the job's exit status 1 */
  const char* message; /* one sentence without full stop */
  const heddle_report_value* values;
  uint32_t value_count;
  uint32_t reserved;
} heddle_report_row;

/* Answers for base colour's alpha at a triangle's point, for alpha-masked surfaces in CPU ray tracers:
 * 1 = there is surface, 0 = a hole. [any-thread] */
typedef uint32_t (*heddle_alpha_test)(const heddle_snapshot* snapshot, uint32_t triangle, float barycentric_u,
                                      float barycentric_v);

#define HEDDLE_ORDER_STATE 0u         /* merged into as few draws as possible: opaque, masked, blended */
#define HEDDLE_ORDER_BACK_TO_FRONT 1u /* instances, by the depth of their bounds' centre along the view axis, in float64;
                                         equal ones in the scene's order */
#define HEDDLE_ORDER_TRIANGLES_BACK_TO_FRONT 2u /* the same, and within each instance its triangles by their centroids */

#define HEDDLE_CULL_DEFAULT 0u  /* CULL_MATERIAL; depth-only shaders: nothing, so that what is open still casts */
#define HEDDLE_CULL_MATERIAL 1u /* backs of surfaces that are not double-sided */

/* One drawing of a surfaces port, from one view into one part of the stage's attachments; what is out of view is culled. */
typedef struct heddle_draw {
  uint32_t struct_size;
  const char* shader; /* of kind HEDDLE_SHADER_SURFACES */
  const char* surfaces; /* port */
  const HeddleView* view; /* copied; NULL: the frame's camera (port `camera`) */
  uint32_t include; /* HEDDLE_SURFACE_*: batches with any of these; 0 = all */
  uint32_t require; /* ... and all of these */
  uint32_t layer;   /* of every attachment */
  uint32_t x, y, width, height; /* pixels; width 0: the whole attachment */
  const void* push;    /* at most 64 bytes, `push` in the shader; NULL: none */
  uint32_t push_bytes;
  uint32_t order; /* HEDDLE_ORDER_* */
  uint32_t cull;  /* HEDDLE_CULL_* */
} heddle_draw;

/* Triangles of one material in the buffers of a surfaces port that a technique makes: `vertices` holds HeddleVertex,
 * `indices` numbers of vertices, three a triangle, counter-clockwise from the front. A port without `vertices` has a
 * surface program: the technique's function of role surface_program, which vertex stages ask for each vertex by its
 * number. They are drawn as the scene's are, by all that draw, and are in snapshots. Which of the port's stages writes what of the buffers is the graph's business:
 * whoever draws waits for all of them.
 *
 * Either the scene places the batch: it is drawn where `placed` of its instances are, in the place of their own meshes,
 * which are gone from an inout port (a batch without indices just takes them away). The host makes their HeddleInstance,
 * leaves out what is out of view, and sorts blended ones by depth, not their triangles.
 * Or the technique does (placed 0): `commands`, from first_command on, draw what `instances` says; counts stay on the
 * GPU. Every command draws with the flags and textures of this batch. Nothing is left out or sorted: with an order by
 * depth they come before all others. Of a list of commands the first command_count are drawn, as far as it holds any
 * (first_command 0). */
typedef struct heddle_batch {
  uint32_t struct_size;
  uint32_t material; /* id, as HeddleMaterial::id: textures, and HEDDLE_SURFACE_* of the draws */
  uint32_t first_index, index_count;
  int32_t vertex_offset;    /* added to each index */
  uint32_t previous_vertex; /* placed by the scene: as in HeddleInstance */
  float bounds[6];          /* placed by the scene: least and greatest corner of all its positions, object space */
  uint32_t placed;          /* instances of the scene */
  uint32_t is_flipped;      /* placed by the technique: front faces are clockwise */
  const uint32_t* instances; /* `placed` ids, as HeddleInstance::object; each in one batch of the port at most */
  uint32_t first_command, command_count;
  uint32_t vertex_count; /* surface programs: no vertex beyond vertex_offset + vertex_count - 1 is drawn; snapshots ask for
                            all of them */
  uint32_t reserved;
} heddle_batch;

/* What record and execute are given beside the frame. Functions of one table; fields are appended only. */
struct heddle_pass_host {
  uint32_t struct_size;
  uint32_t reserved;
  void* host; /* the host's, opaque */

  /* Says something to the person at the screen; the host adds where (graph file, pass). `text` is copied.
   * After HEDDLE_SEVERITY_ERROR the caller should return a status other than HEDDLE_OK. [any-thread] */
  void (*report)(const heddle_pass_host* self, uint32_t severity, const char* text);

  /* Current value of a parameter: 1 to 3 doubles (bool 0/1, choice index). Returns the number of components, 0 if there
   * is no such name. [record-thread] */
  uint32_t (*parameter)(const heddle_pass_host* self, const char* name, double out[3]);

  /* An optional service by name and revision ("heddle.NAME/0"), NULL if this host has none. The table lives as long as
   * the host. [any-thread] */
  const void* (*service)(const heddle_pass_host* self, const char* id);

  /* In declare only: overrides what the descriptor says of an out port. Zero fields of `shape` keep it.
   * HEDDLE_BUG for an unknown port. [main-thread] */
  heddle_status (*set_shape)(const heddle_pass_host* self, const char* port, const heddle_shape* shape);

  /* Shape of a bound port; in declare: of inputs; later: of all. Of the scene's environment: the image's width and
   * height; when they change, passes are declared again. What follows from the scene's meshes: heddle/meshes.h.
   * [record-thread] */
  heddle_status (*shape)(const heddle_pass_host* self, const char* port, heddle_shape* out);

  /* CPU twin of a role's function, from the provider bound to this pass (the first one); NULL if absent.
   * [record-thread] */
  const void* (*function_service)(const heddle_pass_host* self, const char* role);

  /* In record, execute and activity: bytes of a bound value port (camera: HeddleView; lights: HeddleLight[n];
   * environment: HeddleEnvironment and texels). Valid until the call returns. NULL and 0 if unbound. Of an artifact that
   * comes in also in declare and prepare, with `frame` NULL, and valid until destroy. [record-thread] */
  const void* (*value)(const heddle_pass_host* self, heddle_frame* frame, const char* port, uint64_t* out_bytes);

  /* In execute of a cpu stage, or in record before the first command that reads it: new bytes of an out value port, at
   * most its byte_size; in execute: all bytes of an artifact. Copied. [record-thread] */
  heddle_status (*set_value)(const heddle_pass_host* self, heddle_frame* frame, const char* port, const void* data,
                             uint64_t bytes);

  /* ---- execute (cpu stages) ---- */
  /* The memory of a port that the stage declares as HOST_READ or HOST_WRITE. Fills *out, whose struct_size the caller
   * has set. HEDDLE_BUG for a port that the stage does not declare so. [record-thread] */
  heddle_status (*map)(const heddle_pass_host* self, heddle_frame* frame, const char* port, heddle_mapped* out);
  /* The triangles of a surfaces port that the stage declares as HOST_READ. *out is the host's object (the alpha test
   * needs that very pointer), valid until execute returns. out_alpha_test may be NULL. [record-thread] */
  heddle_status (*snapshot)(const heddle_pass_host* self, heddle_frame* frame, const char* port,
                            const heddle_snapshot** out, heddle_alpha_test* out_alpha_test);

  /* ---- record (gpu stages) ---- */
  /* A compute shader of this stage, `groups` work groups. push as in heddle_draw. [record-thread] */
  heddle_status (*dispatch)(const heddle_pass_host* self, heddle_frame* frame, const char* shader, uint32_t groups_x,
                            uint32_t groups_y, uint32_t groups_z, const void* push, uint32_t push_bytes);
  /* As many groups as cover mip 0 of `port` (the shader's local size is known from its text). [record-thread] */
  heddle_status (*dispatch_over)(const heddle_pass_host* self, heddle_frame* frame, const char* shader,
                                 const char* port, const void* push, uint32_t push_bytes);
  /* A full-screen shader into all attachments of the stage, layer `layer`. [record-thread] */
  heddle_status (*fullscreen)(const heddle_pass_host* self, heddle_frame* frame, const char* shader, uint32_t layer,
                              const void* push, uint32_t push_bytes);
  /* Every triangle of a surfaces port that *draw asks for; draw is borrowed until return. HEDDLE_BUG for a shader or port
   * that is not of this stage. [record-thread] */
  heddle_status (*draw)(const heddle_pass_host* self, heddle_frame* frame, const heddle_draw* draw);
  /* Makes what earlier commands of this stage wrote visible to its later ones (compute and transfer).
   * [record-thread] */
  void (*barrier)(const heddle_pass_host* self, heddle_frame* frame);
  /* Writes host bytes into a buffer port before the commands that follow; at most 64 KiB a call.
   * [record-thread] */
  heddle_status (*update_buffer)(const heddle_pass_host* self, heddle_frame* frame, const char* port, uint64_t offset,
                                 const void* data, uint64_t bytes);

  /* ---- underneath, for what the above does not cover ---- */
  /* The device's functions, wrapped so that the host counts them. Lives as long as the host. */
  const heddle_vulkan* vulkan;
  /* The frame's objects behind the calls above, the host's, valid until record returns; VK_NULL_HANDLE for an unbound
   * port. The view shows every layer and mip. [record-thread] */
  VkCommandBuffer (*command_buffer)(const heddle_pass_host* self, heddle_frame* frame);
  VkImage (*image)(const heddle_pass_host* self, heddle_frame* frame, const char* port);
  VkImageView (*image_view)(const heddle_pass_host* self, heddle_frame* frame, const char* port);
  VkBuffer (*buffer)(const heddle_pass_host* self, heddle_frame* frame, const char* port);

  /* ---- text ---- */
  /* Number of strings of a parameter: a HEDDLE_TYPE_NAMES has any number, a HEDDLE_TYPE_TEXT one, others none. *out is
   * string `index`, the host's, valid until the parameter changes or the pass is destroyed; untouched if there is none.
   * [record-thread] */
  uint32_t (*text)(const heddle_pass_host* self, const char* parameter, uint32_t index, const char** out);
  /* The file that a path means: as it is if absolute, else relative to the folder of the graph's file (for a graph
   * without a file: the folder that it was parsed for). The host's, valid until the next call. [main-thread] */
  const char* (*resolve_path)(const heddle_pass_host* self, const char* path);
  /* In declare and prepare: what this pass's shaders and functions include as "generated/NAME.glsl", e.g. made by a
   * library that writes shaders. Copied; NULL takes it back. The technique's folder holds a file of that name, which
   * stands in for the text when the build checks the shaders, and wherever none was set. The text declares no bindings
   * and may include files of that folder and of plugins/shared. HEDDLE_BUG elsewhere, or if there is no such file.
   * [main-thread] */
  heddle_status (*set_text)(const heddle_pass_host* self, const char* name, const char* glsl);

  /* ---- lists ---- */
  /* In declare only: how many elements a list that the pass makes holds, in place of what the descriptor says.
   * HEDDLE_BUG for another port. [main-thread] */
  heddle_status (*set_capacity)(const heddle_pass_host* self, const char* port, uint32_t capacity);
  /* A compute shader of this stage, with one invocation in x (y and z: one work group) for each element that the list
   * holds by then, rounded up to whole work groups; the number never leaves the GPU. The stage declares the list as
   * STORAGE_READ or STORAGE_READ_WRITE; an unbound one has no elements. HEDDLE_UNSUPPORTED if a full list would need
   * more work groups than the device dispatches. [record-thread] */
  heddle_status (*dispatch_over_list)(const heddle_pass_host* self, heddle_frame* frame, const char* shader,
                                      const char* port, const void* push, uint32_t push_bytes);
  /* Before the next frame: declare, migrate for kept ports whose shapes change by it, prepare; declare and prepare too for
   * passes that read those. In counted, activity, record and execute of stages without cached_by. [record-thread] */
  void (*request_redeclare)(const heddle_pass_host* self);

  /* ---- long work ---- */
  /* In execute and record, from time to time where it takes long: how much of it is done, 0 to 1, for the person at the
   * screen. Other than HEDDLE_OK: the application wants it to stop, so execute returns that at once. Where the technique
   * has load_state it is always HEDDLE_OK: the host stops it between slices. [record-thread] */
  heddle_status (*progress)(const heddle_pass_host* self, heddle_frame* frame, double done);
  /* In execute: one more row of a report. *row is borrowed. HEDDLE_BUG for a port that is no report. [record-thread] */
  heddle_status (*add_row)(const heddle_pass_host* self, heddle_frame* frame, const char* port,
                           const heddle_report_row* row);
  /* In save_state: bytes behind those of earlier calls. Copied. [record-thread] */
  heddle_status (*keep_state)(const heddle_pass_host* self, heddle_frame* frame, const void* data, uint64_t bytes);

  /* ---- surfaces ---- */
  /* In record and execute of the stage that declares the port as BATCHES: what the port holds until the next call, of an
   * inout port beside what it is bound to. Copied. While the stage answers HEDDLE_KEEP it stays; HEDDLE_NOTHING leaves no
   * batch. The same `revision` as last time means that vertices, indices, instances and commands hold what they held:
   * snapshots then go on; 0: they may hold anything. HEDDLE_BUG if a batch does not lie in the port's buffers, or names
   * what the scene does not have. [record-thread] */
  heddle_status (*set_batches)(const heddle_pass_host* self, heddle_frame* frame, const char* port,
                               const heddle_batch* batches, uint32_t count, uint64_t revision);

  /* ---- blending ---- */
  /* In record: what the drawings of this stage that follow weigh with in attachments of HEDDLE_BLEND_CONSTANT: r, g, b, a,
   * each 0 to 1. Copied. 1 each until the first call of a record. HEDDLE_BUG where no attachment of the stage blends so, or
   * for a number out of range. [record-thread] */
  heddle_status (*set_blend_constant)(const heddle_pass_host* self, heddle_frame* frame, const float constant[4]);
};

/* ---- Technique ---------------------------------------------------------------------------------------------------- */
#define HEDDLE_TECHNIQUE_REFERENCE 1u

typedef struct heddle_technique {
  uint32_t struct_size;
  uint32_t flags;
  const char* id;     /* "ambient_occlusion/gtao": role/technique */
  const char* title;  /* one line */
  const char* source; /* author, year, title */
  uint32_t role_revision; /* newest revision of role.toml that the technique knows */
  uint32_t port_count;
  const heddle_port* ports;
  uint32_t parameter_count;
  uint32_t stage_count;
  const heddle_parameter* parameters;
  const heddle_stage* stages;
  uint32_t shader_count;
  uint32_t function_count;
  const heddle_shader* shaders;
  const heddle_function* functions;
  const char* features;        /* scene features without which the pass has nothing to do, separated by spaces, or NULL */
  const char* device_features; /* Vulkan features it needs beyond the host's own, or NULL */
  const char* fallback;        /* what happens on a device without them: one line, or NULL */

  /* NULL = nothing to do, for each of the following. */
  /* Makes the plugin's object. [main-thread] */
  heddle_status (*create)(const heddle_pass_host* host, heddle_pass** out);
  /* Formats and extents of outputs that depend on parameters or inputs, through host->set_shape. [main-thread] */
  heddle_status (*declare)(heddle_pass* pass, const heddle_pass_host* host);
  /* Everything is allocated; shaders are compiled after this. [main-thread] */
  heddle_status (*prepare)(heddle_pass* pass, const heddle_pass_host* host);
  /* Records the commands of a gpu stage. HEDDLE_MORE: they run, then it is called again. [record-thread] */
  heddle_status (*record)(heddle_pass* pass, const heddle_pass_host* host, uint32_t stage, heddle_frame* frame,
                          const heddle_frame_info* info);
  /* Does the work of a cpu stage. HEDDLE_MORE: it is called again. [record-thread] */
  heddle_status (*execute)(heddle_pass* pass, const heddle_pass_host* host, uint32_t stage, heddle_frame* frame,
                           const heddle_frame_info* info);
  /* Frees the object; the GPU is done with it. [main-thread] */
  void (*destroy)(heddle_pass* pass);
  /* Whether a stage has work this frame: HEDDLE_RUN, HEDDLE_KEEP (outputs are still right; only for stages whose
   * outputs are all HEDDLE_PORT_KEPT) or HEDDLE_NOTHING (images are neutral, lists empty; other buffers hold anything, and
   * who reads them is told by another port that nothing is in them). NULL: always HEDDLE_RUN.
   * [record-thread] */
  uint32_t (*activity)(heddle_pass* pass, const heddle_pass_host* host, uint32_t stage, heddle_frame* frame,
                       const heddle_frame_info* info);
  const heddle_loop* loop; /* NULL: repeats nothing */
  /* Techniques with a loop: which iterations are due; fills *out, whose struct_size the host has set. Once before each
   * frame; what it answers is done when the next one begins. [record-thread] */
  heddle_status (*iterations)(heddle_pass* pass, const heddle_pass_host* host, const heddle_frame_info* info,
                              heddle_iterations* out);

  /* Components of the scene that it reads, by name, separated by spaces, or NULL (heddle/components.h). */
  const char* components;
  /* Between frames, for each list that the pass is the first to make: what the last frame appended. Comes after the
   * frame's own end, nothing waits for it. Where elements were left out, the pass may remember a larger capacity and
   * request_redeclare. [main-thread] */
  void (*counted)(heddle_pass* pass, const heddle_pass_host* host, const heddle_list_count* count);
  /* After request_redeclare, between declare and prepare, for each kept port and each history of one whose shape has
   * changed: records what carries the contents over. Lists have been carried by then, as far as they fit; what else is
   * not carried is neutral. [main-thread] */
  heddle_status (*migrate)(heddle_pass* pass, const heddle_pass_host* host, const heddle_migration* migration);
  /* Between slices of a stage that makes a job's artifacts or is cached_by: gives host->keep_state what load_state needs to
   * go on. The host keeps it on disk with all that the stage's ports hold by then, until the stage is done.
   * [record-thread] */
  heddle_status (*save_state)(heddle_pass* pass, const heddle_pass_host* host, uint32_t stage, heddle_frame* frame);
  /* Before the first slice of such a stage, if it was stopped between two: out ports hold what they held then, info->slice
   * will go on from there, and this is what save_state kept. Other than HEDDLE_OK: the stage begins from nothing.
   * [record-thread] */
  heddle_status (*load_state)(heddle_pass* pass, const heddle_pass_host* host, uint32_t stage, heddle_frame* frame,
                              const void* data, uint64_t bytes);
} heddle_technique;
#define HEDDLE_RUN 0u
#define HEDDLE_KEEP 1u
#define HEDDLE_NOTHING 2u

typedef struct heddle_plugin {
  uint32_t struct_size;
  uint32_t abi_major, abi_minor; /* HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR of the headers it was built with */
  uint32_t technique_count;
  const heddle_technique* const* techniques;
} heddle_plugin;

/* The one exported symbol. Returns static data; called once after opening. Never NULL.
 * [main-thread] */
HEDDLE_EXPORT const heddle_plugin* heddle_entry(void);
typedef const heddle_plugin* (*heddle_entry_function)(void);

HEDDLE_END_C
#endif
