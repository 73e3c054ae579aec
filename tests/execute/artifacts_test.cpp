// SPDX-License-Identifier: Apache-2.0
// Cached stages through the C API: what is kept is used instead of work, by other hosts too; what the key holds, and
// that a stage cannot see anything else; damage, cancelling, folders that cannot be written.
#include "execute/cached_host.hpp"
#include "parsed.hpp"

namespace {

using heddle_test::CachedHost;
using heddle_test::Json;
namespace fs = std::filesystem;

class Host : public CachedHost {
 public:
  using CachedHost::CachedHost;
  void load(const std::vector<std::string>& settings = {}) {
    constexpr const char* kGraph =
        "extent = [8, 8]\noutput = \"sum.color\"\n"
        "[[pass]]\nname = \"numbers\"\nrole = \"bake\"\ntechnique = \"numbers\"\n"
        "[[pass]]\nname = \"sum\"\nrole = \"bake\"\ntechnique = \"sum\"\ninputs.numbers = \"numbers.numbers\"\n";
    ASSERT_EQ(parse(kGraph, "bake.toml", "", settings), HEDDLE_OK) << error();
  }
  Json artifact() {
    const Json all = artifacts();
    return all.size() == 1 ? all[0] : all;
  }
  [[nodiscard]] std::ptrdiff_t slices() const { return count_said("slice"); }
};

class Artifacts : public heddle_test::CacheTest {
 protected:
  /// How a new process would find it: the origin, after checking the numbers against scale * (first + ... + first + 3).
  std::string origin(const std::vector<std::string>& settings, float expected, std::uint32_t flags = 0) {
    Host host(cache_, flags);
    host.load(settings);
    EXPECT_THAT(host.render(), testing::ElementsAre(expected, expected, expected, 0.0F));
    const std::string from = host.artifact()["origin"];
    EXPECT_EQ(host.slices(), from == "made" ? 4 : 0);
    return from;
  }
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
  const Json stages = parsed::json(text)["stages"];
  EXPECT_FALSE(stages.empty());
  for (const Json& stage : stages)
    EXPECT_EQ(stage["cached_by"], stage["stage"] == "sum" ? Json({"scale", "asks_for"}) : Json()) << stage;
}

}  // namespace
