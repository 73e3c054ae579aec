// SPDX-License-Identifier: Apache-2.0
// Manifest -> an open plugin. Each opening maps a private copy of the file, so that a library that was built again is
// really loaded again; closing unmaps the plugin and leaves the third-party libraries that came with it, whose threads
// may still be running.
#include <dlfcn.h>
#include <link.h>
#include <unistd.h>

#include <algorithm>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "content_hash.hpp"
#include "diagnostics.hpp"
#include "plugin/registry.hpp"
#include "plugin/technique_json.hpp"

namespace heddle {
namespace {

namespace fs = std::filesystem;

// Names of private copies begin with this; other plugins' copies are told from third-party libraries by it.
constexpr std::string_view kCopyPrefix = "heddle-";
constexpr std::string_view kCopySuffix = ".heddle-plugin";

bool is_private_copy(std::string_view path) {
  return path.ends_with(kCopySuffix);
}

std::set<std::string> loaded_libraries() {
  std::set<std::string> names;
  dl_iterate_phdr(
      [](dl_phdr_info* info, std::size_t, void* out) {
        // The program itself has no name.
        if (info->dlpi_name != nullptr && *info->dlpi_name != '\0') {
          static_cast<std::set<std::string>*>(out)->insert(info->dlpi_name);
        }
        return 0;
      },
      &names);
  return names;
}

Error failure(const fs::path& library, heddle_status status, std::string message, std::string found = {},
              std::string expected = {}, std::string help = {}) {
  Diagnostic diagnostic;
  diagnostic.where.file = library.string();
  diagnostic.message = std::move(message);
  diagnostic.found = std::move(found);
  diagnostic.expected = std::move(expected);
  diagnostic.help = std::move(help);
  return {status, std::move(diagnostic)};
}

/// A copy of a library under a name of its own; the file goes as soon as it is mapped.
class PrivateCopy {
 public:
  explicit PrivateCopy(const fs::path& library) {
    // The plugin's name stays in the copy's, for /proc/self/maps, debuggers and profilers.
    path_ =
        fs::temp_directory_path() / fmt::format("{}XXXXXX-{}{}", kCopyPrefix, library.filename().string(), kCopySuffix);
    const auto suffix = static_cast<int>(library.filename().string().size() + 1 + kCopySuffix.size());
    const int file = mkstemps(path_.data(), suffix);
    if (file < 0) {
      throw failure(library, HEDDLE_FAILED, "cannot make a private copy of this library", path_, "a writable folder",
                    "set TMPDIR to a folder where files can be written and run");
    }
    close(file);
    std::error_code error;
    fs::copy_file(library, path_, fs::copy_options::overwrite_existing, error);
    if (error) {
      unlink(path_.c_str());
      throw failure(library, HEDDLE_FAILED, "cannot make a private copy of this library", error.message());
    }
  }
  ~PrivateCopy() { unlink(path_.c_str()); }
  PrivateCopy(const PrivateCopy&) = delete;
  PrivateCopy& operator=(const PrivateCopy&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// "ports/1/help" and the two values there, for the first place in which two documents differ.
struct Difference {
  std::string path, manifest, library;
};

std::optional<Difference> first_difference(const Json& manifest, const Json& library, const std::string& path) {
  if (manifest == library) return std::nullopt;
  if (manifest.is_object() && library.is_object()) {
    for (const auto& [key, value] : manifest.items()) {
      if (auto found = first_difference(value, library.at(key), path.empty() ? key : path + "/" + key)) return found;
    }
  }
  if (manifest.is_array() && library.is_array()) {
    for (std::size_t i = 0; i < std::min(manifest.size(), library.size()); ++i) {
      if (auto found = first_difference(manifest[i], library[i], fmt::format("{}/{}", path, i))) return found;
    }
    return Difference{path, fmt::format("{} elements", manifest.size()), fmt::format("{} elements", library.size())};
  }
  return Difference{path, write_json(manifest), write_json(library)};
}

void compare(const Manifest& manifest, const std::vector<Technique>& techniques) {
  const std::string help = "build the plugin again: its manifest is not that of this library";
  if (techniques.size() != manifest.techniques.size()) {
    throw failure(manifest.library, HEDDLE_BAD_INPUT, "library and manifest disagree in the number of techniques",
                  fmt::format("{} in the library", techniques.size()),
                  fmt::format("{} as the manifest says", manifest.techniques.size()), help);
  }
  for (std::size_t i = 0; i < techniques.size(); ++i) {
    const auto difference =
        first_difference(technique_to_json(manifest.techniques[i]), technique_to_json(techniques[i]), "");
    if (difference) {
      throw failure(manifest.library, HEDDLE_BAD_INPUT,
                    fmt::format("technique '{}': library and manifest disagree in '{}'", manifest.techniques[i].id,
                                difference->path),
                    difference->library + " in the library", difference->manifest + " as the manifest says", help);
    }
  }
}

}  // namespace

struct Library::State {
  fs::path file;
  std::string copy, content_hash;
  void* handle = nullptr;
  std::set<std::string> before;  // libraries that were loaded when this plugin was not
  const heddle_plugin* plugin = nullptr;

  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  // Libraries that came with the plugin, or that it opened itself, stay for good: a thread of theirs may outlive every
  // object that the plugin destroyed (Embree's TBB workers do), and unmapping its code would crash it.
  ~State() {
    if (handle == nullptr) return;
    for (const std::string& name : loaded_libraries()) {
      if (name == copy || is_private_copy(name) || before.count(name) != 0) continue;
      if (void* pinned = dlopen(name.c_str(), RTLD_NOW | RTLD_NOLOAD | RTLD_NODELETE)) dlclose(pinned);
    }
    dlclose(handle);
  }
};

Library::Library(const Manifest& manifest) : state_(std::make_unique<State>()) {
  if (manifest.abi_major != HEDDLE_ABI_MAJOR || manifest.abi_minor != HEDDLE_ABI_MINOR) {
    throw failure(manifest.library, HEDDLE_UNSUPPORTED,
                  "this plugin was built for another version of Heddle's interface",
                  fmt::format("ABI {}.{}", manifest.abi_major, manifest.abi_minor),
                  fmt::format("ABI {}.{}", HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR),
                  "build the plugin again with this version's headers");
  }
  if (!fs::exists(manifest.library)) {
    throw failure(manifest.library, HEDDLE_FAILED, "the library of this manifest is missing", {}, {},
                  fmt::format("build the plugin again, or delete {}", manifest.folder.string()));
  }
  State& state = *state_;
  state.file = manifest.library;
  state.before = loaded_libraries();
  const PrivateCopy copy(manifest.library);
  state.copy = copy.path();
  state.handle = dlopen(copy.path().c_str(), RTLD_NOW | RTLD_LOCAL);
  if (state.handle == nullptr) {
    std::string reason = dlerror();
    // The copy's name means nothing to people.
    if (reason.starts_with(copy.path() + ": ")) reason.erase(0, copy.path().size() + 2);
    std::string help;
    if (reason.find("cannot open shared object file") != std::string::npos) {
      help = "install the library that is named, or build again: what this machine lacks is then left out";
    }
    throw failure(manifest.library, HEDDLE_FAILED, "cannot load this library", reason, {}, help);
  }
  const auto entry = reinterpret_cast<heddle_entry_function>(dlsym(state.handle, "heddle_entry"));
  if (entry == nullptr) {
    throw failure(manifest.library, HEDDLE_BUG, "this library exports no heddle_entry", {}, {},
                  "build plugins with heddle_plugin() of plugins/heddle_plugin.cmake");
  }
  state.content_hash = hash_of_file(copy.path()).value_or("");
  state.plugin = entry();
  compare(manifest, from_plugin(state.plugin, manifest.library.string()));
}

Library::~Library() = default;

const std::string& Library::content_hash() const {
  return state_->content_hash;
}

const heddle_technique& Library::descriptor(std::string_view technique_id) const {
  for (std::uint32_t i = 0; i < state_->plugin->technique_count; ++i) {
    if (technique_id == state_->plugin->techniques[i]->id) return *state_->plugin->techniques[i];
  }
  throw failure(state_->file, HEDDLE_BUG, fmt::format("this library has no technique '{}'", technique_id));
}

}  // namespace heddle
