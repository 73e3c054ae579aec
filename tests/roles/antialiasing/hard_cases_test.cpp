// SPDX-License-Identifier: Apache-2.0
// The hard cases of role antialiasing.
#include "roles/antialiasing/samples.hpp"

namespace {

using namespace antialiasing;

constexpr const char* kTechniques[] = {"supersampled", "multiframe"};

TEST(Antialiasing, H1OneSampleLeavesEveryBitAsItWas) {
  Scene scene;
  build(scene);
  Graph none(scene_text(), {"aa.technique=none", "output=lighting.radiance"});
  const Image expected = none.image(scene);
  const auto is_unchanged = [&](const std::vector<std::string>& settings, const std::string& what) {
    Graph one(scene_text(), settings);
    EXPECT_EQ(one.image(scene).pixels, expected.pixels) << what;
  };
  for (const std::string filter : {"box", "tent", "gaussian"}) {
    for (const std::string sequence : {"r2", "halton", "random"}) {
      is_unchanged({samples(1), "aa.params.sequence=" + sequence, "aa.params.filter=" + filter},
                   "supersampled: " + sequence + ", " + filter);
    }
    is_unchanged(at_once("multiframe", 1, {"aa.params.filter=" + filter}), "multiframe: " + filter);
  }
  // The first of many is in the centre too; a grid of an even number has no place there.
  for (const std::string kernel : {"poisson", "random", "r2", "halton"}) {
    for (const std::string accumulator : {"rgba32f", "float32_pair"}) {
      is_unchanged({"aa.technique=multiframe", samples(16), "aa.params.kernel=" + kernel,
                    "aa.params.accumulator=" + accumulator},
                   "the first of 16: " + kernel + ", " + accumulator);
    }
    is_unchanged({"aa.technique=multiframe", samples(16), "aa.params.kernel=" + kernel, "aa.params.accumulator=rgba32f",
                  "aa.params.accumulation=blend"},
                 "the first of 16: " + kernel + ", blended");
  }
}

TEST(Antialiasing, H2WhatIsTheSameInAllSamplesStaysTheSame) {
  Scene scene;
  Graph none(edge_text("constants"), {"aa.technique=none", "output=edge.radiance"});
  const Image expected = none.image(scene);
  EXPECT_GT(expected.at(63, 0), 1e6F);
  for (const int count : {2, 3, 7, 10, 16, 100, 333}) {
    for (const char* technique : kTechniques) {
      Graph graph(edge_text("constants"), at_once(technique, count));
      EXPECT_EQ(graph.image(scene).pixels, expected.pixels) << technique << ", " << count << " samples";
    }
    for (const char* setting : {"aa.params.accumulator=rgba32f", "aa.params.weighting=compressed"}) {
      Graph graph(edge_text("constants"), at_once("multiframe", count, {setting}));
      EXPECT_EQ(graph.image(scene).pixels, expected.pixels) << setting << ", " << count << " samples";
    }
  }
}

TEST(Antialiasing, H3SamplesThatAreNoNumbersAreLeftOut) {
  Scene scene;
  const auto are_left_out = [&](const std::vector<std::string>& settings, const std::string& what) {
    Graph graph(edge_text("broken", 16, 8), settings);
    const Image image = graph.image(scene);
    for (std::uint32_t x = 0; x < 16; ++x) {
      for (std::uint32_t channel = 0; channel < 4; ++channel)
        EXPECT_EQ(image.at(x, 3, channel), x == 4 || x == 5 ? 0.0F : 3.0F) << "column " << x << ", " << what;
    }
  };
  for (const int count : {2, 16, 61}) {
    for (const char* technique : kTechniques) are_left_out(at_once(technique, count), technique);
    for (const std::string setting : {"accumulator=rgba32f", "accumulator=rgba16f", "weighting=compressed"})
      are_left_out(at_once("multiframe", count, {"aa.params." + setting}), setting);
  }
}

TEST(Antialiasing, H4RoundingDoesNotGrowWithTheNumberOfSamples) {
  Scene scene;
  constexpr int kCount = 4096;
  for (const char* technique : kTechniques) {
    Graph graph(edge_text("steps", 16, 8), at_once(technique, kCount));
    const Image image = graph.image(scene);
    for (std::uint32_t x = 0; x < 16; ++x) {
      double sum = 0;
      for (std::uint32_t i = 0; i < kCount; ++i) sum += 1000.0 + ((i * 7919U + x * 131U) % 1024U) / 1024.0;
      // The mean's own rounding to float32, half a unit in the last place of 1000; a plain sum is off by 2e-2.
      EXPECT_NEAR(static_cast<double>(image.at(x, 3)), sum / kCount, 0x1p-15) << technique << ", column " << x;
    }
    Graph constants(edge_text("constants", 64, 8), at_once(technique, kCount));
    Graph none(edge_text("constants", 64, 8), {"aa.technique=none", "output=edge.radiance"});
    EXPECT_EQ(constants.image(scene).pixels, none.image(scene).pixels) << technique;
  }
}

TEST(Antialiasing, H5TheSameFrameTwiceGivesTheSameBytes) {
  Scene scene;
  build(scene);
  for (const char* technique : kTechniques) {
    Graph graph(scene_text(), at_once(technique, 8));
    const Image first = graph.image(scene);
    render(graph, scene, HEDDLE_RENDER_ANEW);
    EXPECT_EQ(graph.read().pixels, first.pixels) << technique;
    Graph other(scene_text(), at_once(technique, 8));
    EXPECT_EQ(other.image(scene).pixels, first.pixels) << technique;
  }
}

}  // namespace
