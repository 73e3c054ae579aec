// SPDX-License-Identifier: Apache-2.0
// TOML -> changes to a scene. First everything is read and checked, then everything is applied.
#include "scene/overlay.hpp"
#include "image/image.hpp"
#include "plugin/toml_json.hpp"
#include "scene/light_texture.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <sstream>

namespace heddle::scene {
namespace {

using Problems = std::vector<Diagnostic>;
using Change = std::function<void(Scene&)>;

constexpr double kLargest = 3.0e38;  // that a float32 holds, with a digit to spare
constexpr std::array<const char*, 10> kLightTypes = {"directional", "point", "spot", "sphere",    "capsule",
                                                     "cone",        "wedge", "box",  "rectangle", "environment"};
constexpr std::array<const char*, 3> kAlphaModes = {"opaque", "mask", "blend"};

struct Range {
  double low = -kLargest, high = kLargest;
  bool has_low = true;  // `low` itself is in it
};
constexpr Range kAny{}, kUnit{0, 1}, kPositive{0, kLargest, false}, kNotNegative{0, kLargest};

std::string text_of(const Range& range) {
  if (range.high < kLargest) {
    return fmt::format("{} to {}", range.low, range.high);
  }
  if (range.low > -kLargest) {
    return fmt::format("{} {}", range.has_low ? "at least" : "more than", range.low);
  }
  return "a finite number";
}

/// Reads the keys of one table; those that nobody asked for are mistakes.
class Table {
 public:
  Table(const toml::table& table, std::string what, const std::string& file, Problems& problems)
      : table_(table), what_(std::move(what)), file_(file), problems_(problems) {}

  [[nodiscard]] Location where(const toml::node& node) const {
    return {file_, node.source().begin.line, node.source().begin.column};
  }
  [[nodiscard]] Location where() const { return where(table_); }
  [[nodiscard]] const std::string& what() const { return what_; }
  void mistake(const Location& place, std::string message, std::string found, std::string expected,
               std::string help = {}) {
    problems_.push_back({Severity::kError, place, fmt::format("{}: {}", what_, message), std::move(found),
                         std::move(expected), std::move(help)});
  }

  std::optional<double> number(const char* key, const Range& range) {
    const toml::node* node = find(key);
    return node == nullptr ? std::nullopt : value_of(*node, key, range);
  }
  template <std::size_t count>
  std::optional<std::array<double, count>> numbers(const char* key, const Range& range) {
    const toml::node* node = find(key);
    if (node == nullptr) {
      return std::nullopt;
    }
    const toml::array* list = node->as_array();
    if (list == nullptr || list->size() != count) {
      mistake(where(*node), fmt::format("'{}' is of the wrong form", key),
              list == nullptr ? "no array" : fmt::format("{} numbers", list->size()), fmt::format("{} numbers", count));
      return std::nullopt;
    }
    std::array<double, count> values{};
    for (std::size_t i = 0; i < count; ++i) {
      const std::optional<double> value = value_of(*list->get(i), key, range);
      if (!value) {
        return std::nullopt;
      }
      values[i] = *value;
    }
    return values;
  }
  std::optional<bool> boolean(const char* key) {
    const toml::node* node = find(key);
    if (node == nullptr) {
      return std::nullopt;
    }
    if (const auto value = node->value_exact<bool>()) {
      return value;
    }
    mistake(where(*node), fmt::format("'{}' is of the wrong type", key), "", "true or false");
    return std::nullopt;
  }
  std::optional<std::string> text(const char* key) {
    const toml::node* node = find(key);
    if (node == nullptr) {
      return std::nullopt;
    }
    if (const auto value = node->value_exact<std::string>()) {
      return value;
    }
    mistake(where(*node), fmt::format("'{}' is of the wrong type", key), "", "a string");
    return std::nullopt;
  }
  template <std::size_t count>
  std::optional<std::uint32_t> choice(const char* key, const std::array<const char*, count>& names) {
    const std::optional<std::string> chosen = text(key);
    if (!chosen) {
      return std::nullopt;
    }
    const auto found = std::find(names.begin(), names.end(), *chosen);
    if (found == names.end()) {
      mistake(where(*table_.get(key)), fmt::format("there is no {} '{}'", key, *chosen), "",
              fmt::format("one of {}", fmt::join(names, ", ")), did_you_mean(*chosen, {names.begin(), names.end()}));
      return std::nullopt;
    }
    return static_cast<std::uint32_t>(found - names.begin());
  }
  [[nodiscard]] const toml::node* find(const char* key) {
    if (std::find(known_.begin(), known_.end(), key) == known_.end()) {
      known_.emplace_back(key);
    }
    return table_.get(key);
  }
  /// components.shadow.settings.priority = 2, or components."shadow.settings" = { priority = 2 }.
  std::vector<ComponentValues> components(const ComponentCatalog* catalog, Owner owner) {
    std::vector<ComponentValues> read;
    const toml::node* node = find("components");
    if (node == nullptr) {
      return read;
    }
    if (!node->is_table()) {
      mistake(where(*node), "'components' is of the wrong form", "", "components.NAME.PROPERTY = VALUE");
      return read;
    }
    const auto take = [&](const std::string& name, const toml::key& key, const toml::node& value) {
      const Location place{file_, key.source().begin.line, key.source().begin.column};
      if (!value.is_table()) {
        mistake(place, fmt::format("'components.{}' is of the wrong form", name), "",
                "components.NAME.PROPERTY = VALUE, NAME with a dot as in shadow.settings");
        return;
      }
      GivenComponent given{name, place, what_, {}};
      for (const auto& [property, written] : *value.as_table()) {
        given.properties.push_back({std::string(property.str()),
                                    json_of(written),
                                    {file_, property.source().begin.line, property.source().begin.column},
                                    what_});
      }
      if (auto values = read_component(catalog, given, {&owner, 1}, problems_)) {
        read.push_back(std::move(*values));
      }
    };
    for (const auto& [key, value] : *node->as_table()) {
      const std::string name(key.str());
      if (name.find('.') != std::string::npos || !value.is_table()) {
        take(name, key, value);
        continue;
      }
      for (const auto& [second, inner] : *value.as_table()) {
        take(fmt::format("{}.{}", name, second.str()), second, inner);
      }
    }
    return read;
  }
  void finish() {
    for (const auto& [key, node] : table_) {
      const std::string name(key.str());
      if (std::find(known_.begin(), known_.end(), name) == known_.end()) {
        mistake({file_, key.source().begin.line, key.source().begin.column}, fmt::format("unknown key '{}'", name), "",
                fmt::format("one of {}", join_names(known_)), did_you_mean(name, known_));
      }
    }
  }
  static std::string did_you_mean(std::string_view name, const std::vector<std::string>& names) {
    const std::string nearest = nearest_name(name, names);
    return nearest.empty() ? "" : fmt::format("did you mean '{}'?", nearest);
  }

 private:
  std::optional<double> value_of(const toml::node& node, const char* key, const Range& range) {
    const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value) {
      mistake(where(node), fmt::format("'{}' is of the wrong type", key), "", "a number");
      return std::nullopt;
    }
    if (!(*value >= range.low && *value <= range.high) || (!range.has_low && *value == range.low)) {
      mistake(where(node), fmt::format("'{}' is out of range", key), fmt::format("{}", *value), text_of(range));
      return std::nullopt;
    }
    return value;
  }

  const toml::table& table_;
  std::string what_;
  const std::string& file_;
  Problems& problems_;
  std::vector<std::string> known_;
};

template <std::size_t count>
void store(const std::optional<std::array<double, count>>& values, float* out) {
  for (std::size_t i = 0; values && i < count; ++i) {
    out[i] = static_cast<float>((*values)[i]);
  }
}
void store(const std::optional<double>& value, float& out) {
  if (value) {
    out = static_cast<float>(*value);
  }
}

/// Unit vector, nothing (and a mistake) for one without length.
std::optional<std::array<double, 3>> direction(Table& table, const char* key) {
  std::optional<std::array<double, 3>> given = table.numbers<3>(key, kAny);
  if (!given) {
    return given;
  }
  const double length = std::hypot((*given)[0], (*given)[1], (*given)[2]);
  if (length == 0) {
    table.mistake(table.where(*table.find(key)), fmt::format("'{}' has no length", key), "", "a direction");
    return std::nullopt;
  }
  for (double& value : *given) {
    value /= length;
  }
  return given;
}

/// Puts components on every thing of a name.
template <typename Things>
void attach_to_named(Scene& scene, const Things& things, const std::string& name, Owner owner,
                     const std::vector<ComponentValues>& components) {
  for (std::size_t i = 0; i < things.size(); ++i) {
    if (things[i].name != name) {
      continue;
    }
    for (const ComponentValues& values : components) {
      scene.components.attach(values, owner, static_cast<std::uint32_t>(i));
    }
  }
}

Change read_instance(Table& table, const std::string& name, const ComponentCatalog* catalog) {
  const std::vector<ComponentValues> components = table.components(catalog, Owner::kInstance);
  table.finish();
  return [=](Scene& scene) { attach_to_named(scene, scene.instances, name, Owner::kInstance, components); };
}

/// What "texture" of a light names, read; an empty pointer: "none". Nothing where the key is absent or mistaken.
std::optional<std::shared_ptr<const LightTexture>> read_light_texture(Table& table, const std::string& name,
                                                                      const std::filesystem::path& folder,
                                                                      const LoadLimits& limits,
                                                                      std::vector<std::filesystem::path>& files) {
  const std::optional<std::string> named = table.text("texture");
  if (!named) return std::nullopt;
  if (*named == "none") return std::shared_ptr<const LightTexture>();
  const Location place = table.where(*table.find("texture"));
  std::error_code error;
  const std::filesystem::path file = folder / *named;
  const auto home = std::filesystem::weakly_canonical(folder.empty() ? "." : folder, error);
  const auto real = std::filesystem::weakly_canonical(file, error);
  const bool is_inside = std::mismatch(home.begin(), home.end(), real.begin(), real.end()).first == home.end();
  if (!is_inside && !limits.leaves_folder) {
    table.mistake(place, "'texture' names a file outside of the overlay's folder", *named, "a file beside it or below",
                  "if you trust it, load it with HEDDLE_LOAD_TRUSTED, or with --trust-files on the command");
    return std::nullopt;
  }
  try {
    const image::Image image = image::read(file);
    files.push_back(file);
    return make_light_texture(fmt::format("light '{}'", name), image.width, image.height, image.channels, image.pixels);
  } catch (const Error& failure) {
    table.mistake(place, "'texture' cannot be used", failure.diagnostics().front().message, "");
    return std::nullopt;
  }
}

/// `present`: the light of the scene that it changes; NULL: this file makes it.
Change read_light(Table& table, const std::string& name, bool is_new, const Light* present,
                  const ComponentCatalog* catalog, const std::filesystem::path& folder, const LoadLimits& limits) {
  const auto type = table.choice("type", kLightTypes);
  const auto position = table.numbers<3>("position", kAny);
  const auto towards = direction(table, "direction"), tangent = direction(table, "tangent");
  const auto intensity = table.numbers<3>("intensity", kNotNegative),
             half_extent = table.numbers<3>("half_extent", kNotNegative);
  const auto range = table.number("range", kNotNegative), radius = table.number("radius", kNotNegative),
             segment_length = table.number("segment_length", kNotNegative);
  const Range angle{0, std::numbers::pi};
  const auto inner = table.number("inner_angle", angle), outer = table.number("outer_angle", angle);
  const auto casts_shadow = table.boolean("casts_shadow");
  std::vector<std::filesystem::path> files;
  const auto texture = read_light_texture(table, name, folder, limits, files);
  const std::vector<ComponentValues> components = table.components(catalog, Owner::kLight);
  table.finish();
  const bool is_of_scene = !type && present != nullptr;
  const std::uint32_t shape = is_of_scene ? present->record.type : type.value_or(HEDDLE_LIGHT_RECTANGLE);
  if (texture && *texture != nullptr && shape != HEDDLE_LIGHT_RECTANGLE) {
    table.mistake(table.where(*table.find("texture")), "this light has no face to show a texture on",
                  is_of_scene ? fmt::format("'{}' is of the type {}", name, kLightTypes.at(shape)) : "",
                  "type = \"rectangle\"");
  }
  if (is_new && (!type || !intensity)) {
    table.mistake(table.where(), "a new light needs a type and an intensity", "",
                  "type = \"point\", intensity = [1, 1, 1]", "to change a light, write the name that it has");
  }
  return [=](Scene& scene) {
    const auto apply = [&](Light& light) {
      HeddleLight& record = light.record;
      record.type = type.value_or(record.type);
      if (position) {
        light.position = {(*position)[0], (*position)[1], (*position)[2]};
      }
      store(towards, record.direction);
      store(tangent, record.tangent);
      store(intensity, record.intensity);
      store(half_extent, record.half_extent);
      store(range, record.range);
      store(radius, record.radius);
      store(segment_length, record.segment_length);
      if (texture) {
        light.texture = *texture;
      }
      if (inner) {
        record.cos_inner = static_cast<float>(std::cos(*inner));
      }
      if (outer) {
        record.cos_outer = static_cast<float>(std::cos(*outer));
      }
      if (casts_shadow) {
        record.flags =
            *casts_shadow ? record.flags | HEDDLE_LIGHT_CASTS_SHADOW : record.flags & ~HEDDLE_LIGHT_CASTS_SHADOW;
      }
    };
    if (is_new) {
      Light& made = scene.lights.emplace_back();
      made.name = name;
      made.record.direction[1] = -1;
      made.record.tangent[0] = 1;
      made.record.flags = HEDDLE_LIGHT_CASTS_SHADOW;
      made.record.cos_inner = 1;
      made.record.cos_outer = static_cast<float>(std::cos(std::numbers::pi / 4));
      made.record.id = static_cast<std::uint32_t>(scene.lights.size() - 1);
    }
    for (Light& light : scene.lights) {
      if (light.name == name) {
        apply(light);
      }
    }
    scene.files.insert(scene.files.end(), files.begin(), files.end());
    attach_to_named(scene, scene.lights, name, Owner::kLight, components);
  };
}

Change read_material(Table& table, const std::string& name, const ComponentCatalog* catalog) {
  const auto base_color = table.numbers<4>("base_color", kUnit);
  const auto emissive = table.numbers<3>("emissive", kNotNegative);
  const auto metalness = table.number("metalness", kUnit), roughness = table.number("roughness", kUnit),
             normal_scale = table.number("normal_scale", kAny), occlusion = table.number("occlusion_strength", kUnit),
             ior = table.number("ior", Range{1, kLargest}), transmission = table.number("transmission", kUnit),
             cutoff = table.number("alpha_cutoff", kNotNegative);
  const auto alpha_mode = table.choice("alpha_mode", kAlphaModes);
  const auto double_sided = table.boolean("double_sided"), unlit = table.boolean("unlit");
  const std::vector<ComponentValues> components = table.components(catalog, Owner::kMaterial);
  table.finish();
  return [=](Scene& scene) {
    for (Material& material : scene.materials) {
      if (material.name != name) {
        continue;
      }
      HeddleMaterial& record = material.record;
      store(base_color, record.base_color);
      store(emissive, record.emissive);
      store(metalness, record.metalness);
      store(roughness, record.roughness);
      store(normal_scale, record.normal_scale);
      store(occlusion, record.occlusion_strength);
      store(ior, record.ior);
      store(transmission, record.transmission);
      store(cutoff, record.alpha_cutoff);
      record.alpha_mode = alpha_mode.value_or(record.alpha_mode);
      const auto set_flag = [&](const std::optional<bool>& is_set, std::uint32_t flag) {
        if (is_set) {
          record.flags = *is_set ? record.flags | flag : record.flags & ~flag;
        }
      };
      set_flag(double_sided, HEDDLE_MATERIAL_DOUBLE_SIDED);
      set_flag(unlit, HEDDLE_MATERIAL_UNLIT);
    }
    attach_to_named(scene, scene.materials, name, Owner::kMaterial, components);
    scene.content_revision = Scene::new_revision();
  };
}

Change read_camera(Table& table, const std::string& name, bool is_new) {
  const auto position = table.numbers<3>("position", kAny), target = table.numbers<3>("target", kAny);
  const auto angle = table.number("vertical_angle", Range{1e-6, 3.14159});
  const auto half_height = table.number("orthographic_half_height", kPositive);
  const auto near_distance = table.number("near", kPositive);
  table.finish();
  if (target && !position) {
    table.mistake(table.where(*table.find("target")), "a target needs a position", "", "position = [x, y, z]");
  }
  if (angle && half_height) {
    table.mistake(table.where(*table.find("orthographic_half_height")),
                  "a camera has a vertical_angle or an orthographic_half_height", "both", "one of them");
  }
  if (is_new && (!position || !target)) {
    table.mistake(table.where(), "a new camera needs a position and a target", "",
                  "position = [x, y, z], target = [x, y, z]", "to change a camera, write the name that it has");
  }
  glm::dmat4 place(1.0);
  if (position && target) {
    const glm::dvec3 eye((*position)[0], (*position)[1], (*position)[2]), at((*target)[0], (*target)[1], (*target)[2]);
    if (eye == at) {
      table.mistake(table.where(*table.find("target")), "a camera's target is its position", "", "another point");
    }
    // rotation_part takes what is across from the matrix's second column: the world's up, unless the view runs along
    // it.
    const glm::dvec3 back = eye - at;
    const bool is_steep = std::hypot(back.x, back.z) < 1e-9 * std::abs(back.y);
    place[1] = is_steep ? glm::dvec4(0, 0, -1, 0) : glm::dvec4(0, 1, 0, 0);
    place[2] = glm::dvec4(back, 0);
    place[3] = glm::dvec4(eye, 1);
  }
  return [=](Scene& scene) {
    if (is_new) {
      Camera& made = scene.cameras.emplace_back();
      made.name = name;
      made.record.struct_size = sizeof made.record;
      made.record.vertical_angle = 0.9;
      scene.camera = scene.cameras.size() == 1 ? 0 : scene.camera;
    }
    for (Camera& camera : scene.cameras) {
      if (camera.name != name) {
        continue;
      }
      if (position && target) {
        place_camera(camera.record, place);
      } else if (position) {
        std::copy(position->begin(), position->end(), camera.record.position);
      }
      if (angle || half_height) {
        camera.record.is_orthographic = half_height ? 1 : 0;
        camera.record.vertical_angle = half_height ? *half_height : *angle;
      }
      camera.record.near_distance = near_distance.value_or(camera.record.near_distance);
    }
  };
}

/// "4 names and more" would help nobody: the first ones are enough to see how they look.
std::string some_of(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 12;
  if (names.empty()) {
    return "the scene has none";
  }
  const std::vector<std::string> shown(names.begin(),
                                       names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kShown)));
  return fmt::format("one of {}{}", join_names(shown), names.size() > kShown ? ", ..." : "");
}

class Overlay {
 public:
  Overlay(const toml::table& root, std::string file)
      : file_(std::move(file)), root_(root, "the overlay", file_, problems_) {}

  std::optional<std::string> base() { return root_.text("file"); }
  [[noreturn]] void mistake_in_base(std::string message, std::string found, std::string expected, std::string help) {
    root_.mistake(root_.where(*root_.find("file")), std::move(message), std::move(found), std::move(expected),
                  std::move(help));
    throw Error(HEDDLE_BAD_INPUT, std::move(problems_));
  }

  /// Reads everything against the scene that it is for; throws with all mistakes.
  std::vector<Change> read(const Scene& scene, const LoadLimits& limits) {
    std::vector<Change> changes;
    std::vector<std::string> cameras = names_of(scene.cameras), lights = names_of(scene.lights);
    const std::vector<std::string> materials = names_of(scene.materials);
    const auto contains = [](const std::vector<std::string>& names, const std::string& name) {
      return std::find(names.begin(), names.end(), name) != names.end();
    };
    each("camera", [&](Table& table, const std::string& name) {
      const bool is_new = !contains(cameras, name);
      changes.push_back(read_camera(table, name, is_new));
      if (is_new) {
        cameras.push_back(name);
      }
    });
    each("light", [&](Table& table, const std::string& name) {
      const bool is_new = !contains(lights, name);
      const auto present = std::ranges::find(scene.lights, name, &Light::name);
      changes.push_back(read_light(table, name, is_new, present == scene.lights.end() ? nullptr : &*present,
                                   scene.components.catalog, std::filesystem::path(file_).parent_path(), limits));
      if (is_new) {
        lights.push_back(name);
      }
    });
    each("material", [&](Table& table, const std::string& name) {
      if (!contains(materials, name)) {
        table.mistake(table.where(*table.find("name")), "the scene has no such material", "", some_of(materials),
                      Table::did_you_mean(name, materials));
      }
      changes.push_back(read_material(table, name, scene.components.catalog));
    });
    const std::vector<std::string> instances = names_of(scene.instances);
    each("instance", [&](Table& table, const std::string& name) {
      if (!contains(instances, name)) {
        table.mistake(table.where(*table.find("name")), "the scene has no such instance", "", some_of(instances),
                      Table::did_you_mean(name, instances));
      }
      changes.push_back(read_instance(table, name, scene.components.catalog));
    });
    const std::vector<ComponentValues> of_scene = root_.components(scene.components.catalog, Owner::kScene);
    changes.push_back([of_scene](Scene& changed) {
      for (const ComponentValues& values : of_scene) {
        changed.components.attach(values, Owner::kScene, 0);
      }
    });
    if (const std::optional<std::string> name = root_.text("use_camera")) {
      const auto found = std::find(cameras.begin(), cameras.end(), *name);
      if (found == cameras.end()) {
        root_.mistake(root_.where(*root_.find("use_camera")), fmt::format("the scene has no camera '{}'", *name), "",
                      some_of(cameras), Table::did_you_mean(*name, cameras));
      }
      changes.push_back([name](Scene& changed) {
        const auto named = [&](const Camera& camera) { return camera.name == *name; };
        const auto chosen = std::find_if(changed.cameras.begin(), changed.cameras.end(), named);
        changed.camera = static_cast<std::uint32_t>(chosen - changed.cameras.begin());
      });
    }
    if (const std::optional<std::string> name = root_.text("animation")) {
      std::vector<std::string> animations;
      for (const Rig& rig : scene.rigs) {
        for (const Animation& animation : rig.animations) {
          animations.push_back(animation.name);
        }
      }
      const auto found = std::find(animations.begin(), animations.end(), *name);
      if (found == animations.end() && *name != "none") {
        root_.mistake(root_.where(*root_.find("animation")), fmt::format("the scene has no animation '{}'", *name), "",
                      some_of(animations), Table::did_you_mean(*name, animations));
      }
      const auto index = static_cast<std::uint32_t>(found - animations.begin());
      animation_ = found == animations.end() ? HEDDLE_NONE : index;
      has_animation_ = true;
    }
    loops_ = root_.boolean("loop").value_or(false);
    root_.finish();
    if (!problems_.empty()) {
      std::stable_sort(problems_.begin(), problems_.end(), [](const Diagnostic& a, const Diagnostic& b) {
        return std::pair(a.where.line, a.where.column) < std::pair(b.where.line, b.where.column);
      });
      throw Error(HEDDLE_BAD_INPUT, problems_);
    }
    return changes;
  }
  /// First, because it alone can fail.
  void play(Scene& scene) const {
    if (has_animation_ || loops_) {
      scene.use_animation(has_animation_ ? animation_ : 0, loops_);
    }
  }

 private:
  /// Every table of an array of tables, by its name.
  void each(const char* kind, const std::function<void(Table&, const std::string&)>& read) {
    const toml::node* node = root_.find(kind);
    if (node == nullptr) {
      return;
    }
    const toml::array* list = node->as_array();
    for (std::size_t i = 0; list != nullptr && i < list->size(); ++i) {
      if (const toml::table* table = list->get_as<toml::table>(i)) {
        Table reader(*table, kind, file_, problems_);
        const std::optional<std::string> name = reader.text("name");
        if (!name || name->empty()) {
          reader.mistake(reader.where(), "it has no name", "",
                         fmt::format("name = \"...\", of the {} that it changes", kind));
          continue;
        }
        Table named(*table, fmt::format("{} '{}'", kind, *name), file_, problems_);
        (void)named.find("name");
        read(named, *name);
      }
    }
    if (list == nullptr || !list->is_array_of_tables()) {
      root_.mistake(root_.where(*node), fmt::format("'{}' is of the wrong form", kind), "",
                    fmt::format("[[{}]] before the keys of each, in two brackets", kind));
    }
  }

  std::string file_;
  Problems problems_;
  Table root_;
  bool has_animation_ = false, loops_ = false;
  std::uint32_t animation_ = HEDDLE_NONE;
};

/// above: overlays over this one, the last of which names it.
void apply_overlay(Scene& scene, const std::filesystem::path& file, const LoadLimits& limits,
                   std::vector<std::filesystem::path> above) {
  above.push_back(file);
  std::ifstream stream(file, std::ios::binary);
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored) || !stream) {
    throw Error(HEDDLE_BAD_INPUT,
                Diagnostic{Severity::kError, {file.string(), 0, 0}, "there is no such file", "", "", ""});
  }
  std::stringstream text;
  text << stream.rdbuf();
  toml::table root;
  try {
    root = toml::parse(text.str(), file.string());
  } catch (const toml::parse_error& error) {
    const toml::source_position at = error.source().begin;
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             {file.string(), at.line, at.column},
                                             fmt::format("this is no TOML: {}", error.description()),
                                             "",
                                             "",
                                             ""});
  }
  Overlay overlay(root, file.string());
  const std::optional<std::string> base = overlay.base();
  Scene loaded;
  loaded.time = scene.time;
  loaded.components.catalog = scene.components.catalog;
  if (base) {
    const std::filesystem::path below = file.parent_path() / *base;
    if (below.extension() == ".py") {
      overlay.mistake_in_base("a Python file cannot be under an overlay", *base, "a glTF file or another overlay",
                              "load the Python file, and this one with --overlay");
    }
    if (below.extension() == ".toml") {
      std::error_code error;
      const auto is_it = [&](const std::filesystem::path& known) {
        return std::filesystem::equivalent(known, below, error);
      };
      if (std::any_of(above.begin(), above.end(), is_it)) {
        overlay.mistake_in_base("the overlays are over each other in a circle", *base,
                                "a file that is not over this one", "");
      }
      apply_overlay(loaded, below, limits, above);
    } else {
      load_gltf(loaded, below, limits);
    }
  }
  Scene& changed = base ? loaded : scene;
  const std::vector<Change> changes = overlay.read(changed, limits);
  overlay.play(changed);
  for (const Change& change : changes) {
    change(changed);
  }
  if (base) {
    merge(scene, std::move(loaded));
  }
  scene.files.push_back(file);
}

}  // namespace

void load_overlay(Scene& scene, const std::filesystem::path& file, const LoadLimits& limits) {
  apply_overlay(scene, file, limits, {});
}

}  // namespace heddle::scene
