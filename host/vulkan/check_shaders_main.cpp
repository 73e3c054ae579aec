// SPDX-License-Identifier: Apache-2.0
// heddle-check-shaders PLUGIN_FOLDER[:PLUGIN_FOLDER...] MANIFEST: a tool of the build. Compiles every shader of a
// plugin with neutral functions, and every function that it provides with a caller that calls all of its role. Errors
// are printed as compilers print them.
#include "vulkan/shader.hpp"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <sstream>

#include <fmt/format.h>

namespace {

using namespace heddle;
namespace fs = std::filesystem;

std::vector<fs::path> split_folders(std::string_view text) {
  std::vector<fs::path> folders;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(':'), text.size());
    if (end > 0) folders.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return folders;
}

// Where two folders have a role, the first one's is it, as it is for hosts.
std::map<std::string, Role, std::less<>> read_roles(const std::vector<fs::path>& folders) {
  std::map<std::string, Role, std::less<>> roles;
  for (const fs::path& folder : folders) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      const fs::path file = entry.path() / "role.toml";
      if (!fs::is_regular_file(file)) continue;
      Role role = read_role(file);
      roles.emplace(role.name, std::move(role));
    }
  }
  return roles;
}

// Ports as they will be in a graph, as far as a descriptor tells: outputs in their declared format, inputs as floats.
std::vector<vulkan::BoundPort> bound_ports(const Technique& technique, const Role* role,
                                           const std::vector<Access>& accesses, bool is_optional_bound) {
  std::vector<vulkan::BoundPort> out;
  for (const Access& access : accesses) {
    const Port& port = *technique.find_port(access.port);
    vulkan::BoundPort bound;
    bound.port = port.name;
    bound.access = access.access;
    bound.blend = access.blend;
    bound.type = port.type;
    bound.is_bound = is_optional_bound || !port.is_optional();
    bound.format = port.format != 0 ? static_cast<VkFormat>(port.format) : VK_FORMAT_R32G32B32A32_SFLOAT;
    bound.layers = port.layers;
    bound.is_cube = (port.flags & HEDDLE_PORT_CUBE) != 0;
    bound.glsl = port.glsl;
    bound.types = port.types;
    bound.is_list = port.is_list();
    bound.element_bytes = port.element_bytes;
    if (const RolePort* contract = role != nullptr ? role->find_port(port.name) : nullptr) {
      bound.neutral = contract->neutral;
      if (bound.glsl.empty()) bound.glsl = contract->glsl;
    }
    out.push_back(std::move(bound));
  }
  return out;
}

class Checker {
 public:
  explicit Checker(const std::vector<fs::path>& folders) : roles_(read_roles(folders)) {
    for (const fs::path& folder : folders) shared_.push_back(folder / "shared");
    for (const auto& [name, role] : roles_) {
      for (const ComponentType& component : role.components) components_.add(component);
    }
  }

  bool run(Technique technique, const fs::path& folder) {
    for (Port& port : technique.ports) {
      const auto component = components_.find_port(port.name);
      if (component && port.glsl.empty()) complete_component_port(port, *component->type);
    }
    const Role* role = find_role(technique.role_name(), technique);
    for (const Shader& shader : technique.shaders) {
      const Stage* stage = technique.find_stage(shader.stage);
      if (shader.file.empty() || stage == nullptr) continue;
      vulkan::ShaderRequest request;
      request.pass = technique.id;
      request.technique = &technique;
      request.shader = &shader;
      request.folder = folder;
      request.shared_folders = shared_;
      for (const Role* called : find_roles(shader.calls, technique))
        request.roles.push_back({called, called->join, {}});
      const bool has_optional = std::any_of(stage->accesses.begin(), stage->accesses.end(), [&](const Access& access) {
        return technique.find_port(access.port)->is_optional();
      });
      for (const bool is_optional_bound : {true, false}) {
        if (!is_optional_bound && !has_optional) continue;
        request.ports = bound_ports(technique, role, stage->accesses, is_optional_bound);
        attempt([&] { print(vulkan::compile(request, {}).warnings); });
      }
    }
    for (const Function& function : technique.functions) {
      const Role* provided = find_role(function.role, technique);
      if (provided == nullptr) continue;
      vulkan::ProviderRequest request;
      request.pass = technique.id;
      request.technique = &technique;
      request.folder = folder;
      request.ports = bound_ports(technique, role, function.accesses, true);
      const std::vector<const Role*> callees = find_roles(function.calls, technique);
      attempt([&] { print(vulkan::compile_with_test_caller(*provided, request, callees, shared_).warnings); });
    }
    return is_good_;
  }

 private:
  const Role* find_role(std::string_view name, const Technique& technique) {
    const auto found = roles_.find(name);
    if (found != roles_.end()) return &found->second;
    std::vector<std::string> names;
    for (const auto& entry : roles_) names.push_back(entry.first);
    Diagnostic diagnostic;
    diagnostic.message = fmt::format("technique {} names role '{}', which has no role.toml", technique.id, name);
    const std::string nearest = nearest_name(name, names);
    diagnostic.expected = "one of " + join_names(names);
    diagnostic.help = nearest.empty() ? "" : fmt::format("did you mean '{}'?", nearest);
    fmt::print(stderr, "{}\n", to_text(diagnostic));
    is_good_ = false;
    return nullptr;
  }

  std::vector<const Role*> find_roles(const std::vector<std::string>& names, const Technique& technique) {
    std::vector<const Role*> out;
    for (const std::string& name : names) {
      if (const Role* role = find_role(name, technique)) out.push_back(role);
    }
    return out;
  }

  template <typename Work>
  void attempt(const Work& work) {
    try {
      work();
    } catch (const Error& error) {
      fmt::print(stderr, "{}\n", to_text(error.diagnostics()));
      is_good_ = false;
    }
  }

  static void print(const std::vector<std::string>& warnings) {
    for (const std::string& warning : warnings) fmt::print(stderr, "warning: {}\n", warning);
  }

  std::map<std::string, Role, std::less<>> roles_;
  ComponentCatalog components_;
  std::vector<fs::path> shared_;
  bool is_good_ = true;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    fmt::print(stderr, "usage: heddle-check-shaders PLUGIN_FOLDER[:PLUGIN_FOLDER...] MANIFEST\n");
    return HEDDLE_BAD_INPUT;
  }
  try {
    const fs::path file = argv[2];
    std::ifstream stream(file);
    std::ostringstream text;
    text << stream.rdbuf();
    if (!stream) throw Error(HEDDLE_BAD_INPUT, fmt::format("{} cannot be read", file.string()));
    const Manifest manifest = manifest_from_json(text.str(), file);
    const fs::path folder = manifest.folder.empty() ? file.parent_path() : manifest.folder;
    const std::vector<fs::path> folders = split_folders(argv[1]);
    bool is_good = true;
    for (const Technique& technique : manifest.techniques) {
      is_good = Checker(folders).run(technique, folder) && is_good;
    }
    return is_good ? HEDDLE_OK : 1;
  } catch (const Error& error) {
    fmt::print(stderr, "{}\n", to_text(error.diagnostics()));
    return error.status();
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return HEDDLE_FAILED;
  }
}
