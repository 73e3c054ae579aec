/* SPDX-License-Identifier: Apache-2.0 */
/* The C border between libheddle_view.so, the only library that links GLFW, OpenGL and Dear ImGui, and who opens it: the
 * command and, for scenes written in Python, the Python package. Both are built together, so a differing revision is an
 * error and nothing is negotiated. The module renders through heddle.h alone.
 *
 * Two threads: the one that calls heddle_view_run has the window; another one makes the host, and everything that
 * heddle.h tags [main-thread] happens there. Functions tagged [work-thread] are called on that one. */
#ifndef HEDDLE_VIEW_MODULE_H
#define HEDDLE_VIEW_MODULE_H

#include <heddle/heddle.h>

HEDDLE_BEGIN_C

#define HEDDLE_VIEW_MODULE_REVISION 2u

typedef struct heddle_view heddle_view;

/* Who opens the window. Functions answer HEDDLE_OK, or another status after which `error` says why. */
typedef struct heddle_view_application {
  uint32_t struct_size;
  uint32_t revision;             /* HEDDLE_VIEW_MODULE_REVISION */
  const char* graphs[2];         /* file or shipped name of A and B; B may be NULL */
  const char* const* settings[2]; /* as of heddle_graph_load */
  uint32_t setting_counts[2];
  uint32_t width, height;        /* of the window, pixels; 0: as the graph's picture needs */
  double time, time_step;        /* of the first frame; from frame to frame while the scene plays; seconds */
  uint64_t seed;
  const char* script;            /* file with what the mouse and the keys do; NULL: none */
  void* user;
  /* Makes the host, whose log and progress should reach heddle_view_tell and heddle_view_progress. [work-thread] */
  heddle_status (*open)(void* user, heddle_view* view, heddle_host** out);
  /* Reads the scene anew for A (0) or B (1), each of which has its own, and posed by its graph's frames. The one that it
   * had before is destroyed if this succeeds. It belongs to the application. [work-thread] */
  heddle_status (*load_scene)(void* user, uint32_t variant, heddle_scene** out);
  /* Moves that scene to a time, before each frame, beyond what heddle_render poses; may be NULL. [work-thread] */
  heddle_status (*pose)(void* user, uint32_t variant, double time);
  /* Files that load_scene read, as a JSON array of paths, valid until the next call. [work-thread] */
  heddle_status (*scene_files)(void* user, const char** out_json);
  /* Message of the last of these functions that failed. [work-thread] */
  const char* (*error)(void* user);
  /* 1 if a signal asked for the end. [any-thread] */
  uint32_t (*is_stopped)(void* user);
  /* Destroys scenes and host; graphs are gone. Called once, if `open` succeeded. [work-thread] */
  void (*close)(void* user);
  /* While nothing changes but what loops still add, frames are rendered for as long before the picture is shown again;
   * milliseconds, 0: it is shown after each frame */
  double frame_budget_ms;
} heddle_view_application;

/* Shows the window until it is closed. On failure `error` has the NUL-terminated message; HEDDLE_CANCELLED after
 * is_stopped. [main-thread] */
HEDDLE_EXPORT heddle_status heddle_view_run(const heddle_view_application* application, char* error, size_t error_size);
typedef heddle_status (*heddle_view_run_function)(const heddle_view_application*, char*, size_t);
/* A line for the window's messages; for heddle_host_options.log. [any-thread] */
HEDDLE_EXPORT void heddle_view_tell(void* view, uint32_t severity, const char* text);
/* What the host is at; answers 1 when the window was closed. For heddle_host_options.progress. [any-thread] */
HEDDLE_EXPORT uint32_t heddle_view_progress(void* view, const char* activity, double fraction);

HEDDLE_END_C
#endif
