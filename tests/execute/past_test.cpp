// SPDX-License-Identifier: Apache-2.0
// What a frame reads of the last one, against closed forms over several frames, with cuts.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <nlohmann/json.hpp>

namespace {

using namespace rendering;

constexpr const char* kExtent = "extent = [16, 8]\noutput = \"show.color\"\n";
// Of the test role's color.
constexpr std::array kNeutral{0.25F, 0.5F, 0.75F, 1.0F};

std::string pass(const std::string& name, const std::string& technique, const std::string& more = {}) {
  return "[[pass]]\nname = \"" + name + "\"\nrole = \"past\"\ntechnique = \"" + technique + "\"\n" + more;
}
std::string graph_of(const std::string& passes) {
  return kExtent + passes;
}
std::string average_text() {
  return graph_of(pass("average", "average") + pass("show", "show", "inputs.image = \"average.color\"\n"));
}

Image frame(Graph& graph, Scene& scene, bool is_cut = false) {
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.cut = is_cut ? 1 : 0;
  check(heddle_render(graph.handle, scene.handle, &options));
  return graph.read();
}

std::uint64_t counter(Graph& graph, const char* name) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text)["counters"][name].get<std::uint64_t>();
}

std::uint64_t stat(Graph& graph, const char* name) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text)[name].get<std::uint64_t>();
}

/// After k frames: value + (neutral - value) (1 - weight)^k. All numbers are dyadic, so float32 is exact.
void expect_average(const Image& image, int frames, float value = 1.0F) {
  for (std::uint32_t channel = 0; channel < 4; ++channel) {
    const float expected = value + (kNeutral[channel] - value) * std::ldexp(1.0F, -frames);
    for (std::uint32_t x = 0; x < 16; ++x)
      EXPECT_EQ(image.at(x, x % 8, channel), expected) << "frame " << frames << ", channel " << channel;
  }
}

TEST(History, IsLastFramesContentAndNeutralInTheFirst) {
  Scene scene;
  Graph graph(average_text());
  for (int k = 1; k <= 5; ++k) expect_average(frame(graph, scene), k);
}

TEST(History, IsNeutralAfterACut) {
  Scene scene;
  Graph graph(average_text());
  for (int k = 1; k <= 3; ++k) expect_average(frame(graph, scene), k);
  expect_average(frame(graph, scene, true), 1);
  for (int k = 2; k <= 4; ++k) expect_average(frame(graph, scene), k);
}

TEST(History, OutlivesParametersAndANewPlan) {
  Scene scene;
  Graph graph(average_text());
  expect_average(frame(graph, scene), 1);
  graph.set("average.params.value=1.0");
  expect_average(frame(graph, scene), 2);
  graph.keep("average.color");  // plans anew
  expect_average(frame(graph, scene), 3);
}

TEST(History, StaysWhenItsStageKeepsItsOutputs) {
  Scene scene;
  Graph graph(average_text());
  for (int k = 1; k <= 2; ++k) expect_average(frame(graph, scene), k);
  graph.set("average.params.is_asleep=true");
  for (int k = 0; k < 3; ++k) expect_average(frame(graph, scene), 2);
  graph.set("average.params.is_asleep=false");
  expect_average(frame(graph, scene), 3);
}

TEST(History, OfAnotherPassBelowClosesNoCycle) {
  Scene scene;
  Graph graph(
      graph_of(pass("show", "show", "inputs.image = \"average.color@previous\"\n") + pass("average", "average")));
  const Image first = frame(graph, scene);
  for (std::uint32_t channel = 0; channel < 4; ++channel) EXPECT_EQ(first.at(3, 3, channel), kNeutral[channel]);
  for (int k = 1; k <= 4; ++k) expect_average(frame(graph, scene), k);
}

TEST(History, TakesTurnsWithoutACopyWhereAllIsRewritten) {
  Scene scene;
  Graph graph(average_text());
  for (int k = 0; k < 3; ++k) frame(graph, scene);
  // Two passes, one dispatch each; a history costs no command but a barrier.
  EXPECT_EQ(counter(graph, "dispatches"), 2U);
  EXPECT_EQ(counter(graph, "submits"), 1U);
}

TEST(History, LeavesWhatIsWrittenInPartsWhereItWas) {
  // Each frame writes one column; a reader of its past must not make the others forget.
  Scene scene;
  Graph graph(
      graph_of(pass("columns", "columns") + pass("show", "show", "inputs.image = \"columns.color@previous\"\n")));
  graph.keep("columns.color");
  for (int k = 0; k < 6; ++k) {
    const bool is_cut = k == 4;
    const Image shown = frame(graph, scene, is_cut);
    const Image kept = graph.read("columns.color");
    for (int x = 0; x < 16; ++x) {
      const auto column = static_cast<std::uint32_t>(x);
      EXPECT_EQ(kept.at(column, 2), x <= k ? static_cast<float>(x) + 1.0F : kNeutral[0]) << "frame " << k;
      EXPECT_EQ(shown.at(column, 2), x < k && !is_cut ? static_cast<float>(x) + 1.0F : kNeutral[0]) << "frame " << k;
    }
  }
}

TEST(History, OfABufferStartsWithZeroBytes) {
  Scene scene;
  Graph graph("extent = [16, 8]\noutput = \"count.color\"\n" + pass("count", "count"));
  for (int k = 1; k <= 5; ++k) {
    const bool is_cut = k == 4;
    const Image image = frame(graph, scene, is_cut);
    for (std::uint32_t i = 0; i < 16; ++i)
      EXPECT_EQ(image.at(i, 0), static_cast<float>((i + 1) * (k < 4 ? k : k - 3))) << "frame " << k;
  }
}

TEST(History, OfValuesIsEmptyFirstThenWhatTheyWere) {
  Scene scene;
  scene.add_light(light(HEDDLE_LIGHT_POINT));
  Graph graph("extent = [16, 8]\noutput = \"values.color\"\n" +
              pass("values", "values",
                   "inputs.last_camera = \"scene.camera@previous\"\ninputs.last_lights = \"scene.lights@previous\"\n"));
  float last_half = 0;
  for (int k = 0; k < 5; ++k) {
    const bool is_cut = k == 3;
    const int since = is_cut || k > 3 ? k - 3 : k;
    scene.look({static_cast<double>(k), 0, 0}, {static_cast<double>(k), 0, -1}, 0.5 + 0.25 * k);
    if (k == 1) scene.add_light(light(HEDDLE_LIGHT_POINT));
    const Image image = frame(graph, scene, is_cut);
    EXPECT_FLOAT_EQ(image.at(0, 0, 1), static_cast<float>(std::tan(0.25 + 0.125 * k)));
    EXPECT_EQ(image.at(0, 0, 3), since == 0 ? 0.0F : last_half) << "frame " << k;
    last_half = image.at(0, 0, 1);
    EXPECT_EQ(image.at(1, 0), since == 0 ? 0.0F : k == 1 ? 1.0F : 2.0F) << "frame " << k;
    EXPECT_EQ(image.at(2, 0, 0), static_cast<float>(since + 1)) << "frame " << k;
    EXPECT_EQ(image.at(2, 0, 1), since == 0 ? 0.0F : 4.0F) << "the CPU sees an empty value at first";
    EXPECT_EQ(image.at(2, 0, 2), static_cast<float>(since)) << "frame " << k;
    EXPECT_EQ(image.at(3, 0, 0), since == 0 ? 0.0F : 1.0F) << "the origin moved one metre";
    EXPECT_EQ(image.at(3, 0, 1), since == 0 ? 1.0F : 0.0F);
  }
}

TEST(Latency, BringsEveryFrameExactlyTwoFramesLater) {
  Scene scene;
  Graph graph("extent = [16, 8]\noutput = \"late.color\"\n" + pass("late", "late"));
  int cut = 0;
  const char* text = nullptr;
  for (int k = 0; k < 10; ++k) {
    if (k == 5) cut = k;
    const Image image = frame(graph, scene, k == 5);
    const bool has_arrived = k >= cut + 2;
    EXPECT_EQ(image.at(9, 3, 0), has_arrived ? static_cast<float>(k - 2 + 1) : 0.0F) << "frame " << k;
    EXPECT_EQ(image.at(9, 3, 1), has_arrived ? static_cast<float>(3 * (k - 2) + 5) : 0.0F) << "frame " << k;
    EXPECT_EQ(image.at(9, 3, 2), has_arrived ? static_cast<float>(3 * (k - 2) + 7) : 0.0F) << "frame " << k;
    EXPECT_EQ(image.at(9, 3, 3), has_arrived ? 0.0F : 1.0F) << "what is not there reads as zeros";
    // The first frame uploads the scene too.
    if (k > 0) {
      EXPECT_EQ(counter(graph, "submits"), 1U);
    }
    EXPECT_EQ(stat(graph, "stalls"), 0U);
    check(heddle_stats(graph.handle, &text));
    const auto late = parsed::json(text)["late"];
    EXPECT_EQ(late["mode"], "repeatable");
    EXPECT_EQ(late["waits"], 1) << "for the frame's end";
    EXPECT_EQ(late["reads"], 2);
    EXPECT_EQ(late["stale"], 0);
  }
}

TEST(Latency, OfZeroSplitsTheFrame) {
  Scene scene;
  Graph graph("extent = [16, 8]\noutput = \"prompt.color\"\n" + pass("prompt", "prompt"));
  for (int k = 0; k < 3; ++k) {
    const Image image = frame(graph, scene);
    EXPECT_EQ(image.at(9, 3, 0), static_cast<float>(k + 1));
    EXPECT_EQ(image.at(9, 3, 1), static_cast<float>(3 * k + 5));
    EXPECT_EQ(image.at(9, 3, 2), static_cast<float>(3 * k + 7));
    if (k > 0) {
      EXPECT_EQ(counter(graph, "submits"), 2U);
    }
    EXPECT_EQ(stat(graph, "stalls"), 1U);
  }
}

TEST(History, NobodyReadsCostsNothing) {
  Scene scene;
  Graph alone(graph_of(pass("columns", "columns") + pass("show", "show", "inputs.image = \"columns.color\"\n")));
  Graph read(graph_of(pass("columns", "columns") + pass("show", "show", "inputs.image = \"columns.color\"\n") +
                      pass("unused", "show", "inputs.image = \"columns.color@previous\"\n")));
  frame(alone, scene);
  frame(read, scene);
  const char* text = nullptr;
  check(heddle_stats(alone.handle, &text));
  const auto expected = parsed::json(text)["memory"];
  check(heddle_stats(read.handle, &text));
  EXPECT_EQ(parsed::json(text)["memory"], expected);
  EXPECT_EQ(counter(read, "commands"), counter(alone, "commands"));
}

}  // namespace
