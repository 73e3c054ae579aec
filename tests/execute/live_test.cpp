// SPDX-License-Identifier: Apache-2.0
// Live mode over a GPU that a test pass holds and lets go: what is late, what is stale, and that nothing waits.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <nlohmann/json.hpp>

namespace {

using namespace rendering;

const bool kIsLive = [] {
  Host::flags = HEDDLE_HOST_LIVE;
  return true;
}();

std::string pass(const std::string& name, const std::string& technique, const std::string& more = {}) {
  return "[[pass]]\nname = \"" + name + "\"\nrole = \"past\"\ntechnique = \"" + technique + "\"\n" + more;
}

struct Late {
  std::uint64_t waits = 0, reads = 0, stale = 0;
  bool operator==(const Late&) const = default;
};
std::ostream& operator<<(std::ostream& stream, const Late& late) {
  return stream << late.waits << " waits, " << late.reads << " reads, " << late.stale << " stale";
}

Late late_of(const nlohmann::json& json) {
  return {json["waits"].get<std::uint64_t>(), json["reads"].get<std::uint64_t>(), json["stale"].get<std::uint64_t>()};
}
nlohmann::json stats(Graph& graph) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text)["late"];
}

/// The frame that the CPU saw, + 1; 0: none.
float seen(Graph& graph) {
  const Image image = graph.read("held.color");
  EXPECT_EQ(image.at(9, 3, 1), image.at(9, 3, 0) == 0 ? 0.0F : 3 * (image.at(9, 3, 0) - 1) + 5);
  EXPECT_EQ(image.at(9, 3, 2), image.at(9, 3, 0) == 0 ? 0.0F : 3 * (image.at(9, 3, 0) - 1) + 7);
  return image.at(9, 3, 0);
}

const std::string kHeld = "extent = [16, 8]\noutput = \"held.color\"\n" + pass("held", "held");

TEST(Live, TakesTheNewestCopyThatIsThereAndWaitsForNothing) {
  ASSERT_TRUE(kIsLive);
  Scene scene;
  Graph graph(kHeld);
  graph.render(scene);
  EXPECT_EQ(seen(graph), 0.0F) << "reading waits, so frame 0 is over";
  graph.set("held.params.is_held=true");
  graph.render(scene);
  EXPECT_EQ(late_of(stats(graph)), (Late{0, 2, 0})) << "frame 0's copies are there";
  graph.set("held.params.is_held=false");
  graph.render(scene);
  EXPECT_EQ(late_of(stats(graph)), (Late{0, 2, 2})) << "frame 1 is held: frame 0 again";
  EXPECT_EQ(stats(graph)["mode"], "live");
  graph.set("held.params.released=1");
  graph.render(scene);
  EXPECT_EQ(late_of(stats(graph)), (Late{0, 2, 2})) << "frame 2 came after frame 1: frame 0 still";
  EXPECT_EQ(seen(graph), 1.0F) << "frame 3 shows what it saw: frame 0, of two frames before the one that was due";
  graph.render(scene);
  EXPECT_EQ(late_of(stats(graph)), (Late{0, 2, 0})) << "all were read, so all are over: frame 3 exactly";
  EXPECT_EQ(seen(graph), 4.0F);
  EXPECT_EQ(stats(graph)["total"]["stale"], 4);
}

TEST(Live, WaitsWhenMoreFramesThanHaveRoomAreInFlight) {
  Scene scene;
  Graph graph(kHeld);
  for (int k = 0; k < 8; ++k) {
    graph.render(scene);
    EXPECT_LE(late_of(stats(graph)).waits, 1U) << "the oldest frame, whose memory the next one takes";
  }
  const float last = seen(graph);
  EXPECT_GE(last, 8.0F - 3.0F) << "no more than two frames before the last were running";
  EXPECT_LE(last, 8.0F - 1.0F);
}

TEST(Live, FramesInFlightKeepTheirParametersAndValues) {
  Scene scene;
  Graph graph("extent = [16, 8]\noutput = \"show.color\"\n" + pass("held", "held") +
              pass("average", "average", "params.weight = 0.5\n") +
              pass("show", "show", "inputs.image = \"average.color\"\n"));
  graph.keep("held.color");
  graph.render(scene);
  EXPECT_EQ(seen(graph), 0.0F);
  graph.set("held.params.is_held=true");
  graph.set("average.params.value=3.0");
  graph.render(scene);  // held: its commands have not run when these numbers change
  graph.set("held.params.is_held=false");
  graph.set("average.params.value=5.0");
  graph.render(scene);
  graph.set("held.params.released=1");
  graph.set("average.params.value=7.0");
  graph.render(scene);
  const Image image = graph.read();
  // Neutral 0.25, then halfway to 1, 3, 5, 7: dyadic numbers, exact in float32.
  double expected = 0.25;
  for (const double value : {1.0, 3.0, 5.0, 7.0}) expected += 0.5 * (value - expected);
  EXPECT_EQ(image.at(4, 4), static_cast<float>(expected));
}

TEST(Live, FramesInFlightKeepTheirScene) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 1);
  Graph graph("extent = [16, 8]\noutput = \"gbuffer.depth\"\n" + pass("held", "held") +
              "[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\ntechnique = \"raster\"\n");
  graph.keep("held.color");
  const auto look = [&](double height) { scene.look({0, height, 0}, {0, 0, 0}, 0.5); };
  look(2);
  graph.render(scene);
  EXPECT_NEAR(graph.read("gbuffer.depth").at(8, 4), 2, 1e-6);
  graph.set("held.params.is_held=true");
  look(3);
  graph.render(scene);  // instances relative to the camera are on their way
  graph.set("held.params.is_held=false");
  graph.set("held.params.released=1");
  look(4);
  graph.render(scene);
  EXPECT_EQ(late_of(stats(graph)).waits, 0U) << "a moving camera waits for nothing";
  EXPECT_NEAR(graph.read("gbuffer.depth").at(8, 4), 4, 1e-6);
}

TEST(Live, ExplainsItself) {
  Graph graph(kHeld);
  const char* text = nullptr;
  check(heddle_graph_explain(graph.handle, "text", &text));
  EXPECT_NE(std::string(text).find("live: frames are not waited for, and no bytes are promised"), std::string::npos);
  EXPECT_NE(std::string(text).find("reads what the gpu made 1 frame ago, or earlier if that is not there yet"),
            std::string::npos);
  check(heddle_graph_explain(graph.handle, "json", &text));
  EXPECT_EQ(parsed::json(text)["mode"], "live");
}

TEST(Live, IsRefusedWhereFramesAreChecked) {
  heddle_host_options options{};
  options.struct_size = sizeof options;
  options.flags = HEDDLE_HOST_LIVE | HEDDLE_HOST_CHECK;
  heddle_host* host = nullptr;
  EXPECT_EQ(heddle_create(&options, &host), HEDDLE_BAD_INPUT);
  EXPECT_STREQ(
      heddle_error(nullptr),
      "error: a host that checks its frames cannot be live\n  help:     leave out one of the two: what is proven "
      "is proven of frames that repeat");
}

}  // namespace
