// SPDX-License-Identifier: Apache-2.0
// antialiasing/supersampled: its error over samples against theory, progressive frames against the reference mode, and
// what a frame costs by counters.
#include "antialiasing/supersampled/sequence.hpp"
#include "parsed.hpp"
#include "roles/antialiasing/edges.hpp"
#include "roles/readme.hpp"

namespace {

using namespace antialiasing;

TEST(Supersampled, ErrorOfEdgesFallsAsTheSequenceAllows) {
  // Independent points: -1/2. No points do better than -3/4 in root mean square over half planes for long (Alexander
  // 1990); R2's star discrepancy, O(n^(-1 + e)) (Niederreiter 1972), guarantees that it beats -1/2 + e. All pixels
  // share the points, so a fit of five counts scatters by about 0.1: it comes out at -0.82 for R2, -0.77 for Halton,
  // -0.58 for independent points.
  for (const char* sequence : {"r2", "halton", "random"}) {
    std::vector<std::pair<int, double>> errors;
    for (const int count : {4, 16, 64, 256, 1024})
      errors.emplace_back(count, half_plane_error({samples(count), std::string("aa.params.sequence=") + sequence}));
    const double slope = slope_of(errors);
    RecordProperty(std::string(sequence) + "_slope", std::to_string(slope));
    for (const auto& [count, error] : errors)
      RecordProperty(std::string(sequence) + "_" + std::to_string(count), std::to_string(error));
    if (std::string(sequence) == "random") {
      EXPECT_NEAR(slope, -0.5, 0.12);
    } else {
      EXPECT_LT(slope, -0.6) << sequence;
      EXPECT_GT(slope, -0.85) << sequence;
    }
  }
}

TEST(Supersampled, MeansOfARasterizedTriangleAreTheAreaThatItCovers) {
  constexpr int kCount = 1024;
  const TriangleError error = triangle_error({samples(kCount)});
  // A pixel whose area an edge misses by less than the rasterizer's grid may be met.
  EXPECT_LE(error.off_edges, 1.0 / 256);
  // The sequence's error in half planes, and that rasterizers place corners on a grid of 1/256 pixel, for each sample
  // anew.
  EXPECT_GT(error.edge_pixels, 60);
  RecordProperty("rms_of_edge_pixels", std::to_string(error.rms));
  EXPECT_LT(error.rms, 2 * half_plane_error({samples(kCount)}) + 1.0 / 512);
  RecordProperty("shift_px", std::to_string(glm::length(error.shift)));
  EXPECT_LT(glm::length(error.shift), 1.0 / 256);
}

TEST(Supersampled, CountsExactlyTheSamplesBesideAVerticalEdge) {
  Scene scene;
  for (const int count : {1, 5, 16, 100}) {
    Graph graph(edge_text("half_planes"), {samples(count)});
    const Image image = graph.image(scene);
    for (std::uint32_t x = 0; x < 64; ++x) {
      const float edge = (static_cast<float>(x) + 0.5F) / 64.0F - 0.5F;
      int inside = 0;
      for (int i = 0; i < count; ++i) {
        const auto offset = supersampled::sample_offset(supersampled::Sequence::kR2, supersampled::Filter::kBox,
                                                        static_cast<std::uint32_t>(i));
        inside += static_cast<float>(offset[0]) > edge ? 1 : 0;
      }
      // A mean of zeros and ones is a quotient of small integers: right to the last place.
      EXPECT_FLOAT_EQ(image.at(x, 9, 1), static_cast<float>(inside) / static_cast<float>(count));
    }
  }
}

TEST(Supersampled, ConvergesOnASceneOfEdges) {
  Scene scene;
  build(scene);
  const auto error_of = [&](int count, const Image& reference) {
    Graph graph(scene_text(48), {samples(count)});
    const Image image = graph.image(scene);
    double sum = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      sum += i % 4 == 3 ? 0.0 : std::pow(static_cast<double>(image.pixels[i]) - reference.pixels[i], 2);
    return std::sqrt(sum / static_cast<double>(image.pixels.size() * 3 / 4));
  };
  Graph truth(scene_text(48), {samples(1024)});
  const Image reference = truth.image(scene);
  std::vector<std::pair<int, double>> errors;
  for (const int count : {1, 4, 16, 64}) errors.emplace_back(count, error_of(count, reference));
  for (const auto& [count, error] : errors) RecordProperty("rmse_" + std::to_string(count), std::to_string(error));
  RecordProperty("slope", std::to_string(slope_of(errors)));
  // At least what independent samples would do; the reference's own error is 1/16 of that of 64 by theory.
  EXPECT_LT(slope_of(errors), -0.5);
}

TEST(Supersampled, ProgressiveFramesEndAtTheReference) {
  Scene scene;
  build(scene);
  Graph reference(scene_text(), {samples(6)});
  const Image expected = reference.image(scene);
  Graph graph(scene_text(), {samples(6), "aa.params.mode=progressive"});
  for (int k = 1; k <= 6; ++k) {
    render(graph, scene);
    const auto loop = stats(graph)["loops"][0];
    EXPECT_EQ(loop["pass"], "aa");
    EXPECT_EQ(loop["done"], k);
    EXPECT_EQ(loop["total"], 6);
    if (k > 1) {  // the first frame uploads the scene too
      EXPECT_EQ(stats(graph)["counters"]["submits"], 2) << "one for the iteration, one for what follows";
    }
  }
  EXPECT_EQ(graph.read().pixels, expected.pixels);
  // Complete and unchanged: nothing is submitted, recorded, uploaded or made, and the image stays.
  for (int k = 0; k < 3; ++k) {
    render(graph, scene);
    const auto counters = stats(graph)["counters"];
    for (const char* name : {"submits", "commands", "dispatches", "draws", "barriers", "uploaded_bytes"})
      EXPECT_EQ(counters[name], 0) << name;
  }
  EXPECT_EQ(graph.read().pixels, expected.pixels);
  EXPECT_EQ(stats(graph)["frames"], 9);
}

TEST(Supersampled, ReferenceFramesAreNotRepeatedForNothing) {
  Scene scene;
  build(scene);
  Graph graph(scene_text(), {samples(3)});
  render(graph, scene);
  render(graph, scene);
  EXPECT_EQ(stats(graph)["counters"]["submits"], 0);
  render(graph, scene, HEDDLE_RENDER_ANEW);
  EXPECT_EQ(stats(graph)["counters"]["submits"], 4) << "one an iteration, one for what follows";
  render(graph, scene, HEDDLE_RENDER_PROFILE);
  EXPECT_GT(stats(graph)["counters"]["submits"], 4);
}

TEST(Supersampled, StartsAnewWhenAnythingChanges) {
  Scene scene;
  build(scene);
  Graph graph(scene_text(), {samples(5), "aa.params.mode=progressive"});
  const auto done_after = [&](const auto& change) {
    render(graph, scene);
    render(graph, scene);
    change();
    render(graph, scene);
    const int first = stats(graph)["loops"][0]["done"];
    render(graph, scene);
    EXPECT_EQ(stats(graph)["loops"][0]["done"], first + 1);
    return first;
  };
  EXPECT_EQ(done_after([&] { graph.set("ao.params.radius=0.7"); }), 1);
  EXPECT_EQ(done_after([&] { graph.set(samples(7)); }), 1);
  EXPECT_EQ(done_after([&] { scene.look({2.0, 1.9, 2.7}, {0, 0.5, 0}, 0.7); }), 1);
  EXPECT_EQ(done_after([&] { scene.add_light(light(HEDDLE_LIGHT_POINT), {1, 2, 1}); }), 1);
  EXPECT_EQ(done_after([&] { scene.add_box({1, 0, 1}, {1.2, 0.2, 1.2}); }), 1);
  const dmat4 moved = glm::translate(dmat4(1.0), dvec3(0, 0.1, 0));
  // What moved arrives a frame later, when its previous place is the present one: that is a change as well.
  EXPECT_EQ(done_after([&] {
              check(heddle_scene_set_instance(scene.handle, 0, &moved[0][0]));
              render(graph, scene);
            }),
            1);
  EXPECT_EQ(done_after([&] { render(graph, scene, 0, true); }), 2);
  EXPECT_EQ(done_after([] {}), 6) << "and not when nothing does: three frames from the cut on, and three here";
}

TEST(Supersampled, TimeAndSeedAreChangesToo) {
  Scene scene;
  build(scene);
  Graph graph(scene_text(), {samples(5), "aa.params.mode=progressive"});
  const auto done = [&] { return stats(graph)["loops"][0]["done"].get<int>(); };
  render(graph, scene);
  render(graph, scene);
  EXPECT_EQ(done(), 2);
  render(graph, scene, 0, false, 0.5);
  EXPECT_EQ(done(), 1);
  render(graph, scene, 0, false, 0.5);
  EXPECT_EQ(done(), 2);
  render(graph, scene, 0, false, 0.5, 7);
  EXPECT_EQ(done(), 1);
}

TEST(Supersampled, RepeatsOnlyWhatDependsOnTheCamera) {
  Scene scene;
  build(scene);
  const auto dispatches = [&](int count, const char* sky) {
    Graph graph(scene_text(), {samples(count), std::string("sky.technique=") + sky});
    render(graph, scene);
    return stats(graph)["counters"]["dispatches"].get<int>();
  };
  const int per_sample = dispatches(2, "uniform") - dispatches(1, "uniform");
  EXPECT_GT(per_sample, 0);
  // A procedural sky fills its maps by dispatches, once, however many samples there are.
  const int once = dispatches(1, "procedural") - dispatches(1, "uniform");
  EXPECT_GT(once, 0);
  EXPECT_EQ(dispatches(5, "procedural"), dispatches(1, "uniform") + once + 4 * per_sample);
}

TEST(Supersampled, TheTableOfParametersInItsReadmeIsTheDescriptors) {
  const char* text = nullptr;
  check(heddle_list(Host::get().handle, &text));
  const std::string table = parameter_table(parsed::json(text), "antialiasing/supersampled");
  EXPECT_NE(table, "");
  EXPECT_NE(readme_of("antialiasing/supersampled").find(table), std::string::npos) << "the README should have\n"
                                                                                   << table;
}

TEST(Supersampled, ExplainsItsLoop) {
  Scene scene;
  build(scene);
  Graph graph(scene_text());
  render(graph, scene);
  const char* text = nullptr;
  check(heddle_graph_explain(graph.handle, "text", &text));
  const std::string explanation = text;
  EXPECT_NE(explanation.find("loop of 'aa', stages "), std::string::npos);
  EXPECT_NE(explanation.find(": gives 'aa.sample_camera' for 'scene.camera', gathers 'lighting.radiance'\n"),
            std::string::npos);
  EXPECT_NE(explanation.find("end of the loop of 'aa'\n"), std::string::npos);
}

}  // namespace
