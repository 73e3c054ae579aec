// SPDX-License-Identifier: Apache-2.0
// heddle-manifest LIBRARY OUT.json: a plugin library -> the manifest beside it. Run by the build.
#include <dlfcn.h>

#include <cstdio>
#include <fstream>

#include "diagnostics.hpp"
#include "plugin/technique.hpp"

namespace {

void write_manifest(const std::filesystem::path& library, const std::filesystem::path& out) {
  // Never closed: the process ends, and libraries that keep threads would crash.
  void* handle = dlopen(std::filesystem::absolute(library).c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) throw heddle::Error(HEDDLE_FAILED, dlerror());
  const auto entry = reinterpret_cast<heddle_entry_function>(dlsym(handle, "heddle_entry"));
  if (entry == nullptr) throw heddle::Error(HEDDLE_BUG, library.string() + " exports no heddle_entry");

  heddle::Manifest manifest;
  manifest.library = library;
  const heddle_plugin* plugin = entry();
  manifest.techniques = heddle::from_plugin(plugin, library.string());
  manifest.abi_major = plugin->abi_major;
  manifest.abi_minor = plugin->abi_minor;

  std::filesystem::path temporary = out;
  temporary += ".new";
  std::ofstream stream(temporary, std::ios::binary);
  stream << heddle::to_json(manifest);
  stream.close();
  if (!stream) throw heddle::Error(HEDDLE_FAILED, "cannot write " + temporary.string());
  std::filesystem::rename(temporary, out);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: heddle-manifest LIBRARY OUT.json\n", stderr);
    return HEDDLE_BAD_INPUT;
  }
  try {
    write_manifest(argv[1], argv[2]);
    return HEDDLE_OK;
  } catch (const heddle::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.status();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return HEDDLE_FAILED;
  }
}
