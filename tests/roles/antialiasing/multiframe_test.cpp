// SPDX-License-Identifier: Apache-2.0
// antialiasing/multiframe: frame after frame to the mean, what a frame costs by counters, what its accumulators lose,
// and rendered edges.
#include "antialiasing/multiframe/accumulators.hpp"
#include "antialiasing/multiframe/kernel.hpp"
#include "parsed.hpp"
#include "roles/antialiasing/edges.hpp"
#include "roles/readme.hpp"

#include <iostream>
#include <map>
#include <set>

namespace {

using namespace antialiasing;

std::vector<std::string> multiframe_settings(int count, const std::vector<std::string>& more = {}) {
  std::vector<std::string> settings{"aa.technique=multiframe", samples(count)};
  for (const std::string& parameter : more) settings.push_back("aa.params." + parameter);
  return settings;
}

std::vector<std::string> all_in_one(int count, const std::vector<std::string>& more = {}) {
  std::vector<std::string> settings = multiframe_settings(count, more);
  settings.emplace_back("aa.params.samples_per_frame=0");
  return settings;
}

std::vector<multiframe::Point> offsets_of(multiframe::Kernel kernel, std::uint32_t count, bool is_centred) {
  multiframe::Design design;
  design.kernel = kernel;
  design.count = count;
  design.is_centred = is_centred;
  return sample_offsets(design);
}

int done(Graph& graph) {
  return stats(graph)["loops"][0]["done"].get<int>();
}

TEST(Multiframe, EndsAtTheReferenceForTheSamePoints) {
  Scene scene;
  build(scene);
  Graph reference(scene_text(), {samples(7)});
  const Image expected = reference.image(scene);
  Graph graph(scene_text(), multiframe_settings(7, {"kernel=r2", "centred=false"}));
  for (int k = 1; k <= 7; ++k) {
    render(graph, scene);
    EXPECT_EQ(done(graph), k);
    if (k > 1) {
      EXPECT_EQ(stats(graph)["counters"]["submits"], 2) << "one for the sample, one for what follows";
    }
  }
  EXPECT_EQ(graph.read().pixels, expected.pixels);
}

/// Settings of blending into an accumulator.
std::vector<std::string> blended(const std::string& accumulator, std::vector<std::string> more = {}) {
  more.emplace_back("accumulator=" + accumulator);
  more.emplace_back("accumulation=blend");
  return more;
}

TEST(Multiframe, SubmitsNothingInAHundredFramesAfterTheLast) {
  Scene scene;
  build(scene);
  for (const std::vector<std::string>& parameters : {std::vector<std::string>{}, blended("rgba32f")}) {
    Graph graph(scene_text(), multiframe_settings(3, parameters));
    for (int k = 0; k < 3; ++k) render(graph, scene);
    const Image last = graph.read();
    for (int k = 0; k < 100; ++k) {
      render(graph, scene);
      const auto found = stats(graph);
      for (const char* name :
           {"submits", "commands", "dispatches", "draws", "barriers", "uploaded_bytes", "renderings"})
        ASSERT_EQ(found["counters"][name], 0) << name << ", idle frame " << k;
      ASSERT_EQ(found["loops"][0]["done"], 3);
    }
    EXPECT_EQ(graph.read().pixels, last.pixels);
  }
}

TEST(Multiframe, BlendingMakesTheMeanOfTheComputeShaderToItsRounding) {
  // Each frame rounds two products and a sum: 3 u relative, of which k/n is left after n frames.
  constexpr int kCount = 13;
  Scene scene;
  build(scene);
  for (const std::string weighting : {"equal", "compressed"}) {
    Graph by_compute(scene_text(), multiframe_settings(kCount, {"accumulator=rgba32f", "weighting=" + weighting}));
    Graph by_blending(scene_text(), multiframe_settings(kCount, blended("rgba32f", {"weighting=" + weighting})));
    for (int k = 1; k <= kCount; ++k) {
      render(by_compute, scene);
      render(by_blending, scene);
      const Image expected = by_compute.read();
      const Image image = by_blending.read();
      const auto bound = static_cast<float>(2 * 3 * 0x1p-24 * (k + 1));
      for (std::size_t i = 0; i < expected.pixels.size(); ++i)
        ASSERT_NEAR(image.pixels[i], expected.pixels[i], bound * std::abs(expected.pixels[i]))
            << weighting << ", " << k;
    }
    EXPECT_EQ(done(by_blending), kCount);
  }
}

TEST(Multiframe, BlendingCostsADrawOfTwoAttachmentsInPlaceOfADispatch) {
  Scene scene;
  build(scene);
  const auto counters = [&](const std::vector<std::string>& parameters) {
    Graph graph(scene_text(), multiframe_settings(3, parameters));
    render(graph, scene);
    render(graph, scene);
    return stats(graph)["counters"];
  };
  const auto by_compute = counters({"accumulator=rgba32f"});
  const auto by_blending = counters(blended("rgba32f"));
  for (const char* name : {"commands", "dispatches", "draws", "renderings", "barriers"})
    std::cout << name << " of the second frame: " << by_compute[name] << " by compute, " << by_blending[name]
              << " by blending\n";
  EXPECT_EQ(by_blending["dispatches"].get<int>(), by_compute["dispatches"].get<int>() - 1);
  EXPECT_EQ(by_blending["draws"].get<int>(), by_compute["draws"].get<int>() + 1);
  EXPECT_EQ(by_blending["renderings"].get<int>(), by_compute["renderings"].get<int>() + 1);
}

TEST(Multiframe, HasOnlyTheStagesOfTheAccumulationThatIsChosen) {
  Scene scene;
  build(scene);
  const auto stages = [&](Graph& graph) {
    std::set<std::string> names;
    const char* text = nullptr;
    check(heddle_graph_explain(graph.handle, "json", &text));
    const auto explained = nlohmann::json::parse(text);
    for (const auto& stage : explained["stages"])
      if (stage["pass"] == "aa") names.insert(stage["stage"].get<std::string>());
    return names;
  };
  Graph graph(scene_text(), multiframe_settings(3, {"accumulator=rgba32f"}));
  render(graph, scene);
  EXPECT_EQ(stages(graph), (std::set<std::string>{"move", "accumulate", "resolve"}));
  graph.set("aa.params.accumulation=blend");
  render(graph, scene);
  EXPECT_EQ(stages(graph), (std::set<std::string>{"move", "begin", "blend", "resolve_blended"}));
  Graph other(scene_text(), multiframe_settings(3, blended("rgba32f")));
  for (int k = 0; k < 3; ++k) render(other, scene);
  for (int k = 1; k < 3; ++k) render(graph, scene);
  EXPECT_EQ(graph.read().pixels, other.read().pixels);
}

TEST(Multiframe, SaysWhatCannotBeBlendedInto) {
  Scene scene;
  Graph graph(edge_text("constants"), multiframe_settings(3, {"accumulation=blend"}));
  EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT);
  EXPECT_NE(
      std::string(heddle_error(Host::get().handle))
          .find("accumulation = blend with accumulator = float32_pair: two floats are not one that blending could "
                "change; expected accumulator = rgba8, rgba16f, rgba16, rgba32f, or accumulation = compute"),
      std::string::npos)
      << heddle_error(Host::get().handle);
  // Blending of 8 bit and 16 bit float formats is all that Vulkan asks of a device.
  const auto features = [](VkFormat format) -> VkFormatFeatureFlags {
    const bool can = format == VK_FORMAT_R8G8B8A8_UNORM || format == VK_FORMAT_R8_UNORM ||
                     format == VK_FORMAT_R16G16B16A16_SFLOAT || format == VK_FORMAT_R16_SFLOAT ||
                     format == VK_FORMAT_R32_SFLOAT;  // one channel alone is not enough
    VkFormatFeatureFlags found = VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT;
    if (can) found |= VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT;
    return found;
  };
  EXPECT_EQ(multiframe::why_not_blended(0, features), "");
  EXPECT_EQ(multiframe::why_not_blended(1, features), "");
  EXPECT_EQ(multiframe::why_not_blended(3, features),
            "accumulation = blend with accumulator = rgba32f: this device does not blend into that format; expected "
            "accumulator = rgba8, rgba16f, or accumulation = compute");
}

TEST(Multiframe, TakesAsManySamplesAFrameAsWanted) {
  Scene scene;
  build(scene);
  Graph whole(scene_text(), all_in_one(10));
  const Image expected = whole.image(scene);
  render(whole, scene, HEDDLE_RENDER_ANEW);
  EXPECT_EQ(stats(whole)["counters"]["submits"], 11) << "one a sample, one for what follows";
  Graph graph(scene_text(), multiframe_settings(10, {"samples_per_frame=4"}));
  std::vector<int> steps;
  for (int k = 0; k < 4; ++k) {
    render(graph, scene);
    steps.push_back(done(graph));
  }
  EXPECT_EQ(steps, (std::vector{4, 8, 10, 10}));
  EXPECT_EQ(graph.read().pixels, expected.pixels);
}

TEST(Multiframe, StartsAnewWithANewKernelWhenAnythingChanges) {
  Scene scene;
  build(scene);
  Graph graph(scene_text(), multiframe_settings(4));
  const auto is_as_new = [&](const std::string& setting, const std::vector<std::string>& all, int count) {
    render(graph, scene);
    render(graph, scene);
    graph.set(setting);
    render(graph, scene);
    EXPECT_EQ(done(graph), 1) << setting;
    for (int k = 1; k < count; ++k) render(graph, scene);
    EXPECT_EQ(done(graph), count) << setting;
    Graph other(scene_text(), all_in_one(count, all));
    EXPECT_EQ(graph.read().pixels, other.image(scene).pixels) << setting;
  };
  // The first of the new kernel, not the fifth of the old one, although no more are needed than were there.
  is_as_new("aa.params.samples=6", {}, 6);
  is_as_new("aa.params.seed=9", {"seed=9"}, 6);
  is_as_new("aa.params.kernel=halton", {"seed=9", "kernel=halton"}, 6);
  is_as_new("aa.params.filter=tent", {"seed=9", "kernel=halton", "filter=tent"}, 6);
  is_as_new("aa.params.accumulator=rgba16f", {"seed=9", "kernel=halton", "filter=tent", "accumulator=rgba16f"}, 6);
  scene.look({2.0, 1.9, 2.7}, {0, 0.5, 0}, 0.7);
  render(graph, scene);
  EXPECT_EQ(done(graph), 1);
  render(graph, scene);
  EXPECT_EQ(done(graph), 2);
  render(graph, scene, 0, false, 0.5);
  EXPECT_EQ(done(graph), 1);
}

TEST(Multiframe, ShowsWhatIsWithoutItWhileTheCameraMoves) {
  Scene scene;
  build(scene);
  Graph graph(scene_text(), multiframe_settings(16));
  Graph none(scene_text(), {"aa.technique=none", "output=lighting.radiance"});
  for (int k = 0; k < 4; ++k) {
    scene.look({2.1 + 0.1 * k, 1.9, 2.7}, {0, 0.5, 0}, 0.7);
    render(graph, scene);
    EXPECT_EQ(done(graph), 1);
    EXPECT_EQ(graph.read().pixels, none.image(scene).pixels) << k;
  }
}

TEST(Multiframe, SaysWhatWasLeftOutOfEachPixel) {
  Scene scene;
  constexpr int kCount = 16;
  Graph graph(edge_text("broken", 16, 8), all_in_one(kCount));
  graph.keep("aa.weight");
  graph.render(scene);
  const Image weight = graph.read("aa.weight");
  int right = 0;
  for (const auto& p : offsets_of(multiframe::Kernel::kPoisson, kCount, true)) right += p[0] >= 0 ? 1 : 0;
  for (std::uint32_t x = 0; x < 16; ++x) {
    const int expected = x < 4 ? right : x < 6 ? 0 : kCount;
    EXPECT_EQ(weight.at(x, 3), static_cast<float>(expected)) << "column " << x;
  }
}

TEST(Multiframe, LeavesNothingOfSamplesBeforeTheChange) {
  Scene scene;
  for (const std::vector<std::string>& parameters :
       {std::vector<std::string>{"accumulator=rgba16f"}, blended("rgba16f"), blended("rgba32f")}) {
    Graph graph(edge_text("broken", 16, 8), multiframe_settings(4, parameters));
    for (int k = 0; k < 3; ++k) render(graph, scene);
    EXPECT_EQ(graph.read().at(4, 3), 0.0F) << "nothing but NaN";
    EXPECT_NEAR(graph.read().at(9, 3), 3.0F, 3 * 0x1p-10F);
    const auto begins_anew = [&](const std::string& technique) {
      graph.set("edge.technique=" + technique);
      render(graph, scene);
      EXPECT_EQ(done(graph), 1);
    };
    // What the first sample is not blended with, whatever it is: too large for 16 bit floats, and infinite there.
    begins_anew("constants");
    begins_anew("flips");
    const Image image = graph.read();
    for (std::uint32_t x = 0; x < 16; ++x)
      EXPECT_TRUE(std::abs(image.at(x, 3) - 0.1F) < 1e-3F || std::abs(image.at(x, 3) - 0.9F) < 1e-3F) << image.at(x, 3);
  }
}

TEST(Multiframe, BlendingLeavesOutSamplesThatAreNoNumbers) {
  // The mean of samples times weights over that of weights: each rounds 3 u a frame, 2 u of 16 bit floats where they
  // are truncated in every frame, and their quotient once more.
  Scene scene;
  constexpr int kCount = 16;
  for (const auto& [accumulator, bound] :
       {std::pair("rgba32f", 2 * 3 * 0x1p-24 * (kCount + 1)), std::pair("rgba16f", 2 * 2 * 0x1p-10 * (kCount + 1))}) {
    Graph graph(edge_text("broken", 16, 8), all_in_one(kCount, blended(accumulator)));
    graph.keep("aa.weight");
    const Image image = graph.image(scene);
    const Image weight = graph.read("aa.weight");
    int right = 0;
    for (const auto& p : offsets_of(multiframe::Kernel::kPoisson, kCount, true)) right += p[0] >= 0 ? 1 : 0;
    for (std::uint32_t x = 0; x < 16; ++x) {
      const double part = x < 4 ? static_cast<double>(right) / kCount : x < 6 ? 0.0 : 1.0;
      EXPECT_NEAR(weight.at(x, 3), part, bound) << accumulator << ", column " << x;
      for (std::uint32_t channel = 0; channel < 4; ++channel) {
        if (x == 4 || x == 5)
          EXPECT_EQ(image.at(x, 3, channel), 0.0F) << accumulator << ", column " << x;
        else
          EXPECT_NEAR(image.at(x, 3, channel), 3.0F, 3 * 2 * bound) << accumulator << ", column " << x;
      }
    }
  }
}

TEST(Multiframe, KeepsConstantsOverTenThousandFrames) {
  Scene scene;
  Graph graph(edge_text("constants", 64, 8), all_in_one(10000, {"accumulator=rgba32f", "kernel=r2"}));
  Graph none(edge_text("constants", 64, 8), {"aa.technique=none", "output=edge.radiance"});
  EXPECT_EQ(graph.image(scene).pixels, none.image(scene).pixels);
}

/// PCG, as in flips.comp.glsl.
std::uint32_t pcg(std::uint32_t value) {
  const std::uint32_t state = value * 747796405U + 2891336453U;
  const std::uint32_t word = ((state >> ((state >> 28U) + 4U)) ^ state) * 277803737U;
  return (word >> 22U) ^ word;
}

/// How many of the first `count` samples of a pixel of flips are 0.9.
int bright_samples(std::uint32_t x, std::uint32_t y, std::uint32_t width, int count) {
  int bright = 0;
  for (int i = 0; i < count; ++i) {
    const std::uint32_t chance = pcg(pcg(static_cast<std::uint32_t>(i)) + y * width + x) >> 16U;
    bright += chance < (x * 2 + 1) * 65536U / (2 * width) ? 1 : 0;
  }
  return bright;
}

// White is 1: 1.2 * 2^exposure.
const std::string kWhiteIsOne = "exposure=" + std::to_string(-std::log2(1.2));

/// What samples of an edge between 0.1 and 0.9 lose in an accumulator.
struct AccumulatorError {
  double largest = 0, mean = 0;
};
AccumulatorError accumulator_error(const std::vector<std::string>& parameters, int count) {
  constexpr std::uint32_t kWidth = 64;
  constexpr std::uint32_t kHeight = 8;
  Scene scene;
  std::vector<std::string> all = parameters;
  all.insert(all.end(), {kWhiteIsOne, "kernel=r2"});
  Graph graph(edge_text("flips", kWidth, kHeight), all_in_one(count, all));
  const Image image = graph.image(scene);
  AccumulatorError found;
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      const int bright = bright_samples(x, y, kWidth, count);
      const double truth = (bright * static_cast<double>(0.9F) + (count - bright) * static_cast<double>(0.1F)) / count;
      const double error = image.at(x, y) - truth;
      found.largest = std::max(found.largest, std::abs(error));
      found.mean += error / (kWidth * kHeight);
    }
  }
  return found;
}

TEST(Multiframe, AccumulatorsLoseNoMoreThanTheirRoundingAllows) {
  // Each frame rounds once, by u at most, and the mean of k frames is 1/n of that of n for each of its k: no more than
  // sum k u / n = u (n + 1) / 2. Beside that, 6 roundings of float32 a frame.
  struct Rung {
    const char* accumulator;
    const char* rounding;
    double u;
  };
  constexpr int kCount = 1024;
  std::map<std::string, AccumulatorError> errors;
  for (const Rung& rung : {Rung{"rgba8", "truncate", 1.0 / 255}, Rung{"rgba8", "nearest", 0.5 / 255},
                           Rung{"rgba16f", "truncate", 0x1p-11}, Rung{"rgba16f", "nearest", 0x1p-12},
                           Rung{"rgba16", "truncate", 1.0 / 65535}, Rung{"rgba16", "nearest", 0.5 / 65535},
                           Rung{"rgba32f", "nearest", 0x1p-25}, Rung{"float32_pair", "nearest", 0}}) {
    const AccumulatorError error = accumulator_error(
        {std::string("accumulator=") + rung.accumulator, std::string("rounding=") + rung.rounding}, kCount);
    const double bound = (rung.u + (rung.u == 0 ? 0 : 6 * 0x1p-25)) * (kCount + 1) / 2 + 2 * 0x1p-24;
    const std::string name = std::string(rung.accumulator) + ", " + rung.rounding;
    errors[name] = error;
    std::cout << "| " << name << " | " << error.largest << " | " << error.mean << " | " << bound << " |\n";
    EXPECT_LE(error.largest, bound) << name;
    if (std::string(rung.rounding) == "truncate") {
      EXPECT_LT(error.mean, 0) << name << ": drifts to the dark";
    }
  }
  // The ranking of the source, and that 16 bit floats fall behind 8 bit integers only where they are truncated.
  EXPECT_LT(errors["float32_pair, nearest"].largest, 0x1p-23);
  EXPECT_LT(errors["rgba32f, nearest"].largest, 1e-4);
  EXPECT_LE(errors["rgba32f, nearest"].largest, errors["rgba16, nearest"].largest);
  EXPECT_LT(10 * errors["rgba16, nearest"].largest, errors["rgba16f, nearest"].largest);
  EXPECT_LT(errors["rgba16f, nearest"].largest, errors["rgba8, nearest"].largest);
  EXPECT_GT(-errors["rgba16f, truncate"].mean, 5 * std::abs(errors["rgba8, nearest"].mean));
}

/// The largest relative change of constants in the mean of `count` samples.
double constants_error(const std::vector<std::string>& parameters, int count) {
  Scene scene;
  // Powers of two from 2^-14 on, where 16 bit floats are as precise as everywhere; white is 1.
  std::vector<std::string> all = parameters;
  all.insert(all.end(), {kWhiteIsOne, "kernel=r2"});
  Graph graph(edge_text("constants", 40, 8), all_in_one(count, all));
  Graph one(edge_text("constants", 40, 8), all_in_one(1, all));
  const Image image = graph.image(scene);
  const Image expected = one.image(scene);
  double largest = 0;
  for (std::uint32_t y = 0; y < 8; ++y) {
    for (std::uint32_t x = 28; x < 40; ++x) {
      const double right = expected.at(x, y);
      if (right > 0) largest = std::max(largest, std::abs(image.at(x, y) - right) / right);
    }
  }
  return largest;
}

TEST(Multiframe, BlendingLosesConstantsAndTheComputeShaderDoesNot) {
  constexpr int kCount = 1024;
  std::map<std::string, double> lost;
  for (const std::string accumulator : {"rgba8", "rgba16f", "rgba16", "rgba32f"}) {
    const AccumulatorError error = accumulator_error(blended(accumulator), kCount);
    lost[accumulator] = constants_error(blended(accumulator), kCount);
    std::cout << "| " << accumulator << " | " << error.largest << " | " << error.mean << " | "
              << constants_error({"accumulator=" + accumulator}, kCount) << " | " << lost[accumulator] << " |\n";
  }
  EXPECT_EQ(constants_error({"accumulator=rgba32f"}, kCount), 0);
  // (14): three roundings a frame.
  EXPECT_GT(lost["rgba32f"], 0);
  EXPECT_LE(lost["rgba32f"], 3 * 0x1p-24 * (kCount + 1));
  EXPECT_LE(accumulator_error(blended("rgba32f"), kCount).largest, 3 * 0x1p-25 * (kCount + 1));
}

TEST(Multiframe, CompressedWeightsAreThoseOfTheEquation) {
  // White is 0.1: 0.9 weighs 1/10, 0.1 weighs 1/2.
  constexpr int kCount = 64;
  Scene scene;
  Graph graph(edge_text("flips", 16, 8),
              all_in_one(kCount, {"weighting=compressed", "exposure=" + std::to_string(std::log2(0.1 / 1.2))}));
  const Image image = graph.image(scene);
  for (std::uint32_t x = 0; x < 16; ++x) {
    const int bright = bright_samples(x, 3, 16, kCount);
    const double weight = 0.1 * bright + 0.5 * (kCount - bright);
    EXPECT_NEAR(image.at(x, 3), (0.1 * 0.9 * bright + 0.5 * 0.1 * (kCount - bright)) / weight, 2e-6) << x;
  }
}

TEST(Multiframe, IntegersEndAtWhite) {
  Scene scene;
  Graph graph(edge_text("broken", 16, 8), all_in_one(2, {"accumulator=rgba16", kWhiteIsOne}));
  EXPECT_NEAR(graph.image(scene).at(9, 3), 1.0F, 1e-6F) << "3 cd/m^2 over white 1";
  Graph wide(edge_text("broken", 16, 8), all_in_one(2, {"accumulator=rgba16", "exposure=2"}));
  EXPECT_NEAR(wide.image(scene).at(9, 3), 3.0F, 4.8F / 65535) << "white 4.8";
}

TEST(Multiframe, CountsExactlyTheSamplesBesideAVerticalEdgeForEveryKernel) {
  Scene scene;
  for (const auto& [name, kernel] :
       {std::pair("poisson", multiframe::Kernel::kPoisson), std::pair("random", multiframe::Kernel::kRandom),
        std::pair("grid", multiframe::Kernel::kGrid), std::pair("r2", multiframe::Kernel::kR2),
        std::pair("halton", multiframe::Kernel::kHalton)}) {
    Graph graph(edge_text("half_planes"), all_in_one(23, {std::string("kernel=") + name}));
    const Image image = graph.image(scene);
    const auto offsets = offsets_of(kernel, 23, true);
    for (std::uint32_t x = 0; x < 64; ++x) {
      const float edge = (static_cast<float>(x) + 0.5F) / 64.0F - 0.5F;
      const auto inside =
          std::ranges::count_if(offsets, [&](const auto& p) { return static_cast<float>(p[0]) > edge; });
      EXPECT_FLOAT_EQ(image.at(x, 9, 1), static_cast<float>(inside) / 23.0F) << name << ", " << x;
    }
  }
}

TEST(Multiframe, PixelsAreTheFiltersMeansAtAVerticalEdge) {
  Scene scene;
  const double to_erf = 1.0 / (0.5 * std::numbers::sqrt2);
  const auto gaussian = [&](double x) { return 0.5 - 0.5 * std::erf(x * to_erf) / std::erf(1.5 * to_erf); };
  const auto tent = [](double x) { return x > 0 ? 0.5 * (1 - x) * (1 - x) : 1 - 0.5 * (1 + x) * (1 + x); };
  const auto is_filtered = [&](const std::vector<std::string>& parameters, const auto& beyond) {
    std::vector<std::string> more = parameters;
    more.emplace_back("kernel=r2");
    Graph graph(edge_text("half_planes", 64, 16), all_in_one(512, more));
    const Image image = graph.image(scene);
    for (std::uint32_t x = 0; x < 64; ++x) {
      const double edge = (x + 0.5) / 64.0 - 0.5;
      // In one direction R2 is an additive sequence: no further than about 3/n from the distribution.
      EXPECT_NEAR(image.at(x, 9, 1), beyond(edge), 3.0 / 512) << parameters[0] << ", " << x;
    }
  };
  is_filtered({"filter=box"}, [](double x) { return 0.5 - x; });
  is_filtered({"filter=tent"}, tent);
  is_filtered({"filter=gaussian"}, gaussian);
  is_filtered({"filter=tent", "radius=2"}, [&](double x) { return tent(x / 2); });
  is_filtered({"filter=gaussian", "radius=0.75"}, [&](double x) { return gaussian(std::clamp(2 * x, -1.5, 1.5)); });
}

TEST(Multiframe, RenderedEdgesAreAsGoodAsTheKernelAndHalfAJitterIsFound) {
  // By the shader's own edges, and by a triangle through the rasterizer, where the size of the step is the matrix's.
  const std::vector<std::string> right = all_in_one(64);
  const std::vector<std::string> half = all_in_one(64, {"radius=0.25"});
  EXPECT_LT(half_plane_error(right), 0.025);
  EXPECT_GT(half_plane_error(half), 0.1);
  const TriangleError drawn = triangle_error(right);
  EXPECT_LT(drawn.rms, 0.025);
  EXPECT_LT(drawn.off_edges, 1.0 / 64) << "a sample may lie beyond its pixel by what centring moved it";
  EXPECT_GT(triangle_error(half).rms, 0.08);
  const double random = half_plane_error(all_in_one(64, {"kernel=random", "centred=false"}));
  EXPECT_GT(random, 0.03);
  EXPECT_LT(random, 0.06);
}

TEST(Multiframe, ShiftsThePictureByTheMeanOfItsOffsetsAndNotAtAllIfCentred) {
  // How much of the mean is found in the picture, by least squares over kernels: their other errors are independent of
  // it, and about half as large as the mean for one triangle.
  double squares = 0;
  double found = 0;
  double found_centred = 0;
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    multiframe::Design design;
    design.count = 16;
    design.seed = seed;
    design.is_centred = false;
    glm::dvec2 mean(0.0);
    for (const auto& p : sample_offsets(design)) mean += glm::dvec2(p[0], p[1]) / 16.0;
    const std::string setting = "seed=" + std::to_string(seed);
    squares += glm::dot(mean, mean);
    found -= glm::dot(mean, triangle_error(all_in_one(16, {"centred=false", setting})).shift);
    found_centred -= glm::dot(mean, triangle_error(all_in_one(16, {setting})).shift);
  }
  ASSERT_GT(std::sqrt(squares / 6), 0.02);
  std::cout << "of the kernel's mean: " << found / squares << ", centred " << found_centred / squares << '\n';
  EXPECT_NEAR(found / squares, 1, 0.4);
  EXPECT_NEAR(found_centred / squares, 0, 0.4);
}

TEST(Multiframe, NeedsLessMemoryThanAPictureOfTwiceTheSize) {
  Scene scene;
  build(scene);
  const auto bytes = [&](int size, const std::vector<std::string>& settings) {
    std::vector<std::string> all = settings;
    all.emplace_back("shadow.technique=none");  // maps of the size that the light wants, whatever the picture's is
    Graph graph(scene_text(size), all);
    render(graph, scene);
    const auto memory = stats(graph)["memory"];
    return memory["transient_bytes"].get<double>() + memory["kept_bytes"].get<double>();
  };
  const double at_size = bytes(256, multiframe_settings(4));
  const double twice = bytes(512, {"aa.technique=none", "output=lighting.radiance"});
  std::cout << "4 samples a pixel: " << at_size / 65536 << " bytes a pixel over frames, " << twice / 65536
            << " in a picture of twice the size\n";
  EXPECT_GT(twice, 2 * at_size);
}

TEST(Multiframe, TheTableOfParametersInItsReadmeIsTheDescriptors) {
  const char* text = nullptr;
  check(heddle_list(Host::get().handle, &text));
  const std::string table = parameter_table(parsed::json(text), "antialiasing/multiframe");
  EXPECT_NE(table, "");
  EXPECT_NE(readme_of("antialiasing/multiframe").find(table), std::string::npos) << "the README should have\n" << table;
}

}  // namespace
