/* SPDX-License-Identifier: Apache-2.0 */
/* Components: typed extras of a scene's things that some techniques interpret ("shadow.settings" of a light). A role
 * declares them in role.toml, a technique names those that it reads in heddle_technique.components, and finds them
 *   on the CPU   through the service below, a row for each thing that has the component;
 *   in shaders   through an input of type value that goes by the component's name and its owner's, "shadow_settings_light":
 *                the host lays out its elements, and fetch_shadow_settings_light(id) gives the owner's (SHADERS.md).
 * A scene that has a component has the feature of that name, for heddle_technique.features. */
#ifndef HEDDLE_COMPONENTS_H
#define HEDDLE_COMPONENTS_H

#include <heddle/plugin.h>

HEDDLE_BEGIN_C

#define HEDDLE_COMPONENTS_SERVICE "heddle.components/1"

/* What a component sits on; ids are the scene's. */
#define HEDDLE_OWNER_SCENE 0u    /* id 0 */
#define HEDDLE_OWNER_INSTANCE 1u /* HeddleInstance::object */
#define HEDDLE_OWNER_MATERIAL 2u /* HeddleMaterial::id */
#define HEDDLE_OWNER_LIGHT 3u    /* HeddleLight::id; lights that a pass appends have ids beyond the scene's */

/* Every instance of one component. A row has value_count numbers: the properties in the order of role.toml, three numbers
 * for a color or float3, 0 or 1 for a bool, the index for a choice; where nothing was written, the default. */
typedef struct heddle_component_table {
  uint32_t struct_size;
  uint32_t count;          /* rows, sorted by owner_kind, then owner */
  uint32_t property_count;
  uint32_t value_count;
  uint64_t revision;       /* the same revision means the same table */
  const uint32_t* owner_kinds;       /* count, HEDDLE_OWNER_* */
  const uint32_t* owners;            /* count, ids */
  const uint64_t* written;           /* count; bit i: the scene says property i */
  const double* values;              /* count x value_count */
  const char* const* property_names; /* property_count */
  const uint32_t* first_values;      /* property_count: where a property's numbers begin in a row */
} heddle_component_table;

typedef struct heddle_components_service {
  uint32_t struct_size;
  uint32_t reserved;
  /* In activity, record and execute: a component of the scene that is rendered. The caller has set out->struct_size; what
   * it points to is the host's and valid until the call that the frame belongs to returns. HEDDLE_BUG for a component that
   * the technique does not name. In declare, with `frame` NULL: of the scene that is planned for; no rows if there is
   * none; when the scene's meshes or components change, the pass is declared again. [record-thread] */
  heddle_status (*table)(const heddle_pass_host* self, heddle_frame* frame, const char* component,
                         heddle_component_table* out);
} heddle_components_service;

HEDDLE_END_C
#endif
