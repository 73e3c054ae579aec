// SPDX-License-Identifier: Apache-2.0
// A pass's key holds the keys of the passes that it reads from, not what they made: nothing has to run to know it.
#include "graph/execute_keys.hpp"

#include "graph/execute_parts.hpp"
#include "graph/uses.hpp"
#include "scene/upload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace heddle::graph {
namespace {

namespace fs = std::filesystem;

/// Raised where an artifact of before would be taken for what is made now.
constexpr std::string_view kJobKeyFormat = "heddle job key 1";

class Keys {
 public:
  Keys(const ResolvedGraph& graph, const KeyContext& context) : graph_(graph), context_(context) {
    keys_.resize(graph.passes.size());
    is_open_.resize(graph.passes.size(), false);
  }

  std::vector<std::string> run() {
    for (PassIndex p = 0; p < graph_.passes.size(); ++p) (void)key_of(p);
    return std::move(keys_);
  }
  std::vector<std::string> run_codes() {
    std::vector<std::string> codes;
    for (const Pass& pass : graph_.passes) {
      ContentHash hash;
      add_code(hash, pass);
      add_device(hash, *pass.entry.technique);
      codes.push_back(hash.hexadecimal());
    }
    return codes;
  }

 private:
  const std::string& key_of(PassIndex index) {
    if (!keys_[index].empty()) return keys_[index];
    if (is_open_[index]) {
      (void)order(graph_);  // says which passes, and through what
      throw Error(HEDDLE_BAD_INPUT, fmt::format("pass '{}' needs what it makes itself", graph_.passes[index].name));
    }
    is_open_[index] = true;
    ContentHash hash;
    hash.add(kJobKeyFormat);
    add_pass(hash, index);
    is_open_[index] = false;
    return keys_[index] = hash.hexadecimal();
  }

  void add_pass(ContentHash& hash, PassIndex index) {
    const Pass& pass = graph_.passes[index];
    const Technique& technique = *pass.entry.technique;
    add_code(hash, pass);
    for (std::size_t i = 0; i < technique.parameters.size(); ++i)
      add_parameter(hash, technique.parameters[i], pass.parameters[i]);
    for (const auto* ports : {&pass.ports, &pass.inout_sources}) {
      for (const auto& [port, resource] : *ports) {
        if (graph_.resources[resource].producer == index) continue;
        hash.add(port);
        add_resource(hash, graph_.resources[resource]);
      }
    }
    for (const FunctionBinding& binding : pass.functions) {
      hash.add(binding.role);
      add_bytes(hash, binding.join);
      if (const Role* role = context_.registry.find_role(binding.role)) hash.add(hash_of_file(role->file).value_or(""));
      for (const PassIndex provider : binding.providers) hash.add(key_of(provider));
    }
    for (const std::string& name : pass.serves) hash.add(name);
    for (const std::string& name : technique.components) add_component(hash, name);
    if (sees_origin(graph_, pass)) add_bytes(hash, context_.origin);
    add_bytes(hash, graph_.width);
    add_bytes(hash, graph_.height);
    add_bytes(hash, context_.time);
    add_bytes(hash, context_.seed);
    add_device(hash, technique);
  }

  void add_device(ContentHash& hash, const Technique& technique) const {
    const bool runs_on_device =
        std::ranges::any_of(technique.stages, [](const Stage& stage) { return stage.kind == StageKind::kGpu; });
    if (runs_on_device) hash.add(context_.device());
  }

  /// The library, and the text that its shaders are made of.
  void add_code(ContentHash& hash, const Pass& pass) {
    hash.add(pass.entry.technique->id);
    hash.add(context_.registry.content_hash(pass.entry));
    hash.add(hash_of_file(pass.role->file).value_or(""));
    add_shaders(hash, pass.entry.manifest->folder);
    if (pass.entry.technique->shaders.empty() && pass.entry.technique->functions.empty()) return;
    for (const fs::path& folder : context_.registry.shared_folders()) add_shaders(hash, folder);
  }

  void add_shaders(ContentHash& hash, const fs::path& folder) {
    std::string& known = folders_[folder];
    if (known.empty()) {
      std::set<fs::path> files;
      std::error_code error;
      for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
        if (entry->path().extension() == ".glsl" || entry->path().extension() == ".h") files.insert(entry->path());
      ContentHash texts;
      for (const fs::path& file : files) {
        texts.add(file.lexically_relative(folder).string());
        texts.add(hash_of_file(file).value_or(""));
      }
      known = texts.hexadecimal();
    }
    hash.add(known);
  }

  /// With the contents of files that texts name.
  void add_parameter(ContentHash& hash, const Parameter& parameter, const ParameterValue& value) {
    hash.add(parameter.name);
    for (const double number : value.number) add_bytes(hash, number);
    add_bytes(hash, value.names.size());
    for (const std::string& name : value.names) {
      hash.add(name);
      if (!name.empty()) hash.add(hash_of_file(graph_.folder / name).value_or(""));
    }
  }

  void add_resource(ContentHash& hash, const Resource& resource) {
    if (resource.history_of != kNoIndex) {  // neutral, as in a first frame
      hash.add("no past");
    } else if (resource.producer != kNoIndex) {
      hash.add(key_of(resource.producer));
      hash.add(resource.port);
    } else if (resource.job != kNoIndex) {
      hash.add(context_.artifact(resource));
      hash.add(resource.port);
    } else {
      hash.add(scene_hash(resource.port));
    }
  }

  const std::string& scene_hash(const std::string& port) {
    std::string& known = scene_[port];
    if (!known.empty()) return known;
    const scene::Scene& scene = context_.scene;
    ContentHash hash;
    if (const auto part = find_scene_part(port)) {
      add_content(hash, scene, *part, context_.origin);
    } else if (const auto component = context_.registry.components().find_port(port)) {
      add_array(hash, scene::component_elements(scene.components, *component->type, component->owner));
    } else {
      // A key that does not hold what a job reads would give out the artifact of another scene.
      throw Error(HEDDLE_BUG, fmt::format("no job's key can hold the scene's '{}'", port));
    }
    return known = hash.hexadecimal();
  }

  void add_component(ContentHash& hash, const std::string& name) {
    hash.add(name);
    for (const scene::Component& component : context_.scene.components.of(name)) {
      add_bytes(hash, component.owner);
      add_bytes(hash, component.id);
      add_bytes(hash, component.written);
      add_array(hash, component.values);
    }
  }

  const ResolvedGraph& graph_;
  const KeyContext& context_;
  std::vector<std::string> keys_;
  std::vector<bool> is_open_;
  std::map<fs::path, std::string> folders_;
  std::map<std::string, std::string> scene_;
};

}  // namespace

std::vector<std::string> artifact_keys(const ResolvedGraph& graph, const KeyContext& context) {
  return Keys(graph, context).run();
}

std::vector<std::string> code_keys(const ResolvedGraph& graph, const KeyContext& context) {
  return Keys(graph, context).run_codes();
}

bool sees_origin(const ResolvedGraph& graph, const Pass& pass) {
  return std::ranges::any_of(pass.ports, [&](const auto& bound) {
    const Resource& resource = graph.resources[bound.second];
    const bool is_lights =
        resource.producer == kNoIndex && resource.history_of == kNoIndex && resource.port == "lights";
    return is_lights || resource.type == PortType::kSurfaces;
  });
}

}  // namespace heddle::graph
