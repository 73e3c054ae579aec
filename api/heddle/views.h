/* SPDX-License-Identifier: Apache-2.0 */
/* Drawings that outlast the frame: depth maps, cubes and atlases in HEDDLE_PORT_KEPT ports, of which a part is drawn
 * again only where it would look different. They are placed in the scene by a point of their own, so that their pixels
 * do not depend on where the main camera stands. The stage's accesses to the attachments say HEDDLE_LOAD_CLEAR, as no
 * drawing reads what was there before; so they may stand in a loop's body too. */
#ifndef HEDDLE_VIEWS_H
#define HEDDLE_VIEWS_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_VIEWS_SERVICE "heddle.views/0"

typedef struct heddle_placed_draw {
  uint32_t struct_size;
  uint32_t clears;  /* 1: its part of the attachments is set to the accesses' `clear` first, whatever their `load` says */
  const heddle_draw* draw; /* borrowed; its `view` is not NULL, and relative to `origin`; order HEDDLE_ORDER_STATE */
  double origin[3]; /* scene point, metres: what `position_rel` is relative to in this drawing */
} heddle_placed_draw;

typedef struct heddle_views_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In record, in place of heddle_pass_host.draw; `placed` is borrowed until return. HEDDLE_BUG as there, and without a
   * view or in another order. [record-thread] */
  heddle_status (*draw)(const heddle_pass_host* self, heddle_frame* frame, const heddle_placed_draw* placed);
  /* In activity and record of a stage that may draw it: a number that is the same only while the drawing would leave the
   * same pixels behind, as far as they are made by view, origin and part, and by which surfaces are in view, their
   * places, shapes and materials. Not in it: parameters, other ports, and where surfaces were before. Costs what culling
   * costs. Errors as in draw. [record-thread] */
  heddle_status (*look)(const heddle_pass_host* self, heddle_frame* frame, const heddle_placed_draw* placed,
                        uint64_t out[2]);
  /* In activity, record and execute: where a light of the scene is, metres: what `position_rel` was before the frame's
   * origin was taken from it and it was rounded. HEDDLE_BAD_INPUT, without a report, for an id that is none of the
   * scene's. [record-thread] */
  heddle_status (*light_position)(const heddle_pass_host* self, heddle_frame* frame, uint32_t id, double out[3]);
} heddle_views_service;

HEDDLE_END_C
#endif
