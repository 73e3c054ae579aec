// SPDX-License-Identifier: Apache-2.0
// Folders -> roles and techniques, checked against each other, without opening a library; techniques -> open libraries,
// shared by all passes of a host.
#include "plugin/registry.hpp"
#include "content_hash.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "diagnostics.hpp"
#include "plugin/technique_json.hpp"

namespace heddle {
namespace {

namespace fs = std::filesystem;

// Entries in the order of their names, so that what wins never depends on the file system.
std::vector<fs::path> sorted_entries(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) {
    entries.push_back(i->path());
  }
  if (error) {
    Diagnostic diagnostic;
    diagnostic.where.file = folder.string();
    diagnostic.message = "cannot look for plugins in this folder";
    diagnostic.found = error.message();
    diagnostic.expected = "a folder with <role>/role.toml and <role>/<technique>/";
    throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

std::string read_text(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (!stream.is_open() || stream.bad()) {
    Diagnostic diagnostic;
    diagnostic.where.file = file.string();
    diagnostic.message = "cannot read this file";
    throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
  }
  return text;
}

std::vector<Manifest> read_manifests(const fs::path& role_folder) {
  std::vector<Manifest> manifests;
  for (const fs::path& technique_folder : sorted_entries(role_folder)) {
    if (!fs::is_directory(technique_folder)) continue;
    for (const fs::path& file : sorted_entries(technique_folder)) {
      if (file.string().ends_with(".manifest.json")) manifests.push_back(manifest_from_json(read_text(file), file));
    }
  }
  return manifests;
}

/// Techniques of a role that the build could not make, and why.
std::map<std::string, std::string, std::less<>> read_left_out(const fs::path& role_folder) {
  std::map<std::string, std::string, std::less<>> reasons;
  for (const fs::path& technique_folder : sorted_entries(role_folder)) {
    const fs::path file = technique_folder / "left_out.txt";
    if (!fs::is_regular_file(file)) continue;
    std::string reason = read_text(file);
    reason.erase(reason.find_last_not_of(" \n") + 1);
    reasons.emplace(role_folder.filename().string() + "/" + technique_folder.filename().string(), reason);
  }
  return reasons;
}

/// Compares a technique with the contracts of the roles that it names, and takes from them what it left open.
class Contract {
 public:
  Contract(const std::map<std::string, Role, std::less<>>& roles, const ComponentCatalog& components,
           const Manifest& manifest)
      : roles_(roles), components_(components), file_(manifest.library.string()) {}

  void apply(Technique& technique) {
    what_ = fmt::format("technique '{}'", technique.id);
    const Role* role = find(technique.role_name(), "this role has no role.toml");
    if (role != nullptr) {
      if (technique.role_revision > role->revision) {
        complain("made for a newer revision of its role", fmt::format("revision {}", technique.role_revision),
                 fmt::format("at most {}, as {} says", role->revision, role->file.string()));
      }
      check_components(technique);
      for (Port& port : technique.ports) {
        if (!apply_component(technique, port)) apply_port(*role, port);
      }
      for (const RolePort& port : role->ports) {
        if (port.direction == Direction::kOut && !port.optional && technique.find_port(port.name) == nullptr) {
          complain(fmt::format("the role's output '{}' is missing", port.name), {},
                   fmt::format("an {} port of type {}", to_word(port.direction), to_word(port.type)));
        }
      }
      if (!role->functions.empty() && technique.find_function(role->name) == nullptr) {
        complain(fmt::format("the role's function '{}' is missing", role->functions.front().name), {},
                 "a heddle_function for the role");
      }
    }
    for (const Function& function : technique.functions) {
      const Role* provided =
          find(function.role, fmt::format("provides a function of the unknown role '{}'", function.role));
      if (provided != nullptr && provided->functions.empty()) {
        complain(fmt::format("provides a function of the role '{}', which has none", provided->name));
      }
      check_calls(function.calls);
    }
    for (const Shader& shader : technique.shaders) check_calls(shader.calls);
  }

  void finish() {
    if (!problems_.empty()) throw Error(HEDDLE_BAD_INPUT, std::move(problems_));
  }

 private:
  void complain(std::string_view message, std::string found = {}, std::string expected = {}, std::string help = {}) {
    Diagnostic diagnostic;
    diagnostic.where.file = file_;
    diagnostic.message = fmt::format("{}: {}", what_, message);
    diagnostic.found = std::move(found);
    diagnostic.expected = std::move(expected);
    diagnostic.help = std::move(help);
    problems_.push_back(std::move(diagnostic));
  }

  const Role* find(std::string_view name, std::string_view message) {
    const auto found = roles_.find(name);
    if (found != roles_.end()) return &found->second;
    std::vector<std::string> names;
    for (const auto& [known, role] : roles_) names.push_back(known);
    const std::string nearest = nearest_name(name, names);
    complain(message, fmt::format("'{}'", name), "one of " + join_names(names),
             nearest.empty() ? std::string() : fmt::format("did you mean '{}'?", nearest));
    return nullptr;
  }

  void check_calls(const std::vector<std::string>& calls) {
    for (const std::string& name : calls) find(name, fmt::format("calls functions of the unknown role '{}'", name));
  }

  void check_components(const Technique& technique) {
    for (const std::string& name : technique.components) {
      if (components_.find(name) != nullptr) continue;
      const std::vector<std::string> names = components_.names();
      const std::string nearest = nearest_name(name, names);
      complain(fmt::format("reads the unknown component '{}'", name), {},
               names.empty() ? "no components: no role declares one" : "one of " + join_names(names),
               nearest.empty() ? std::string() : fmt::format("did you mean '{}'?", nearest));
    }
  }

  /// A value that goes by a component's name is that component, as the host lays it out.
  bool apply_component(const Technique& technique, Port& port) {
    const auto component = components_.find_port(port.name);
    if (!component || port.type != PortType::kValue || port.direction != Direction::kIn || !port.glsl.empty()) {
      return false;
    }
    const std::string& name = component->type->name;
    if (std::find(technique.components.begin(), technique.components.end(), name) == technique.components.end()) {
      complain(fmt::format("port '{}' reads a component that the technique does not name", port.name), {},
               fmt::format("'{}' in heddle_technique.components", name));
    }
    complete_component_port(port, *component->type);
    return true;
  }

  void apply_port(const Role& role, Port& port) {
    const RolePort* contract = role.find_port(port.name);
    const bool is_block = port.type == PortType::kBuffer || port.type == PortType::kValue;
    if (contract == nullptr) {
      if (is_block && port.glsl.empty()) {
        complain(fmt::format("port '{}' is the technique's own and has no glsl", port.name), {},
                 "the members of the block as shaders see them");
      }
      return;
    }
    if (port.type != contract->type) {
      complain(fmt::format("port '{}' has another type than in the role", port.name), std::string(to_word(port.type)),
               std::string(to_word(contract->type)));
    }
    if (port.direction != contract->direction) {
      complain(fmt::format("port '{}' has another direction than in the role", port.name),
               std::string(to_word(port.direction)), std::string(to_word(contract->direction)));
    }
    if (port.is_list() != contract->is_list) {
      complain(fmt::format("port '{}' is {}, and in the role it is not", port.name,
                           port.is_list() ? "a list" : "a buffer of fixed length"),
               {}, contract->is_list ? "HEDDLE_PORT_LIST" : "no HEDDLE_PORT_LIST");
    }
    if (is_block && port.glsl.empty()) port.glsl = contract->glsl;
    if (port.help.empty()) port.help = contract->help;
  }

  const std::map<std::string, Role, std::less<>>& roles_;
  const ComponentCatalog& components_;
  std::string file_;
  std::string what_;
  std::vector<Diagnostic> problems_;
};

}  // namespace

Registry::Registry(std::vector<std::filesystem::path> folders) : folders_(std::move(folders)) {
  // All roles first: a folder may bring techniques for the roles of another.
  std::vector<fs::path> role_folders;
  for (const fs::path& folder : folders_) {
    for (const fs::path& entry : sorted_entries(folder)) {
      if (!fs::is_directory(entry)) continue;
      if (entry.filename() == "shared") {
        shared_folders_.push_back(entry);
        continue;
      }
      role_folders.push_back(entry);
      const fs::path file = entry / "role.toml";
      if (roles_.count(entry.filename().string()) != 0 || !fs::exists(file)) continue;
      Role role = read_role(file);
      roles_.emplace(role.name, std::move(role));
    }
  }
  std::map<std::string, const Role*> declared;
  for (const auto& [name, role] : roles_) {
    for (const ComponentType& component : role.components) {
      const auto [first, is_new] = declared.emplace(component.name, &role);
      if (!is_new) {
        throw Error(HEDDLE_BAD_INPUT, fmt::format("two roles declare the component '{}': {} and {}", component.name,
                                                  first->second->file.string(), role.file.string()));
      }
      components_.add(component);
    }
  }
  for (const fs::path& folder : role_folders) {
    for (Manifest& found : read_manifests(folder)) {
      const auto& manifest = manifests_.emplace_back(std::make_unique<Manifest>(std::move(found)));
      stamps_.emplace(manifest.get(), stamp_of(manifest->library));
      Contract contract(roles_, components_, *manifest);
      for (const Technique& described : manifest->techniques) {
        const auto known = techniques_.find(described.id);
        if (known != techniques_.end()) {
          const fs::path first = known->second.manifest->folder.parent_path().parent_path();
          if (first != manifest->folder.parent_path().parent_path()) continue;  // the first folder wins
          throw Error(HEDDLE_BAD_INPUT,
                      fmt::format("two libraries bring the technique '{}': {} and {}", described.id,
                                  known->second.manifest->library.string(), manifest->library.string()));
        }
        const auto& completed = completed_.emplace_back(std::make_unique<Technique>(described));
        // Another ABI's technique is listed and refused when opened; its contract cannot be judged.
        if (manifest->abi_major == HEDDLE_ABI_MAJOR && manifest->abi_minor == HEDDLE_ABI_MINOR) {
          contract.apply(*completed);
        }
        techniques_.emplace(described.id, TechniqueEntry{completed.get(), manifest.get()});
      }
      contract.finish();
    }
    left_out_.merge(read_left_out(folder));
  }
  // What another folder brings is there.
  std::erase_if(left_out_, [&](const auto& entry) { return techniques_.contains(entry.first); });
}

Registry::Stamp Registry::stamp_of(const fs::path& library) {
  std::error_code error;
  Stamp stamp;
  stamp.time = fs::last_write_time(library, error);
  stamp.size = fs::file_size(library, error);
  return stamp;
}

void Registry::refresh() {
  Registry fresh(folders_);
  shared_folders_ = std::move(fresh.shared_folders_);
  for (auto role = roles_.begin(); role != roles_.end();) {
    const auto found = fresh.roles_.find(role->first);
    const auto here = role++;
    if (found == fresh.roles_.end() || !(found->second == here->second)) {
      former_roles_.push_back(roles_.extract(here));
    }
  }
  roles_.merge(fresh.roles_);
  components_ = {};
  for (const auto& [name, role] : roles_)
    for (const ComponentType& component : role.components) components_.add(component);
  std::map<std::string, TechniqueEntry, std::less<>> techniques = std::move(fresh.techniques_);
  for (auto& [id, entry] : techniques) {
    const auto known = techniques_.find(id);
    if (known == techniques_.end()) continue;
    const Manifest& old = *known->second.manifest;
    const bool is_same = *known->second.technique == *entry.technique && old.library == entry.manifest->library &&
                         old.folder == entry.manifest->folder && old.abi_major == entry.manifest->abi_major &&
                         old.abi_minor == entry.manifest->abi_minor &&
                         stamps_.at(&old) == fresh.stamps_.at(entry.manifest);
    if (is_same) entry = known->second;
  }
  techniques_ = std::move(techniques);
  std::ranges::move(fresh.manifests_, std::back_inserter(manifests_));
  std::ranges::move(fresh.completed_, std::back_inserter(completed_));
  stamps_.merge(fresh.stamps_);
}

const Role* Registry::find_role(std::string_view name) const {
  const auto found = roles_.find(name);
  return found == roles_.end() ? nullptr : &found->second;
}

TechniqueEntry Registry::find(std::string_view id) const {
  const auto found = techniques_.find(id);
  return found == techniques_.end() ? TechniqueEntry{} : found->second;
}

std::vector<const Technique*> Registry::techniques() const {
  std::vector<const Technique*> list;
  for (const auto& [id, entry] : techniques_) list.push_back(entry.technique);
  return list;
}

std::vector<std::string> Registry::technique_names(std::string_view role) const {
  std::vector<std::string> names;
  for (const auto& [id, entry] : techniques_) {
    if (entry.technique->role_name() == role) names.emplace_back(entry.technique->name());
  }
  return names;
}

std::shared_ptr<Library> Registry::open(const TechniqueEntry& entry) {
  std::weak_ptr<Library>& place = open_[entry.manifest];
  if (std::shared_ptr<Library> library = place.lock()) return library;
  auto library = std::make_shared<Library>(*entry.manifest);
  place = library;
  return library;
}

std::string Registry::content_hash(const TechniqueEntry& entry) const {
  const auto place = open_.find(entry.manifest);
  const std::shared_ptr<Library> library = place == open_.end() ? nullptr : place->second.lock();
  return library ? library->content_hash() : hash_of_file(entry.manifest->library).value_or("");
}

}  // namespace heddle
