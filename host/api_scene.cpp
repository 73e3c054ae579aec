// SPDX-License-Identifier: Apache-2.0
// heddle_scene_* of the C API: what applications give is checked here, then put into the scene.
#include "api.hpp"
#include "scene/light_texture.hpp"

#include "scene/arrays.hpp"
#include "scene/overlay.hpp"

#include <heddle/components.h>

#include <array>
#include <cmath>
#include <limits>
#include <span>

using namespace heddle::api;
using heddle::Error;
using heddle::Json;
using heddle::Severity;
using heddle::write_json;

namespace {

template <class Item>
void check_id(std::uint32_t id, const std::vector<Item>& items, std::string_view kind) {
  if (id < items.size()) return;
  throw Error(HEDDLE_BAD_INPUT, fmt::format("there is no {} {}: the scene has {}", kind, id, items.size()));
}

glm::dmat4 matrix_from(const double* values, std::string_view what) {
  glm::dmat4 matrix;
  for (glm::length_t column = 0; column < 4; ++column) {
    for (glm::length_t row = 0; row < 4; ++row) {
      const double value = values[column * 4 + row];
      if (!std::isfinite(value)) {
        throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: element {} is not finite", what, column * 4 + row));
      }
      matrix[column][row] = value;
    }
  }
  if (matrix[0][3] != 0 || matrix[1][3] != 0 || matrix[2][3] != 0 || matrix[3][3] != 1) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: the last row must be 0 0 0 1", what));
  }
  return matrix;
}

void check_finite(std::span<const float> values, const std::string& object, const char* field) {
  for (const float value : values) {
    if (!std::isfinite(value)) {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: {} is {}: expected a finite number", object, field, value));
    }
  }
}

heddle::scene::Environment environment_from(const heddle_environment& given) {
  const auto is_side = [](std::uint32_t size) { return size >= 1 && size <= 16384; };
  if (!is_side(given.width) || !is_side(given.height) || given.pixels == nullptr) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("the environment is {} x {} texels: expected 1 to 16384 each, and pixels",
                                              given.width, given.height));
  }
  if (given.channels != 1 && given.channels != 3 && given.channels != 4) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("the environment has {} channels: expected 1, 3 or 4", given.channels));
  }
  const double* q = given.rotation;
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!std::isfinite(length) || !std::isfinite(given.scale) || given.scale < 0 || given.scale > 3e38) {
    throw Error(HEDDLE_BAD_INPUT,
                fmt::format("the environment's scale is {}, its rotation {} {} {} {}: expected finite "
                            "numbers, and a scale that is not negative",
                            given.scale, q[0], q[1], q[2], q[3]));
  }
  static std::atomic<std::uint32_t> revisions{0};
  heddle::scene::Environment made;
  made.record.width = given.width;
  made.record.height = given.height;
  made.record.scale = given.scale > 0 ? static_cast<float>(given.scale) : 1.0F;
  made.record.revision = ++revisions;
  for (std::size_t i = 0; i < 4; ++i) {
    const double none = i == 3 ? 1.0 : 0.0;
    made.record.rotation[i] = static_cast<float>(length > 0 ? q[i] / length : none);
  }
  const std::size_t count = std::size_t{given.width} * given.height;
  made.texels.resize(count * 4);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = given.pixels[i * given.channels + (given.channels == 1 ? 0 : c)];
      if (!std::isfinite(value) || value < 0) {
        throw Error(HEDDLE_BAD_INPUT, fmt::format("the environment's texel {}, {} is {}: expected radiance, finite and "
                                                  "not negative",
                                                  i % given.width, i / given.width, value));
      }
      // Sums over all texels, in float32, stay finite.
      constexpr double kBrightest = 1e28;
      if (static_cast<double>(value) * static_cast<double>(made.record.scale) > kBrightest) {
        throw Error(HEDDLE_BAD_INPUT,
                    fmt::format("the environment's texel {}, {} is {}, times its scale {} cd/m^2 of at most {} are "
                                "expected: the light of all texels together would not be finite",
                                i % given.width, i / given.width, value, made.record.scale, kBrightest));
      }
      made.texels[i * 4 + c] = value;
    }
    made.texels[i * 4 + 3] = 1.0F;
  }
  return made;
}

void check_material(const HeddleMaterial& record, const std::string& name) {
  const std::string object = fmt::format("material '{}'", name);
  if (record.alpha_mode > HEDDLE_ALPHA_BLEND) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("{} has the unknown alpha_mode {}", object, record.alpha_mode));
  }
  const auto check_range = [&](float value, const char* field, float low, float high) {
    if (!(value >= low && value <= high)) {
      throw Error(
          HEDDLE_BAD_INPUT,
          high < std::numeric_limits<float>::max()
              ? fmt::format("{}: {} is {}: expected {} to {}", object, field, value, low, high)
              : fmt::format("{}: {} is {}: expected a finite number of at least {}", object, field, value, low));
    }
  };
  constexpr float kLargest = std::numeric_limits<float>::max();
  for (const float value : record.base_color) check_range(value, "base_color", 0, 1);
  for (const float value : record.emissive) check_range(value, "emissive", 0, kLargest);
  check_range(record.alpha_cutoff, "alpha_cutoff", 0, kLargest);
  check_range(record.metalness, "metalness", 0, 1);
  check_range(record.roughness, "roughness", 0, 1);
  check_range(record.occlusion_strength, "occlusion_strength", 0, 1);
  check_range(record.ior, "ior", 1, kLargest);
  check_range(record.transmission, "transmission", 0, 1);
  check_finite(std::array{record.normal_scale}, object, "normal_scale");
  for (std::uint32_t texture = 0; texture < HEDDLE_TEXTURE_COUNT; ++texture) {
    const heddle::scene::TextureTransform transform = heddle::scene::texture_transform(record, texture);
    check_finite(transform.matrix, object, "uv_rotation_scale");
    check_finite(transform.offset, object, "uv_offset");
  }
}

void check_light(const heddle_light& light, const std::string& name) {
  const std::string object = fmt::format("light '{}'", name);
  for (const double value : light.position) {
    if (!std::isfinite(value)) throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: its position is not finite", object));
  }
  const HeddleLight& record = light.record;
  check_finite(record.direction, object, "direction");
  check_finite(record.intensity, object, "intensity");
  check_finite(record.tangent, object, "tangent");
  check_finite(record.half_extent, object, "half_extent");
  check_finite(std::array{record.range, record.radius, record.segment_length, record.cos_inner, record.cos_outer},
               object, "a length or cosine");
}

heddle::scene::Light light_from(const heddle_light* given, const std::string& name, std::uint32_t id) {
  const heddle_light taken = take(given, "light");
  if (taken.record.type > HEDDLE_LIGHT_ENVIRONMENT) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("light '{}' has the unknown type {}", name, taken.record.type));
  }
  check_light(taken, name);
  heddle::scene::Light made;
  made.name = name;
  made.position = {taken.position[0], taken.position[1], taken.position[2]};
  made.record = taken.record;
  made.record.id = id;
  return made;
}

void check_camera(const heddle_camera& camera) {
  for (const double value : {camera.position[0], camera.position[1], camera.position[2], camera.rotation[0],
                             camera.rotation[1], camera.rotation[2], camera.rotation[3]}) {
    if (!std::isfinite(value)) throw Error(HEDDLE_BAD_INPUT, "the camera's place is not finite");
  }
  if (!(camera.near_distance >= 0) || !(camera.far_distance >= 0) || !(camera.aspect >= 0)) {
    throw Error(HEDDLE_BAD_INPUT, "the camera's near_distance, far_distance or aspect is negative or not a number",
                "0 chooses for you");
  }
  const double limit = camera.is_orthographic != 0 ? std::numeric_limits<double>::max() : 3.141592;
  if (!(camera.vertical_angle > 0 && camera.vertical_angle < limit)) {
    throw Error(HEDDLE_BAD_INPUT,
                fmt::format("the camera's vertical_angle is {}: expected more than 0 and less than pi "
                            "radians (orthographic: a half height in metres)",
                            camera.vertical_angle));
  }
}

}  // namespace

heddle_status heddle_scene_create(heddle_host* host, heddle_scene** out) {
  return guarded(host->error, [&] {
    auto scene = std::make_unique<heddle_scene>();
    scene->host = host;
    scene->scene.components.catalog = &host->registry->components();
    *out = scene.release();
  });
}

void heddle_scene_destroy(heddle_scene* scene) {
  delete scene;
}

heddle_status heddle_scene_load(heddle_scene* scene, const char* path) {
  return heddle_scene_load_with(scene, path, nullptr);
}

heddle_status heddle_scene_load_with(heddle_scene* scene, const char* path, const heddle_load_options* options) {
  return guarded(scene->host->error, [&] {
    const heddle_load_options chosen = options != nullptr ? take(options, "options") : heddle_load_options{};
    heddle::scene::LoadLimits limits;
    if (chosen.memory_limit != 0) limits.bytes = chosen.memory_limit;
    if ((chosen.flags & HEDDLE_LOAD_TRUSTED) != 0) limits = {~std::uint64_t{0}, true};
    limits.progress = scene->host->progress;
    const std::size_t warnings = scene->scene.warnings.size(), ignored = scene->scene.ignored_extensions.size();
    if (std::string_view(path).ends_with(".toml")) {
      heddle::scene::load_overlay(scene->scene, path, limits);
    } else {
      heddle::scene::load_gltf(scene->scene, path, limits);
    }
    for (std::size_t i = warnings; i < scene->scene.warnings.size(); ++i) {
      scene->host->log(Severity::kWarning, fmt::format("{}: warning: {}", path, scene->scene.warnings[i]));
    }
    if (ignored < scene->scene.ignored_extensions.size()) {
      const auto first = scene->scene.ignored_extensions.begin() + static_cast<std::ptrdiff_t>(ignored);
      scene->host->log(Severity::kWarning,
                       fmt::format("{}: warning: extensions that are not known here are left out: {}", path,
                                   fmt::join(first, scene->scene.ignored_extensions.end(), ", ")));
    }
  });
}

heddle_status heddle_scene_add_texture(heddle_scene* scene, const char* name, const heddle_texture* texture,
                                       uint32_t* out_id) {
  return guarded(scene->host->error, [&] {
    const heddle_texture taken = take(texture, "texture");
    if (taken.width == 0 || taken.height == 0 || taken.width > 16384 || taken.height > 16384 || taken.rgba == nullptr) {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("texture '{}' is {} x {} texels: expected 1 to 16384 each, and pixels",
                                                text_or_empty(name), taken.width, taken.height));
    }
    if (taken.wrap_u > 2 || taken.wrap_v > 2) {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("texture '{}' has the unknown wrap modes {}, {}: expected 0 repeat, 1 "
                                                "mirror or 2 clamp",
                                                text_or_empty(name), taken.wrap_u, taken.wrap_v));
    }
    if (taken.filter > 15) {
      throw Error(HEDDLE_BAD_INPUT,
                  fmt::format("texture '{}' has the unknown filter {}: expected a sum of HEDDLE_FILTER_*",
                              text_or_empty(name), taken.filter));
    }
    heddle::scene::Texture made;
    made.name = text_or_empty(name);
    made.width = taken.width;
    made.height = taken.height;
    made.is_srgb = taken.is_srgb != 0;
    made.wrap = {taken.wrap_u, taken.wrap_v};
    made.filter = taken.filter;
    made.rgba.assign(taken.rgba, taken.rgba + std::size_t{4} * taken.width * taken.height);
    scene->scene.textures.push_back(std::move(made));
    ++scene->scene.content_revision;
    *out_id = static_cast<uint32_t>(scene->scene.textures.size() - 1);
  });
}

heddle_status heddle_scene_add_material(heddle_scene* scene, const char* name, const heddle_material* material,
                                        uint32_t* out_id) {
  return guarded(scene->host->error, [&] {
    const heddle_material taken = take(material, "material");
    check_material(taken.record, text_or_empty(name));
    heddle::scene::Material made;
    made.name = text_or_empty(name);
    made.record = taken.record;
    for (std::size_t i = 0; i < made.textures.size(); ++i) {
      made.textures[i] = taken.textures[i];
      if (taken.textures[i] != HEDDLE_NONE) check_id(taken.textures[i], scene->scene.textures, "texture");
    }
    made.record.id = static_cast<uint32_t>(scene->scene.materials.size());
    scene->scene.materials.push_back(std::move(made));
    ++scene->scene.content_revision;
    *out_id = static_cast<uint32_t>(scene->scene.materials.size() - 1);
  });
}

heddle_status heddle_scene_add_mesh(heddle_scene* scene, const char* name, const heddle_mesh* mesh, uint32_t material,
                                    uint32_t* out_id) {
  return guarded(scene->host->error, [&] {
    check_id(material, scene->scene.materials, "material");
    scene->scene.meshes.push_back(
        heddle::scene::make_mesh(take(mesh, "mesh"), text_or_empty(name), material, scene->scene.materials[material]));
    ++scene->scene.content_revision;
    *out_id = static_cast<uint32_t>(scene->scene.meshes.size() - 1);
  });
}

heddle_status heddle_scene_add_instance(heddle_scene* scene, const char* name, uint32_t mesh,
                                        const double scene_from_object[16], uint32_t* out_id) {
  return guarded(scene->host->error, [&] {
    check_id(mesh, scene->scene.meshes, "mesh");
    heddle::scene::Instance made;
    made.name = text_or_empty(name);
    made.mesh = mesh;
    made.scene_from_object = matrix_from(scene_from_object, "scene_from_object");
    made.previous_scene_from_object = made.scene_from_object;
    scene->scene.instances.push_back(std::move(made));
    ++scene->scene.content_revision;
    *out_id = static_cast<uint32_t>(scene->scene.instances.size() - 1);
  });
}

heddle_status heddle_scene_add_light(heddle_scene* scene, const char* name, const heddle_light* light,
                                     uint32_t* out_id) {
  return guarded(scene->host->error, [&] {
    const auto id = static_cast<uint32_t>(scene->scene.lights.size());
    scene->scene.lights.push_back(light_from(light, text_or_empty(name), id));
    *out_id = id;
  });
}

heddle_status heddle_scene_add_camera(heddle_scene* scene, const char* name, const heddle_camera* camera,
                                      uint32_t* out_id) {
  return guarded(scene->host->error, [&] {
    heddle::scene::Camera made;
    made.name = text_or_empty(name);
    made.record = take(camera, "camera");
    check_camera(made.record);
    scene->scene.cameras.push_back(std::move(made));
    *out_id = static_cast<uint32_t>(scene->scene.cameras.size() - 1);
  });
}

heddle_status heddle_scene_set_instance(heddle_scene* scene, uint32_t id, const double scene_from_object[16]) {
  return guarded(scene->host->error, [&] {
    check_id(id, scene->scene.instances, "instance");
    heddle::scene::Instance& instance = scene->scene.instances[id];
    const glm::dmat4 place = matrix_from(scene_from_object, "scene_from_object");
    scene->scene.begin_move();
    instance.scene_from_object = place;
    ++scene->scene.motion_revision;
  });
}

heddle_status heddle_scene_set_light(heddle_scene* scene, uint32_t id, const heddle_light* light) {
  return guarded(scene->host->error, [&] {
    check_id(id, scene->scene.lights, "light");
    heddle::scene::Light& present = scene->scene.lights[id];
    heddle::scene::Light changed = light_from(light, present.name, id);
    changed.texture = present.texture;
    present = std::move(changed);
  });
}

heddle_status heddle_scene_set_camera(heddle_scene* scene, uint32_t id, const heddle_camera* camera) {
  return guarded(scene->host->error, [&] {
    check_id(id, scene->scene.cameras, "camera");
    const heddle_camera taken = take(camera, "camera");
    check_camera(taken);
    scene->scene.cameras[id].record = taken;
  });
}

heddle_status heddle_scene_set_light_texture(heddle_scene* scene, uint32_t id, const heddle_image* image) {
  return guarded(scene->host->error, [&] {
    check_id(id, scene->scene.lights, "light");
    heddle::scene::Light& light = scene->scene.lights[id];
    if (image == nullptr) {
      light.texture.reset();
      return;
    }
    const std::string what = fmt::format("light '{}'", light.name);
    const heddle_image given = take(image, "image");
    if (light.record.type != HEDDLE_LIGHT_RECTANGLE) {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("{} has no face to show a texture on", what),
                  "only lights of type HEDDLE_LIGHT_RECTANGLE take one");
    }
    if (given.pixels == nullptr) throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: its texture has no pixels", what));
    const std::size_t count = std::size_t{given.width} * given.height * given.channels;
    light.texture =
        heddle::scene::make_light_texture(what, given.width, given.height, given.channels, {given.pixels, count});
  });
}

heddle_status heddle_scene_set_environment(heddle_scene* scene, const heddle_environment* environment) {
  return guarded(scene->host->error, [&] {
    if (environment == nullptr) {
      scene->scene.environment.reset();
      return;
    }
    heddle::scene::Environment made = environment_from(take(environment, "environment"));
    // What only turns or scales the image keeps all that was made from it.
    const auto& before = scene->scene.environment;
    if (before && before->record.width == made.record.width && before->texels == made.texels)
      made.record.revision = before->record.revision;
    scene->scene.environment = std::move(made);
  });
}

heddle_status heddle_scene_set_component(heddle_scene* scene, uint32_t owner, uint32_t id, const char* component,
                                         const char* properties) {
  return guarded(scene->host->error, [&] {
    heddle::scene::Scene& changed = scene->scene;
    std::string name;
    const auto find = [&](const auto& things, std::string_view kind) {
      check_id(id, things, kind);
      name = things[id].name;
    };
    switch (owner) {
      case HEDDLE_OWNER_SCENE:
        if (id != 0) throw Error(HEDDLE_BAD_INPUT, fmt::format("the scene itself has the id 0, not {}", id));
        break;
      case HEDDLE_OWNER_INSTANCE:
        find(changed.instances, "instance");
        break;
      case HEDDLE_OWNER_MATERIAL:
        find(changed.materials, "material");
        break;
      case HEDDLE_OWNER_LIGHT:
        find(changed.lights, "light");
        break;
      default:
        throw Error(HEDDLE_BAD_INPUT, fmt::format("there is no kind of owner {}: expected HEDDLE_OWNER_*", owner));
    }
    const auto kind = static_cast<heddle::Owner>(owner);
    std::string place(heddle::to_word(kind));
    if (owner != HEDDLE_OWNER_SCENE) place += fmt::format(" {} '{}'", id, name);
    heddle::GivenComponent given{text_or_empty(component), {}, place, {}};
    try {
      const Json json = heddle::parse_json(properties == nullptr ? "{}" : properties);
      if (!json.is_object()) {
        throw Error(HEDDLE_BAD_INPUT, fmt::format("{}: the properties of '{}' are no JSON object", place, given.name));
      }
      for (const auto& [property, value] : json.items()) given.properties.push_back({property, value, {}, place});
    } catch (const Json::parse_error& error) {
      throw Error(HEDDLE_BAD_INPUT,
                  fmt::format("{}: the properties of '{}' are no JSON, at byte {}", place, given.name, error.byte));
    }
    std::vector<heddle::Diagnostic> problems;
    const auto values = heddle::read_component(changed.components.catalog, given, {&kind, 1}, problems);
    if (!values) throw Error(HEDDLE_BAD_INPUT, std::move(problems));
    changed.components.attach(*values, kind, id);
  });
}

heddle_status heddle_scene_use_camera(heddle_scene* scene, uint32_t id) {
  return guarded(scene->host->error, [&] {
    if (id != HEDDLE_NONE) check_id(id, scene->scene.cameras, "camera");
    scene->scene.camera = id;
  });
}

heddle_status heddle_scene_get_camera(heddle_scene* scene, uint32_t width, uint32_t height, heddle_camera* out) {
  return guarded(scene->host->error, [&] {
    heddle_camera camera = scene->scene.active_camera(width, height);
    camera.struct_size = std::min<std::uint32_t>(out->struct_size, sizeof camera);
    std::memcpy(out, &camera, camera.struct_size);
  });
}

heddle_status heddle_scene_describe(heddle_scene* scene, const char** out_json) {
  return guarded(scene->host->error, [&] {
    scene->description = scene->scene.describe_json();
    *out_json = scene->description.c_str();
  });
}

heddle_status heddle_scene_files(heddle_scene* scene, const char** out_json) {
  return guarded(scene->host->error, [&] {
    scene->files = paths_json({scene->scene.files.begin(), scene->scene.files.end()});
    *out_json = scene->files.c_str();
  });
}

heddle_status heddle_scene_use_animation(heddle_scene* scene, uint32_t id, uint32_t flags) {
  return guarded(scene->host->error, [&] {
    if (const std::size_t count = scene->scene.animation_count(); id != HEDDLE_NONE && id >= count) {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("there is no animation {}: the scene has {}", id, count));
    }
    scene->scene.use_animation(id, (flags & HEDDLE_ANIMATION_LOOP) != 0);
  });
}

heddle_status heddle_scene_set_time(heddle_scene* scene, double time) {
  return guarded(scene->host->error, [&] {
    if (!std::isfinite(time)) throw Error(HEDDLE_BAD_INPUT, fmt::format("time is {}: expected finite seconds", time));
    scene->scene.set_time(time);
  });
}

heddle_status heddle_scene_triangles(heddle_scene* scene, heddle_triangles* out) {
  return guarded(scene->host->error, [&] {
    const heddle_snapshot& all = scene->snapshot.update(scene->scene);
    heddle_triangles triangles{};
    triangles.struct_size = std::min<std::uint32_t>(out->struct_size, sizeof triangles);
    triangles.vertex_count = all.vertex_count;
    triangles.triangle_count = all.triangle_count;
    std::copy(std::begin(all.origin), std::end(all.origin), triangles.origin);
    triangles.positions = all.positions;
    triangles.normals = all.normals;
    triangles.uvs = all.uvs;
    triangles.indices = all.indices;
    triangles.materials = all.materials;
    std::memcpy(out, &triangles, triangles.struct_size);
  });
}
