// SPDX-License-Identifier: Apache-2.0
// For tests of what is kept on disk: a host with a cache of the test's own, which listens to what is said.
#pragma once

#include "parsed.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <heddle/heddle.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace heddle_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;

class CachedHost {
 public:
  explicit CachedHost(const fs::path& cache, std::uint32_t flags = 0) {
    const std::string plugins = HEDDLE_BUILD_DIR "/lib/heddle/plugins:" HEDDLE_BUILD_DIR "/tests/plugins";
    heddle_host_options options{};
    options.struct_size = sizeof options;
    options.flags = flags;
    options.plugin_path = plugins.c_str();
    options.cache_path = cache.c_str();
    options.log = [](void* user, std::uint32_t severity, const char* text) {
      CachedHost& self = *static_cast<CachedHost*>(user);
      self.log.emplace_back(std::to_string(severity) + ": " + text);
      if (!self.cancel_at.empty() && self.log.back().find(self.cancel_at) != std::string::npos)
        heddle_cancel(self.handle);
    };
    options.log_user = this;
    EXPECT_EQ(heddle_create(&options, &handle), HEDDLE_OK) << heddle_error(nullptr);
    EXPECT_EQ(heddle_scene_create(handle, &scene), HEDDLE_OK);
  }
  ~CachedHost() {
    heddle_graph_destroy(graph);
    heddle_scene_destroy(scene);
    heddle_destroy(handle);
  }
  CachedHost(const CachedHost&) = delete;
  CachedHost& operator=(const CachedHost&) = delete;

  heddle_status parse(const std::string& text, const std::string& name, const fs::path& folder,
                      const std::vector<std::string>& settings = {}) {
    std::vector<const char*> given;
    for (const std::string& setting : settings) given.push_back(setting.c_str());
    heddle_graph_destroy(graph);
    graph = nullptr;
    return heddle_graph_parse(handle, text.c_str(), name.c_str(), folder.c_str(), given.data(),
                              static_cast<std::uint32_t>(given.size()), &graph);
  }
  [[nodiscard]] std::string error() const { return heddle_error(handle); }
  /// The first pixel of a frame, four channels.
  std::vector<float> render(const heddle_render_options* options = nullptr) {
    EXPECT_EQ(heddle_render(graph, scene, options), HEDDLE_OK) << error();
    heddle_image image{};
    image.struct_size = sizeof image;
    EXPECT_EQ(heddle_read(graph, nullptr, 0, 0, &image), HEDDLE_OK) << error();
    return {image.pixels, image.pixels + 4};
  }
  Json artifacts() {
    const char* text = nullptr;
    EXPECT_EQ(heddle_stats(graph, &text), HEDDLE_OK);
    return parsed::json(text)["artifacts"];
  }
  [[nodiscard]] std::ptrdiff_t count_said(const std::string& what) const {
    return std::ranges::count_if(log, [&](const std::string& line) { return line.find(what) != std::string::npos; });
  }

  heddle_host* handle = nullptr;
  heddle_scene* scene = nullptr;
  heddle_graph* graph = nullptr;
  std::vector<std::string> log;
  std::string cancel_at;
};

/// A folder of the test's own, which goes with it.
class CacheTest : public testing::Test {
 protected:
  CacheTest()
      : folder_(fs::path(testing::TempDir()) / ("heddle_cache_" + std::to_string(getpid()))),
        cache_(folder_ / "cache") {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~CacheTest() override { fs::remove_all(folder_); }
  [[nodiscard]] std::vector<fs::path> files() const {
    std::vector<fs::path> found;
    if (!fs::exists(cache_ / "artifacts")) return found;
    for (const auto& entry : fs::directory_iterator(cache_ / "artifacts")) found.push_back(entry.path());
    return found;
  }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }

  fs::path folder_, cache_;
};

}  // namespace heddle_test
