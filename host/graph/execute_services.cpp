// SPDX-License-Identifier: Apache-2.0
// The services that techniques ask for by name: the scene's components and its meshes; views and counters are beside.
#include "graph/execute_calls.hpp"

#include <heddle/components.h>
#include <heddle/meshes.h>

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace heddle::graph {

namespace {

heddle_status component_table(const heddle_pass_host* self, heddle_frame*, const char* name,
                              heddle_component_table* out) {
  PassState& pass = state_of(self);
  Executor::State& executor = executor_of(pass);
  if (!is_in_key(pass, false, fmt::format("the component '{}'", name))) return HEDDLE_BUG;
  const std::vector<std::string>& named = executor.technique_of(pass).components;
  if (std::find(named.begin(), named.end(), name) == named.end()) {
    return wrong(pass,
                 fmt::format("asks for the component '{}', which heddle_technique.components does not name", name));
  }
  return guarded(pass, [&] {
    const ComponentType& type = *executor.services.registry.components().find(name);
    const scene::Scene* asked = executor.asked_scene(pass);
    const std::uint64_t revision = asked != nullptr ? scene::component_revision(*asked) : 0;
    ComponentRows& rows = executor.component_rows[name];
    if (rows.revision != revision || rows.property_names.empty()) {
      rows = {};
      rows.revision = revision;
      const scene::Components none;
      for (const scene::Component& component : (asked != nullptr ? asked->components : none).of(name)) {
        rows.owner_kinds.push_back(static_cast<std::uint32_t>(component.owner));
        rows.owners.push_back(component.id);
        rows.written.push_back(component.written);
        rows.values.insert(rows.values.end(), component.values.begin(), component.values.end());
      }
      std::uint32_t first = 0;
      for (const ComponentProperty& property : type.properties) {
        rows.property_names.push_back(property.name.c_str());
        rows.first_values.push_back(first);
        first += property.count();
      }
    }
    heddle_component_table table{};
    table.struct_size = std::min<std::uint32_t>(out->struct_size, sizeof table);
    table.count = static_cast<std::uint32_t>(rows.owners.size());
    table.property_count = static_cast<std::uint32_t>(rows.property_names.size());
    table.value_count = type.value_count();
    table.revision = rows.revision;
    table.owner_kinds = rows.owner_kinds.data();
    table.owners = rows.owners.data();
    table.written = rows.written.data();
    table.values = rows.values.data();
    table.property_names = rows.property_names.data();
    table.first_values = rows.first_values.data();
    std::memcpy(out, &table, table.struct_size);
    return HEDDLE_OK;
  });
}

constexpr heddle_components_service kComponentsService{sizeof(heddle_components_service), 0, component_table};

template <typename Record>
heddle_status hand_out(Record record, Record* out) {
  record.struct_size = std::min<std::uint32_t>(out->struct_size, sizeof record);
  std::memcpy(out, &record, record.struct_size);
  return HEDDLE_OK;
}

heddle_status scene_content(const heddle_pass_host* self, heddle_scene_content* out) {
  PassState& pass = state_of(self);
  if (!is_in_key(pass, false, "the scene's meshes")) return HEDDLE_BUG;
  heddle_scene_content content{};
  if (const scene::Scene* asked = executor_of(pass).asked_scene(pass); asked != nullptr) {
    content.mesh_count = static_cast<std::uint32_t>(asked->meshes.size());
    content.instance_count = static_cast<std::uint32_t>(asked->instances.size());
    content.revision = scene::component_revision(*asked);
    content.motion_revision = asked->motion_revision;
  }
  return hand_out(content, out);
}

heddle_status scene_mesh(const heddle_pass_host* self, std::uint32_t index, heddle_scene_mesh* out) {
  PassState& pass = state_of(self);
  if (!is_in_key(pass, false, "the scene's meshes")) return HEDDLE_BUG;
  const scene::Scene* asked = executor_of(pass).asked_scene(pass);
  if (asked == nullptr || index >= asked->meshes.size()) {
    return wrong(
        pass, fmt::format("asks for mesh {} of a scene with {}", index, asked != nullptr ? asked->meshes.size() : 0));
  }
  const scene::Mesh& mesh = asked->meshes[index];
  const bool has_bent = mesh.shape != mesh.previous_shape;
  heddle_scene_mesh record{};
  record.material = mesh.material;
  record.vertex_count = static_cast<std::uint32_t>(mesh.vertices.size());
  record.index_count = static_cast<std::uint32_t>(mesh.indices.size());
  record.vertices = mesh.vertices.data();
  record.previous_vertices = has_bent ? mesh.previous_vertices.data() : mesh.vertices.data();
  record.indices = mesh.indices.data();
  record.face_sizes = mesh.face_sizes.empty() ? nullptr : mesh.face_sizes.data();
  record.face_count =
      static_cast<std::uint32_t>(mesh.face_sizes.empty() ? mesh.indices.size() / 3 : mesh.face_sizes.size());
  record.crease_count = static_cast<std::uint32_t>(mesh.sharpness.size());
  record.creases = mesh.creases.data();
  record.sharpness = mesh.sharpness.data();
  record.shape = mesh.shape;
  record.previous_shape = has_bent ? mesh.previous_shape : mesh.shape;
  return hand_out(record, out);
}

heddle_status scene_instance(const heddle_pass_host* self, std::uint32_t index, heddle_scene_instance* out) {
  PassState& pass = state_of(self);
  if (!is_in_key(pass, false, "the scene's instances")) return HEDDLE_BUG;
  const scene::Scene* asked = executor_of(pass).asked_scene(pass);
  if (asked == nullptr || index >= asked->instances.size()) {
    return wrong(pass, fmt::format("asks for instance {} of a scene with {}", index,
                                   asked != nullptr ? asked->instances.size() : 0));
  }
  const scene::Instance& instance = asked->instances[index];
  heddle_scene_instance record{};
  record.mesh = instance.mesh;
  for (glm::length_t i = 0; i < 16; ++i) {
    record.scene_from_object[i] = instance.scene_from_object[i / 4][i % 4];
    record.previous_scene_from_object[i] = instance.previous_scene_from_object[i / 4][i % 4];
  }
  return hand_out(record, out);
}

constexpr heddle_meshes_service kMeshesService{sizeof(heddle_meshes_service), 0, scene_content, scene_mesh,
                                               scene_instance};

}  // namespace

const void* service(const heddle_pass_host*, const char* id) {
  if (std::strcmp(id, HEDDLE_COMPONENTS_SERVICE) == 0) return &kComponentsService;
  if (std::strcmp(id, HEDDLE_MESHES_SERVICE) == 0) return &kMeshesService;
  const void* slices = slices_service(id);
  return slices != nullptr ? slices : views_service(id);
}

}  // namespace heddle::graph
