// SPDX-License-Identifier: Apache-2.0
// The services that techniques ask for by name: the scene's components, meshes and materials, and threads; views and
// counters are beside.
#include "graph/execute_calls.hpp"

#include <heddle/components.h>
#include <heddle/device.h>
#include <heddle/functions.h>
#include <heddle/materials.h>
#include <heddle/meshes.h>
#include <heddle/parallel.h>

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <system_error>
#include <thread>

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
    const std::array<glm::dvec3, 2>& box = asked->reach();
    for (int i = 0; i < 6; ++i) content.bounds[i] = box[static_cast<std::size_t>(i / 3)][i % 3];
    content.typical_size = asked->typical_size();
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

heddle_status scene_look(const heddle_pass_host* self, heddle_scene_look* out) {
  PassState& pass = state_of(self);
  if (!is_in_key(pass, false, "the scene's materials")) return HEDDLE_BUG;
  heddle_scene_look look{};
  if (const scene::Scene* asked = executor_of(pass).asked_scene(pass); asked != nullptr) {
    look.material_count = static_cast<std::uint32_t>(asked->materials.size());
    look.texture_count = static_cast<std::uint32_t>(asked->textures.size());
    look.revision = asked->content_revision;
  }
  return hand_out(look, out);
}

heddle_status scene_material(const heddle_pass_host* self, std::uint32_t index, heddle_scene_material* out) {
  PassState& pass = state_of(self);
  if (!is_in_key(pass, false, "the scene's materials")) return HEDDLE_BUG;
  const scene::Scene* asked = executor_of(pass).asked_scene(pass);
  if (asked == nullptr || index >= asked->materials.size()) {
    return wrong(pass, fmt::format("asks for material {} of a scene with {}", index,
                                   asked != nullptr ? asked->materials.size() : 0));
  }
  const scene::Material& material = asked->materials[index];
  heddle_scene_material record{};
  record.record = &material.record;
  std::ranges::copy(material.textures, record.textures);
  return hand_out(record, out);
}

heddle_status scene_texture(const heddle_pass_host* self, std::uint32_t index, heddle_scene_texture* out) {
  PassState& pass = state_of(self);
  if (!is_in_key(pass, false, "the scene's textures")) return HEDDLE_BUG;
  const scene::Scene* asked = executor_of(pass).asked_scene(pass);
  if (asked == nullptr || index >= asked->textures.size()) {
    return wrong(pass, fmt::format("asks for texture {} of a scene with {}", index,
                                   asked != nullptr ? asked->textures.size() : 0));
  }
  const scene::Texture& texture = asked->textures[index];
  heddle_scene_texture record{};
  record.width = texture.width;
  record.height = texture.height;
  record.is_srgb = texture.is_srgb ? 1 : 0;
  std::ranges::copy(texture.wrap, record.wrap);
  record.is_nearest = (texture.filter & HEDDLE_FILTER_NEAREST_MAGNIFIED) != 0 ? 1 : 0;
  record.rgba = texture.rgba.data();
  return hand_out(record, out);
}

heddle_status attributes_of(const heddle_pass_host*, const heddle_snapshot* snapshot, heddle_snapshot_attributes* out) {
  return hand_out(scene::snapshot_attributes(*snapshot), out);
}

constexpr heddle_materials_service kMaterialsService{
    sizeof(heddle_materials_service), 0, scene_look, scene_material, scene_texture, attributes_of};

std::uint32_t most_threads(const heddle_pass_host*, std::uint32_t wanted) {
  return wanted != 0 ? wanted : std::max(1U, std::thread::hardware_concurrency());
}

heddle_status for_each(const heddle_pass_host* self, std::uint32_t wanted, std::uint64_t count,
                       heddle_parallel_work work, void* user) {
  return guarded(state_of(self), [&] {
    std::atomic<std::uint64_t> next{0};
    const auto run = [&](std::uint32_t thread) {
      for (std::uint64_t i = next.fetch_add(1); i < count; i = next.fetch_add(1)) work(user, i, thread);
    };
    // Fewer threads than asked for do the same work.
    const std::uint64_t threads = std::min<std::uint64_t>(most_threads(self, wanted), count);
    std::vector<std::jthread> others;
    try {
      for (std::uint32_t i = 1; i < threads; ++i) others.emplace_back(run, i);
    } catch (const std::system_error&) {  // those that there are do it all
    }
    run(0);
    return HEDDLE_OK;
  });
}

/// Of the passes that answer a role's functions for this one, those that are there.
std::vector<const Pass*> providers_of(const PassState& pass, std::string_view role) {
  const Executor::State& executor = executor_of(pass);
  std::vector<const Pass*> found;
  for (const FunctionBinding& binding : executor.pass_of(pass).functions)
    for (const PassIndex provider : binding.providers)
      if (binding.role == role && executor.passes[provider]) found.push_back(&executor.graph.passes[provider]);
  return found;
}

std::uint32_t provider_count(const heddle_pass_host* self, const char* role) {
  const PassState& pass = state_of(self);
  if (!is_in_key(pass, false, fmt::format("who answers for role '{}'", role))) return 0;
  return static_cast<std::uint32_t>(providers_of(pass, role).size());
}

std::uint32_t provider_parameter(const heddle_pass_host* self, const char* role, std::uint32_t index, const char* name,
                                 double out[3]) {
  const PassState& pass = state_of(self);
  if (!is_in_key(pass, false, fmt::format("parameter '{}' of role '{}'", name, role))) return 0;
  const std::vector<const Pass*> providers = providers_of(pass, role);
  if (index >= providers.size()) return 0;
  const std::vector<Parameter>& parameters = providers[index]->entry.technique->parameters;
  const auto found = std::ranges::find(parameters, name, &Parameter::name);
  if (found == parameters.end()) return 0;
  const auto& number = providers[index]->parameters[static_cast<std::size_t>(found - parameters.begin())].number;
  std::copy_n(number.begin(), found->components(), out);
  return found->components();
}

std::uint64_t loop_limit(const heddle_pass_host* self) {
  // Measured with Mesa 22.3: a loop of one shader, two in a row, and one within another share them.
  constexpr std::uint64_t kLavapipe = 65535;
  return executor_of(state_of(self)).device->info().is_lavapipe ? kLavapipe : 0;
}

std::uint32_t format_features(const heddle_pass_host* self, std::uint32_t format) {
  return executor_of(state_of(self)).device->format_features(static_cast<VkFormat>(format));
}

constexpr heddle_functions_service kFunctionsService{sizeof(heddle_functions_service), 0, provider_count,
                                                     provider_parameter};
constexpr heddle_device_service kDeviceService{sizeof(heddle_device_service), 0, loop_limit, format_features};
constexpr heddle_parallel_service kParallelService{sizeof(heddle_parallel_service), 0, most_threads, for_each};

constexpr heddle_meshes_service kMeshesService{sizeof(heddle_meshes_service), 0, scene_content, scene_mesh,
                                               scene_instance};

}  // namespace

const void* service(const heddle_pass_host*, const char* id) {
  if (std::strcmp(id, HEDDLE_COMPONENTS_SERVICE) == 0) return &kComponentsService;
  if (std::strcmp(id, HEDDLE_MESHES_SERVICE) == 0) return &kMeshesService;
  if (std::strcmp(id, HEDDLE_MATERIALS_SERVICE) == 0) return &kMaterialsService;
  if (std::strcmp(id, HEDDLE_PARALLEL_SERVICE) == 0) return &kParallelService;
  if (std::strcmp(id, HEDDLE_FUNCTIONS_SERVICE) == 0) return &kFunctionsService;
  if (std::strcmp(id, HEDDLE_DEVICE_SERVICE) == 0) return &kDeviceService;
  for (const auto find : {slices_service, contents_service, pieces_service, files_service})
    if (const void* found = find(id); found != nullptr) return found;
  return views_service(id);
}

}  // namespace heddle::graph
