// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf_components.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace heddle::scene::gltf {
namespace {

// What a component on a thing costs, rounded up.
constexpr std::uint64_t kComponentBytes = 512;

/// A step of a JSON pointer (RFC 6901).
std::string step(std::string_view key) {
  std::string text = "/";
  for (const char c : key) {
    text += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
  }
  return text;
}

}  // namespace

void ComponentImport::import_node(std::size_t index, std::uint32_t first_instance, std::uint32_t first_light) {
  const tinygltf::Model& model = document_.model;
  const tinygltf::Node& node = model.nodes[index];
  const Target instances{Owner::kInstance, first_instance, static_cast<std::uint32_t>(scene_.instances.size())};
  const Target lights{Owner::kLight, first_light, static_cast<std::uint32_t>(scene_.lights.size())};
  std::vector<Target> of_node;
  if (node.mesh >= 0) {  // checked by the import of meshes
    const tinygltf::Mesh& mesh = model.meshes[static_cast<std::size_t>(node.mesh)];
    import(mesh.extras_json_string, mesh.extensions_json_string, fmt::format("/meshes/{}", node.mesh), {&instances, 1});
    of_node.push_back(instances);
  }
  if (lights.first != lights.end) {
    const int number = node.extensions.at("KHR_lights_punctual").Get("light").GetNumberAsInt();
    const tinygltf::Light& light = model.lights[static_cast<std::size_t>(number)];
    import(light.extras_json_string, light.extensions_json_string,
           fmt::format("/extensions/KHR_lights_punctual/lights/{}", number), {&lights, 1});
    of_node.push_back(lights);
  }
  import(node.extras_json_string, node.extensions_json_string, fmt::format("/nodes/{}", index), of_node);
}

void ComponentImport::import_materials(const std::map<int, std::uint32_t>& ids) {
  for (const auto& [index, id] : ids) {
    if (index < 0) {
      continue;
    }
    const tinygltf::Material& material = document_.model.materials[static_cast<std::size_t>(index)];
    const Target target{Owner::kMaterial, id, id + 1};
    import(material.extras_json_string, material.extensions_json_string, fmt::format("/materials/{}", index),
           {&target, 1});
  }
}

void ComponentImport::import_scene() {
  const tinygltf::Model& model = document_.model;
  if (model.scenes.empty()) {
    return;
  }
  const auto chosen = static_cast<std::size_t>(std::max(model.defaultScene, 0));
  const Target target{Owner::kScene, 0, 1};
  import(model.scenes[chosen].extras_json_string, model.scenes[chosen].extensions_json_string,
         fmt::format("/scenes/{}", chosen), {&target, 1});
}

void ComponentImport::throw_if_any() {
  if (!problems_.empty()) {
    // One of a mesh or light is met again at every node that shows it.
    const auto is_same = [](const Diagnostic& a, const Diagnostic& b) { return to_text(a) == to_text(b); };
    std::vector<Diagnostic> each;
    for (Diagnostic& problem : problems_) {
      if (std::none_of(each.begin(), each.end(), [&](const Diagnostic& known) { return is_same(known, problem); })) {
        each.push_back(std::move(problem));
      }
    }
    throw Error(HEDDLE_BAD_INPUT, std::move(each));
  }
}

void ComponentImport::import(const std::string& extras, const std::string& extensions, const std::string& pointer,
                             std::span<const Target> targets) {
  const auto import_key = [&](const std::string& text, const char* key, const std::string& place) {
    // The rest is other programs' business, and mostly not even parsed.
    if (text.find(key) == std::string::npos) {
      return;
    }
    const Json json = parse_json(text);
    if (json.is_object() && json.contains(key)) {
      import_all(json[key], place + step(key), targets);
    }
  };
  import_key(extras, "heddle", pointer + "/extras");
  import_key(extensions, "HEDDLE_components", pointer + "/extensions");
}

void ComponentImport::import_all(const Json& components, const std::string& pointer, std::span<const Target> targets) {
  // A million wrong ones need no million messages.
  constexpr std::size_t kMostProblems = 64;
  if (problems_.size() >= kMostProblems) {
    return;
  }
  const Location where{document_.file, 0, 0};
  const auto wrong_form = [&](const std::string& place, const Json& value, std::string expected) {
    constexpr std::size_t kLongestQuote = 60;
    problems_.push_back({Severity::kError, where, fmt::format("{}: this is of the wrong form", place),
                         write_json(value).substr(0, kLongestQuote), std::move(expected), ""});
  };
  if (!components.is_object()) {
    wrong_form(pointer, components, "an object of components by name");
    return;
  }
  std::vector<Owner> owners;
  for (const Target& target : targets) {
    owners.push_back(target.owner);
  }
  for (const auto& [name, properties] : components.items()) {
    GivenComponent given{name, where, pointer + step(name), {}};
    if (!properties.is_object()) {
      wrong_form(given.place, properties, "an object of properties by name");
      continue;
    }
    for (const auto& [property, value] : properties.items()) {
      given.properties.push_back({property, value, where, given.place + step(property)});
    }
    const auto values = read_component(scene_.components.catalog, given, owners, problems_);
    if (!values) {
      continue;
    }
    for (const Target& target : targets) {
      for (std::uint32_t id = target.first; id < target.end && values->type->sits_on(target.owner); ++id) {
        document_.spend(kComponentBytes, fmt::format("the component '{}'", name));
        scene_.components.attach(*values, target.owner, id);
      }
    }
  }
}

}  // namespace heddle::scene::gltf
