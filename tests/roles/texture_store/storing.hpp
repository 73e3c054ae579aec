// SPDX-License-Identifier: Apache-2.0
// What tests of stores need: a cache of their own, images on disk, a job that is run, tiles that are taken from its
// store.
#pragma once

#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <unistd.h>
#include <nlohmann/json.hpp>

#include <bit>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "texture_store.hpp"
#include "texture_tiles.hpp"

namespace storing {

namespace fs = std::filesystem;
using heddle::texture_tiles::Rgba8;
using rendering::check;
using rendering::Graph;
using rendering::Scene;
using Json = nlohmann::json;

/// A folder of the executable's own, empty at first, with the cache in it.
inline const fs::path& folder() {
  static const fs::path kFolder = fs::path(testing::TempDir()) / ("heddle_storing_" + std::to_string(getpid()));
  return kFolder;
}
inline const bool kHasCache = [] {
  fs::remove_all(folder());
  fs::create_directories(folder());
  setenv("HEDDLE_CACHE", (folder() / "cache").c_str(), 1);
  struct End : testing::Environment {
    void TearDown() override { fs::remove_all(folder()); }
  };
  testing::AddGlobalTestEnvironment(new End);
  return true;
}();

inline std::string job_text(const std::string& parameters) {
  return "kind = \"job\"\n[[pass]]\nname = \"store\"\nrole = \"texture_store\"\ntechnique = \"tiled\"\n" + parameters;
}

/// The file of a job's graph, for frame graphs to name.
inline std::string job_file(const std::string& name, const std::string& parameters) {
  std::ofstream(folder() / name) << job_text(parameters);
  return (folder() / name).string();
}

struct Made {
  heddle::texture_store::Store store;
  fs::path file;  // the store's
  Json report;    // rows
  [[nodiscard]] std::uint32_t levels(std::uint32_t texture) const {
    return static_cast<std::uint32_t>(std::countr_zero(store.textures[texture].extent / store.header.tile));
  }
  [[nodiscard]] std::vector<std::byte> bytes(std::uint32_t texture, std::uint32_t level, std::uint32_t x,
                                             std::uint32_t y) const {
    using namespace heddle::texture_store;
    std::vector<char> read(store.tile_bytes());
    std::ifstream stream(file, std::ios::binary);
    stream.seekg(static_cast<std::streamoff>(store.offset_of(texture, level, x, y)));
    stream.read(read.data(), static_cast<std::streamsize>(read.size()));
    const auto* first = reinterpret_cast<const std::byte*>(read.data());
    std::vector<std::byte> out(first, first + read.size());
    EXPECT_EQ(damage_of(store, store.mark_of(texture, level, x, y), out), "");
    out.resize(store.texel_bytes());
    return out;
  }
  /// With its border.
  [[nodiscard]] std::vector<Rgba8> tile(std::uint32_t texture, std::uint32_t level, std::uint32_t x,
                                        std::uint32_t y) const {
    std::vector<Rgba8> texels(std::size_t{store.pitch()} * store.pitch());
    const std::vector<std::byte> packed = bytes(texture, level, x, y);
    EXPECT_TRUE(heddle::block_compression::decode(store.header.compression, packed.data(), store.pitch(), store.pitch(),
                                                  first_byte(texels)));
    return texels;
  }
};

inline Made make(const std::string& parameters) {
  Scene scene;
  const Graph graph(job_text(parameters));
  const char* text = nullptr;
  check(heddle_job_run(graph.handle, scene.handle, nullptr, &text));
  Made made;
  const Json result = parsed::json(text);
  for (const Json& artifact : result["artifacts"]) {
    EXPECT_EQ(artifact["name"], "store.store");
    made.file = artifact["store"].get<std::string>();
  }
  made.report = result["reports"][0]["rows"];
  const void* data = nullptr;
  std::uint64_t size = 0;
  check(heddle_job_artifact(graph.handle, "store.store", &data, &size));
  const auto store = heddle::texture_store::store_of({static_cast<const std::byte*>(data), size});
  EXPECT_TRUE(store);
  if (store) made.store = *store;
  return made;
}

/// What goes wrong.
inline std::string mistake(const std::string& parameters) {
  Scene scene;
  const Graph graph(job_text(parameters));
  const char* text = nullptr;
  EXPECT_NE(heddle_job_run(graph.handle, scene.handle, nullptr, &text), HEDDLE_OK);
  return heddle_error(rendering::Host::get().handle);
}

}  // namespace storing
