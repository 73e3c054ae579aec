// SPDX-License-Identifier: Apache-2.0
// The hard cases of role antialiasing.
#include "roles/antialiasing/samples.hpp"

namespace {

using namespace antialiasing;

TEST(Antialiasing, H1OneSampleLeavesEveryBitAsItWas) {
  Scene scene;
  build(scene);
  Graph none(scene_text(), {"aa.technique=none", "output=lighting.radiance"});
  const Image expected = none.image(scene);
  for (const char* sequence : {"r2", "halton", "random"}) {
    for (const char* filter : {"box", "tent", "gaussian"}) {
      Graph one(scene_text(),
                {samples(1), std::string("aa.params.sequence=") + sequence, std::string("aa.params.filter=") + filter});
      EXPECT_EQ(one.image(scene).pixels, expected.pixels) << sequence << ", " << filter;
    }
  }
}

TEST(Antialiasing, H2WhatIsTheSameInAllSamplesStaysTheSame) {
  Scene scene;
  Graph none(edge_text("constants"), {"aa.technique=none", "output=edge.radiance"});
  const Image expected = none.image(scene);
  EXPECT_GT(expected.at(63, 0), 1e6F);
  for (const int count : {2, 3, 7, 10, 16, 100, 333}) {
    Graph graph(edge_text("constants"), {samples(count)});
    EXPECT_EQ(graph.image(scene).pixels, expected.pixels) << count << " samples";
  }
}

TEST(Antialiasing, H3SamplesThatAreNoNumbersAreLeftOut) {
  Scene scene;
  for (const int count : {2, 16, 61}) {
    Graph graph(edge_text("broken", 16, 8), {samples(count)});
    const Image image = graph.image(scene);
    for (std::uint32_t x = 0; x < 16; ++x) {
      for (std::uint32_t channel = 0; channel < 4; ++channel)
        EXPECT_EQ(image.at(x, 3, channel), x == 4 || x == 5 ? 0.0F : 3.0F) << "column " << x << ", " << count;
    }
  }
}

TEST(Antialiasing, H4RoundingDoesNotGrowWithTheNumberOfSamples) {
  Scene scene;
  constexpr int kCount = 4096;
  Graph graph(edge_text("steps", 16, 8), {samples(kCount)});
  const Image image = graph.image(scene);
  for (std::uint32_t x = 0; x < 16; ++x) {
    double sum = 0;
    for (std::uint32_t i = 0; i < kCount; ++i) sum += 1000.0 + ((i * 7919U + x * 131U) % 1024U) / 1024.0;
    // The mean's own rounding to float32, half a unit in the last place of 1000; a plain sum is off by 2e-2.
    EXPECT_NEAR(static_cast<double>(image.at(x, 3)), sum / kCount, 0x1p-15) << "column " << x;
  }
  Graph constants(edge_text("constants", 64, 8), {samples(kCount)});
  Graph none(edge_text("constants", 64, 8), {"aa.technique=none", "output=edge.radiance"});
  EXPECT_EQ(constants.image(scene).pixels, none.image(scene).pixels);
}

TEST(Antialiasing, H5TheSameFrameTwiceGivesTheSameBytes) {
  Scene scene;
  build(scene);
  Graph graph(scene_text(), {samples(8)});
  const Image first = graph.image(scene);
  render(graph, scene, HEDDLE_RENDER_ANEW);
  EXPECT_EQ(graph.read().pixels, first.pixels);
  Graph other(scene_text(), {samples(8)});
  EXPECT_EQ(other.image(scene).pixels, first.pixels);
}

}  // namespace
