// SPDX-License-Identifier: Apache-2.0
// Which roles and techniques there are, known from role.toml files and manifests alone, and the libraries that are
// open.
#pragma once

#include "plugin/technique.hpp"

#include <map>
#include <memory>
#include <span>

namespace heddle {

/// An open plugin library. Opened from a private copy, checked against its manifest; third-party libraries that came
/// with it are pinned, the plugin itself is really unmapped by the destructor.
class Library {
 public:
  explicit Library(const Manifest& manifest);
  ~Library();
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  [[nodiscard]] const heddle_technique& descriptor(std::string_view technique_id) const;
  /// Of the file that was opened: another build, another hash.
  [[nodiscard]] const std::string& content_hash() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

struct TechniqueEntry {
  const Technique* technique = nullptr;
  const Manifest* manifest = nullptr;
};

class Registry {
 public:
  /// `folders`: each holds <role>/role.toml, <role>/<technique>/ with shaders, a library and its .manifest.json, and
  /// shared/. A technique found in two folders: the first wins. A folder <role>/<technique>/ with left_out.txt in place
  /// of a library: the build could not make it, for the reason in that file. Throws Error naming a broken file.
  explicit Registry(std::vector<std::filesystem::path> folders);

  [[nodiscard]] const std::map<std::string, Role, std::less<>>& roles() const { return roles_; }
  [[nodiscard]] const Role* find_role(std::string_view name) const;
  /// "ambient_occlusion/gtao" -> entry, or nullptrs.
  [[nodiscard]] TechniqueEntry find(std::string_view id) const;
  [[nodiscard]] std::vector<const Technique*> techniques() const;                       // sorted by id
  [[nodiscard]] std::vector<std::string> technique_names(std::string_view role) const;  // without the role, sorted
  /// Techniques that their build had to leave out, by id, and why.
  [[nodiscard]] const std::map<std::string, std::string, std::less<>>& left_out() const { return left_out_; }
  /// Every component that a role declares.
  [[nodiscard]] const ComponentCatalog& components() const { return components_; }
  /// Folders with shared GLSL ("shared/" of each plugin folder), in order of search.
  [[nodiscard]] std::span<const std::filesystem::path> shared_folders() const { return shared_folders_; }

  /// Reads the folders again. Techniques and roles that changed are other objects from now on, as are techniques whose
  /// library was built again; what did not change stays the same object. Those of before live as long as the registry:
  /// graphs may still use them. Throws as the constructor does, and then nothing has changed.
  void refresh();

  /// The open library of a technique; opened when nobody has it, closed when the last holder lets go.
  /// Sharers: the passes of all graphs of a host.
  std::shared_ptr<Library> open(const TechniqueEntry& entry);
  /// Of the library that open would answer with; opens none.
  [[nodiscard]] std::string content_hash(const TechniqueEntry& entry) const;

 private:
  struct Stamp {  // of a library's file
    std::filesystem::file_time_type time;
    std::uintmax_t size = 0;
    bool operator==(const Stamp&) const = default;
  };
  static Stamp stamp_of(const std::filesystem::path& library);

  std::vector<std::filesystem::path> folders_;
  std::map<std::string, Role, std::less<>> roles_;
  ComponentCatalog components_;
  std::vector<std::unique_ptr<Manifest>> manifests_;   // as the libraries describe themselves
  std::vector<std::unique_ptr<Technique>> completed_;  // the same, with what their roles add
  std::map<std::string, TechniqueEntry, std::less<>> techniques_;
  std::map<std::string, std::string, std::less<>> left_out_;
  std::vector<std::filesystem::path> shared_folders_;
  std::map<const Manifest*, std::weak_ptr<Library>> open_;
  std::map<const Manifest*, Stamp> stamps_;
  std::vector<std::map<std::string, Role, std::less<>>::node_type> former_roles_;
};

}  // namespace heddle
