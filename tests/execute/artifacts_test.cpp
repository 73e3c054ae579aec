// SPDX-License-Identifier: Apache-2.0
// Cached stages through the C API: what is kept is used instead of work, by other hosts too; what the key holds, and
// that a stage cannot see anything else; damage, cancelling, folders that cannot be written.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <heddle/heddle.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// A host with a cache of the test's own.
class Host {
 public:
  explicit Host(const fs::path& cache, std::uint32_t flags = 0) {
    const std::string plugins = HEDDLE_BUILD_DIR "/lib/heddle/plugins:" HEDDLE_BUILD_DIR "/tests/plugins";
    heddle_host_options options{};
    options.struct_size = sizeof options;
    options.flags = flags;
    options.plugin_path = plugins.c_str();
    options.cache_path = cache.c_str();
    options.log = [](void* user, std::uint32_t severity, const char* text) {
      Host& self = *static_cast<Host*>(user);
      self.log.emplace_back(std::to_string(severity) + ": " + text);
      if (!self.cancel_at.empty() && self.log.back().find(self.cancel_at) != std::string::npos)
        heddle_cancel(self.handle);
    };
    options.log_user = this;
    EXPECT_EQ(heddle_create(&options, &handle), HEDDLE_OK) << heddle_error(nullptr);
    EXPECT_EQ(heddle_scene_create(handle, &scene), HEDDLE_OK);
  }
  ~Host() {
    heddle_graph_destroy(graph);
    heddle_scene_destroy(scene);
    heddle_destroy(handle);
  }
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  void load(const std::vector<std::string>& settings = {}) {
    constexpr const char* kGraph =
        "extent = [8, 8]\noutput = \"sum.color\"\n"
        "[[pass]]\nname = \"numbers\"\nrole = \"bake\"\ntechnique = \"numbers\"\n"
        "[[pass]]\nname = \"sum\"\nrole = \"bake\"\ntechnique = \"sum\"\ninputs.numbers = \"numbers.numbers\"\n";
    std::vector<const char*> given;
    for (const std::string& setting : settings) given.push_back(setting.c_str());
    heddle_graph_destroy(graph);
    graph = nullptr;
    ASSERT_EQ(heddle_graph_parse(handle, kGraph, "bake.toml", "", given.data(),
                                 static_cast<std::uint32_t>(given.size()), &graph),
              HEDDLE_OK)
        << heddle_error(handle);
  }
  /// The first pixel of a frame: total, table[1], list[1], list[2].
  std::vector<float> render(const heddle_render_options* options = nullptr) {
    EXPECT_EQ(heddle_render(graph, scene, options), HEDDLE_OK) << heddle_error(handle);
    heddle_image image{};
    image.struct_size = sizeof image;
    EXPECT_EQ(heddle_read(graph, nullptr, 0, 0, &image), HEDDLE_OK) << heddle_error(handle);
    return {image.pixels, image.pixels + 4};
  }
  Json artifact() {
    const char* text = nullptr;
    EXPECT_EQ(heddle_stats(graph, &text), HEDDLE_OK);
    const Json all = Json::parse(text)["artifacts"];
    return all.size() == 1 ? all[0] : all;
  }
  [[nodiscard]] std::ptrdiff_t slices() const {
    return std::ranges::count_if(log, [](const std::string& line) { return line.find("slice") != std::string::npos; });
  }

  heddle_host* handle = nullptr;
  heddle_scene* scene = nullptr;
  heddle_graph* graph = nullptr;
  std::vector<std::string> log;
  std::string cancel_at;
};

class Artifacts : public testing::Test {
 protected:
  Artifacts() : cache_(fs::path(testing::TempDir()) / ("heddle_artifacts_" + std::to_string(getpid()))) {
    fs::remove_all(cache_);
  }
  ~Artifacts() override { fs::remove_all(cache_); }
  [[nodiscard]] std::vector<fs::path> files() const {
    std::vector<fs::path> found;
    if (!fs::exists(cache_ / "artifacts")) return found;
    for (const auto& entry : fs::directory_iterator(cache_ / "artifacts")) found.push_back(entry.path());
    return found;
  }
  /// How a new process would find it: the origin, after checking the numbers against scale * (first + ... + first + 3).
  std::string origin(const std::vector<std::string>& settings, float expected, std::uint32_t flags = 0) {
    Host host(cache_, flags);
    host.load(settings);
    EXPECT_THAT(host.render(), testing::ElementsAre(expected, expected, expected, 0.0F));
    const std::string from = host.artifact()["origin"];
    EXPECT_EQ(host.slices(), from == "made" ? 4 : 0);
    return from;
  }

  fs::path cache_;
};

TEST_F(Artifacts, AreMadeOnceAndThenTakenFromTheCacheByOtherHosts) {
  EXPECT_EQ(origin({}, 10), "made");
  EXPECT_EQ(origin({}, 10), "cache");
  ASSERT_EQ(files().size(), 1U) << "no temporary file stays";
  Host host(cache_);
  host.load();
  host.render();
  const Json artifact = host.artifact();
  EXPECT_EQ(artifact["pass"], "sum");
  EXPECT_EQ(artifact["stage"], "sum");
  EXPECT_EQ(artifact["file"], files()[0].string());
  EXPECT_EQ(files()[0].filename(), artifact["key"].get<std::string>() + ".artifact");
  EXPECT_EQ(artifact["bytes"], 16 + 16 + 16);
}

TEST_F(Artifacts, AreKeptByInputsAndListedParametersAlone) {
  EXPECT_EQ(origin({}, 10), "made");
  EXPECT_EQ(origin({"sum.params.scale=2"}, 20), "made");
  EXPECT_EQ(origin({"numbers.params.first=2"}, 14), "made") << "the contents of an input";
  EXPECT_EQ(origin({"sum.params.unheeded=5"}, 10), "cache");
  EXPECT_EQ(origin({"sum.params.scale=2"}, 20), "cache");
  EXPECT_EQ(origin({"numbers.params.first=2"}, 14), "cache");
  EXPECT_EQ(files().size(), 3U);
}

TEST_F(Artifacts, FollowAParameterThatChangesBetweenFrames) {
  Host host(cache_);
  host.load();
  EXPECT_EQ(host.render()[0], 10);
  EXPECT_EQ(heddle_graph_set(host.graph, "sum.params.scale=3"), HEDDLE_OK);
  EXPECT_EQ(host.render()[0], 30);
  EXPECT_EQ(host.artifact()["origin"], "made");
  EXPECT_EQ(heddle_graph_set(host.graph, "sum.params.scale=1"), HEDDLE_OK);
  EXPECT_EQ(host.render()[0], 10);
  EXPECT_EQ(host.artifact()["origin"], "cache");
  EXPECT_EQ(host.slices(), 8);
}

TEST_F(Artifacts, SeeNothingOfTheFrame) {
  Host host(cache_);
  host.load();
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.time = 7;
  options.seed = 11;
  EXPECT_EQ(host.render(&options)[0], 10) << "time and seed are 0 where the result is kept";
}

TEST_F(Artifacts, RefuseWhatTheirKeyDoesNotHold) {
  const auto refused = [&](const std::string& question) {
    Host host(cache_);
    host.load({"sum.params.asks_for=" + question});
    EXPECT_EQ(heddle_render(host.graph, host.scene, nullptr), HEDDLE_BUG) << question;
    return std::string(heddle_error(host.handle));
  };
  const auto told = [](const std::string& what) {
    return "bake.toml:7:1: error: pass 'sum' (bake/sum): stage 'sum' is cached and asks for " + what +
           ", which its key does not hold\n  help:     this is a mistake of the technique, not of the graph";
  };
  EXPECT_EQ(refused("parameter"), told("parameter 'unheeded'"));
  EXPECT_EQ(refused("shape"), told("the shape of port 'color'"));
  EXPECT_EQ(refused("value"), told("value 'camera'"));
  EXPECT_EQ(refused("service"), told("the service of role 'surface_material'"));
  EXPECT_EQ(refused("file"), told("the file 'secret.txt'"));
  EXPECT_TRUE(files().empty()) << "nothing of it is kept";
}

TEST_F(Artifacts, ThatAreDamagedAreToldAndMadeAgain) {
  EXPECT_EQ(origin({}, 10), "made");
  const fs::path file = files().at(0);
  std::fstream(file, std::ios::binary | std::ios::in | std::ios::out).seekp(-3, std::ios::end).put('x');
  {
    Host host(cache_);
    host.load();
    EXPECT_THAT(host.render(), testing::ElementsAre(10.0F, 10.0F, 10.0F, 0.0F));
    EXPECT_EQ(host.artifact()["origin"], "made");
    EXPECT_THAT(host.log,
                testing::Contains("1: bake.toml:7:1: warning: pass 'sum' (bake/sum): the artifact " + file.string() +
                                  " is damaged: its bytes are not those that were written; it is made again"));
  }
  EXPECT_EQ(origin({}, 10), "cache");
}

TEST_F(Artifacts, OfACancelledStageAreNotKept) {
  Host host(cache_);
  host.load();
  host.cancel_at = "slice 1";
  EXPECT_EQ(heddle_render(host.graph, host.scene, nullptr), HEDDLE_CANCELLED);
  EXPECT_STREQ(heddle_error(host.handle), "error: stopped, as heddle_cancel asked for");
  EXPECT_EQ(host.slices(), 2) << "it stops where it asks";
  EXPECT_TRUE(files().empty());
  host.cancel_at.clear();
  EXPECT_EQ(host.render()[0], 10);
  EXPECT_EQ(host.slices(), 2 + 4);
}

TEST_F(Artifacts, AreMadeAgainWhenAskedFor) {
  EXPECT_EQ(origin({}, 10), "made");
  EXPECT_EQ(origin({}, 10, HEDDLE_HOST_REMAKE), "made");
  EXPECT_EQ(files().size(), 1U);
}

TEST_F(Artifacts, AreNeitherTakenNorKeptInCheckMode) {
  EXPECT_EQ(origin({}, 10), "made");
  Host host(cache_, HEDDLE_HOST_CHECK);
  host.load({"sum.params.scale=2"});
  host.render();
  EXPECT_EQ(host.slices(), 4);
  EXPECT_TRUE(host.artifact().empty());
  EXPECT_EQ(files().size(), 1U);
}

TEST_F(Artifacts, ThatCannotBeKeptAreAWarning) {
  fs::create_directories(cache_);
  std::ofstream(cache_ / "artifacts") << "a file where the folder should be";
  Host host(cache_);
  host.load();
  EXPECT_EQ(host.render()[0], 10);
  EXPECT_EQ(host.artifact()["file"], "");
  EXPECT_THAT(host.log, testing::Contains("1: bake.toml:7:1: warning: pass 'sum' (bake/sum): the artifact cache " +
                                          (cache_ / "artifacts").string() +
                                          " cannot be made: Not a directory; it will be made again next time"));
}

TEST_F(Artifacts, AreExplained) {
  Host host(cache_);
  host.load();
  const char* text = nullptr;
  ASSERT_EQ(heddle_graph_explain(host.graph, "text", &text), HEDDLE_OK);
  EXPECT_THAT(text, testing::HasSubstr("sum.sum   waits for the gpu: reads what it made this frame"
                                       "   an artifact, kept on disk by numbers, scale, asks_for\n"));
  ASSERT_EQ(heddle_graph_explain(host.graph, "json", &text), HEDDLE_OK);
  for (const Json& stage : Json::parse(text)["stages"])
    EXPECT_EQ(stage["cached_by"], stage["stage"] == "sum" ? Json({"scale", "asks_for"}) : Json()) << stage;
}

}  // namespace
