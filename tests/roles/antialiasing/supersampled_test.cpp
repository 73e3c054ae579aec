// SPDX-License-Identifier: Apache-2.0
// antialiasing/supersampled: its error over samples against theory, progressive frames against the reference mode, and
// what a frame costs by counters.
#include "antialiasing/supersampled/sequence.hpp"
#include "roles/antialiasing/samples.hpp"
#include "roles/readme.hpp"

namespace {

using namespace antialiasing;

/// Area of the unit square around 0 where dot(normal, p) > distance: the polygon that is left of the square, by the
/// shoelace formula.
double covered(double angle, double distance) {
  const double nx = std::cos(angle);
  const double ny = std::sin(angle);
  std::vector<std::array<double, 2>> square{{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
  std::vector<std::array<double, 2>> left;
  for (std::size_t i = 0; i < square.size(); ++i) {
    const auto& a = square[i];
    const auto& b = square[(i + 1) % square.size()];
    const double da = nx * a[0] + ny * a[1] - distance;
    const double db = nx * b[0] + ny * b[1] - distance;
    if (da > 0) left.push_back(a);
    if ((da > 0) != (db > 0)) {
      const double t = da / (da - db);
      left.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
    }
  }
  double area = 0;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const auto& a = left[i];
    const auto& b = left[(i + 1) % left.size()];
    area += 0.5 * (a[0] * b[1] - b[0] * a[1]);
  }
  return area;
}

/// Root mean square over 4096 pixels of what n samples say of their half planes, less the truth.
double half_plane_error(const std::string& sequence, int count) {
  Scene scene;
  Graph graph(edge_text("half_planes"), {samples(count), "aa.params.sequence=" + sequence});
  const Image image = graph.image(scene);
  double sum = 0;
  for (std::uint32_t y = 0; y < 64; ++y) {
    for (std::uint32_t x = 0; x < 64; ++x) {
      // The shader hands out its own angle and distance, so that no rounding of fract is in the comparison.
      const double truth = covered(image.at(x, y, 2), image.at(x, y, 3));
      sum += std::pow(image.at(x, y, 0) - truth, 2);
    }
  }
  return std::sqrt(sum / 4096);
}

/// Slope of log error over log count, by least squares.
double slope_of(const std::vector<std::pair<int, double>>& errors) {
  double x_mean = 0;
  double y_mean = 0;
  for (const auto& [count, error] : errors) {
    x_mean += std::log(count) / static_cast<double>(errors.size());
    y_mean += std::log(error) / static_cast<double>(errors.size());
  }
  double xy = 0;
  double xx = 0;
  for (const auto& [count, error] : errors) {
    xy += (std::log(count) - x_mean) * (std::log(error) - y_mean);
    xx += std::pow(std::log(count) - x_mean, 2);
  }
  return xy / xx;
}

TEST(Supersampled, ErrorOfEdgesFallsAsTheSequenceAllows) {
  // Independent points: -1/2. No points do better than -3/4 in root mean square over half planes for long (Alexander
  // 1990); R2's star discrepancy, O(n^(-1 + e)) (Niederreiter 1972), guarantees that it beats -1/2 + e. All pixels
  // share the points, so a fit of five counts scatters by about 0.1: it comes out at -0.82 for R2, -0.77 for Halton,
  // -0.58 for independent points.
  for (const char* sequence : {"r2", "halton", "random"}) {
    std::vector<std::pair<int, double>> errors;
    for (const int count : {4, 16, 64, 256, 1024}) errors.emplace_back(count, half_plane_error(sequence, count));
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

/// Area of a pixel inside of a convex polygon (counterclockwise where y points up), by clipping the pixel.
double covered(const std::vector<std::array<double, 2>>& polygon, double left, double bottom) {
  std::vector<std::array<double, 2>> rest{
      {left, bottom}, {left + 1, bottom}, {left + 1, bottom + 1}, {left, bottom + 1}};
  for (std::size_t e = 0; e < polygon.size(); ++e) {
    const auto& from = polygon[e];
    const auto& to = polygon[(e + 1) % polygon.size()];
    const auto side = [&](const std::array<double, 2>& p) {
      return (to[0] - from[0]) * (p[1] - from[1]) - (to[1] - from[1]) * (p[0] - from[0]);
    };
    std::vector<std::array<double, 2>> clipped;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const auto& a = rest[i];
      const auto& b = rest[(i + 1) % rest.size()];
      if (side(a) > 0) clipped.push_back(a);
      if ((side(a) > 0) == (side(b) > 0)) continue;
      const double t = side(a) / (side(a) - side(b));
      clipped.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
    }
    rest = std::move(clipped);
  }
  double area = 0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const auto& b = rest[(i + 1) % rest.size()];
    area += 0.5 * (rest[i][0] * b[1] - b[0] * rest[i][1]);
  }
  return area;
}

TEST(Supersampled, MeansOfARasterizedTriangleAreTheAreaThatItCovers) {
  // One unit of the plane z = 0 is half the picture's height. Alpha of radiance is 1 where there is a surface.
  constexpr int kSize = 32;
  const std::vector<std::array<double, 2>> corners{{-0.71, -0.62}, {0.83, -0.21}, {-0.13, 0.77}};
  Scene scene;
  std::vector<float> positions;
  std::vector<std::array<double, 2>> in_pixels;
  for (const auto& corner : corners) {
    for (const double x : {corner[0], corner[1], 0.0}) positions.push_back(static_cast<float>(x));
    in_pixels.push_back({(0.5 + 0.5 * corner[0]) * kSize, (0.5 + 0.5 * corner[1]) * kSize});
  }
  scene.add_mesh(positions, {}, {0, 1, 2}, dmat4(1.0));
  scene.look({0, 0, 2}, {0, 0, 0}, 2 * std::atan(0.5));
  constexpr int kCount = 1024;
  Graph graph(scene_text(kSize), {samples(kCount)});
  const Image image = graph.image(scene);
  double squares = 0;
  int edge_pixels = 0;
  glm::dvec2 shift(0.0);  // of the centre of gravity
  double area = 0;
  for (std::uint32_t y = 0; y < kSize; ++y) {
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const double truth = covered(in_pixels, x, kSize - 1.0 - y);
      const double error = image.at(x, y, 3) - truth;
      area += truth;
      shift += error * glm::dvec2(x + 0.5 - 0.5 * kSize, y + 0.5 - 0.5 * kSize);
      if (truth <= 0 || truth >= 1) {
        // A pixel whose area an edge misses by less than the rasterizer's grid may be met.
        EXPECT_LE(std::abs(error), 1.0 / 256) << x << ", " << y;
        continue;
      }
      ++edge_pixels;
      squares += error * error;
    }
  }
  // The sequence's error in half planes, and that rasterizers place corners on a grid of 1/256 pixel, for each sample
  // anew.
  EXPECT_GT(edge_pixels, 60);
  const double rms = std::sqrt(squares / edge_pixels);
  RecordProperty("rms_of_edge_pixels", std::to_string(rms));
  EXPECT_LT(rms, 2 * half_plane_error("r2", kCount) + 1.0 / 512);
  shift /= area;
  RecordProperty("shift_px", std::to_string(glm::length(shift)));
  EXPECT_LT(glm::length(shift), 1.0 / 256);
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
  const std::string table = parameter_table(nlohmann::json::parse(text), "antialiasing/supersampled");
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
