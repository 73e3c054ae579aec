// SPDX-License-Identifier: Apache-2.0
// The role ray_tracing's hard cases for ray_tracing/path_tracer (H1, H6 and the parts of H3 that closed forms know are
// in closed_forms_test.cpp), how its error falls, and what it says.
#include "parsed.hpp"
#include "roles/ray_tracing/measuring.hpp"
#include "roles/readme.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <tuple>
#include <utility>

namespace {

using namespace ray_tracing;

/// A room with two lamps, a mirror, a glossy and a clear thing: every kind of path.
void furnish(Scene& scene, const dvec3& eye = dvec3(0, 1, 3.4), double metal_roughness = 0.1) {
  scene.use_material(surface(0.7, 0.9, 0.0));
  scene.add_floor({0, 0, 0}, 2.0);
  scene.use_material(surface(0.6, 0.6, 0.0));
  scene.add_box({-2, 0, -2.1}, {2, 2, -2});
  scene.use_material(surface(0.9, metal_roughness, 1.0));
  scene.add_sphere({-0.6, 0.5, -0.5}, 0.5, 24);
  scene.use_material(surface(0.5, 0.3, 0.0));
  scene.add_box({0.3, 0, -0.8}, {0.9, 0.7, -0.2});
  HeddleMaterial clear = surface(0.8, 0.2, 0.0);
  clear.transmission = 0.9F;
  scene.use_material(clear);
  scene.add_box({0.0, 0.2, 0.3}, {0.5, 0.8, 0.5});
  HeddleMaterial glow = surface(0.2, 1.0, 0.0);
  glow.emissive[0] = 3.0F;
  glow.emissive[1] = 1.0F;
  scene.use_material(glow);
  scene.add_box({1.2, 1.2, -1.0}, {1.4, 1.4, -0.8});
  HeddleLight lamp = light(HEDDLE_LIGHT_RECTANGLE, {0, -1, 0.2}, 4.0);
  lamp.half_extent[0] = lamp.half_extent[1] = 0.4F;
  scene.add_light(lamp, {0, 1.9, 0});
  HeddleLight ball = light(HEDDLE_LIGHT_SPHERE, {0, -1, 0}, 20.0);
  ball.radius = 0.1F;
  scene.add_light(ball, {-1.2, 1.2, 0.2});
  scene.look(eye, eye - dvec3(0, 0.2, 3.4), 0.8);
}

std::vector<Image> all_ports(Graph& graph, Scene& scene) {
  const char* const ports[] = {"pt.radiance",  "pt.variance",         "pt.emission",          "pt.direct",
                               "pt.occlusion", "pt.indirect_diffuse", "pt.indirect_specular", "pt.shadow"};
  for (const char* port : ports) graph.keep(port);
  graph.render(scene);
  std::vector<Image> images;
  for (const char* port : ports) images.push_back(graph.read(port));
  return images;
}

void expect_same(const std::vector<Image>& a, const std::vector<Image>& b, const char* what) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].pixels, b[i].pixels) << what << ", image " << i;
}

const char* const kDim = "technique = \"uniform\"\nparams.radiance = [0.1, 0.2, 0.3]";

TEST(PathTracer, H2SameBytesOnAnyNumberOfThreadsAndOverAnyNumberOfFrames) {
  Scene scene;
  furnish(scene);
  const std::string base = "params.samples = 24\nparams.visibility = true\n";
  Graph one(graph_text(base + "params.threads = 1", kDim, 40));
  const std::vector<Image> expected = all_ports(one, scene);
  for (const char* threads : {"2", "5"}) {
    Graph more(graph_text(base + "params.threads = " + threads, kDim, 40));
    expect_same(all_ports(more, scene), expected, threads);
  }
  Graph frames(graph_text(base + "params.samples_per_frame = 7", kDim, 40));
  std::vector<Image> last;
  std::uint64_t samples = 0;
  for (int i = 0; i < 5; ++i) {
    last = all_ports(frames, scene);
    samples += counter(frames, "samples");
  }
  expect_same(last, expected, "in frames of 7");
  EXPECT_EQ(samples, 24U);
  EXPECT_EQ(counter(frames, "rays"), 0U) << "a frame after the last sample traces nothing";
}

class Folder {
 public:
  Folder() : path_(std::filesystem::path(testing::TempDir()) / ("path_tracer_" + std::to_string(::getpid()))) {
    std::filesystem::remove_all(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::filesystem::path path() const { return path_; }

 private:
  std::filesystem::path path_;
};

TEST(PathTracer, H2GoesOnFromACheckpointToTheSameBytes) {
  Scene scene;
  furnish(scene);
  const Folder folder;
  const std::string place = "params.checkpoint = \"" + folder.path().string() + "/\"\n";
  Graph whole(graph_text("params.samples = 20", kDim, 24));
  const std::vector<Image> expected = all_ports(whole, scene);
  {
    Graph begun(graph_text("params.samples = 9\n" + place, kDim, 24));
    begun.render(scene);
    EXPECT_EQ(counter(begun, "samples"), 9U);
  }
  Graph resumed(graph_text("params.samples = 20\n" + place, kDim, 24));
  expect_same(all_ports(resumed, scene), expected, "resumed");
  EXPECT_EQ(counter(resumed, "samples_taken_up"), 9U);
  EXPECT_EQ(counter(resumed, "samples"), 11U);
  // What is there already is not made again, and another view does not take it.
  Graph again(graph_text("params.samples = 20\n" + place, kDim, 24));
  expect_same(all_ports(again, scene), expected, "again");
  EXPECT_EQ(counter(again, "rays"), 0U);
  Scene other;
  furnish(other, {0.1, 1, 3.4});
  again.render(other);
  EXPECT_EQ(counter(again, "samples_taken_up"), 0U);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 2);
}

/// "" of a folder.
std::string bytes_of(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) return {};
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A graph with this checkpoint renders nothing, says `what`, twice as well as once, and leaves the file as it is.
void expect_refused(Scene& scene, const std::string& file, const std::string& params, const std::string& what) {
  const std::string before = bytes_of(file);
  Graph graph(graph_text("params.samples = 8\nparams.checkpoint = \"" + file + "\"\n" + params, kDim, 16));
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT) << what;
    EXPECT_THAT(heddle_error(Host::get().handle), testing::HasSubstr(what));
  }
  EXPECT_EQ(bytes_of(file), before) << what;
}

TEST(PathTracer, AFileThatIsNotItsOwnCheckpointIsRefusedAndStaysAsItIs) {
  Scene scene;
  furnish(scene);
  const Folder folder;
  std::filesystem::create_directories(folder.path());
  const std::string notes = (folder.path() / "notes.txt").string();
  for (const char* text : {"", "HDLPAT", "what took a week to write, and is longer than a head of forty bytes"}) {
    std::ofstream(notes, std::ios::binary) << text;
    expect_refused(scene, notes, "", "checkpoint '" + notes + "' is there and is no checkpoint of this technique");
  }
  expect_refused(scene, folder.path().string(), "", "is no checkpoint of this technique");

  const std::string file = (folder.path() / "room").string();
  Graph made(graph_text("params.samples = 8\nparams.checkpoint = \"" + file + "\"\n", kDim, 16));
  made.render(scene);
  expect_refused(scene, file, "params.bounces = 2\nparams.visibility = true",
                 "checkpoint '" + file +
                     "' was made of something else (bounces 0 instead of 2, visibility false instead "
                     "of true): it stays as it is; give another name, delete it, or give a folder");
  Scene moved;
  furnish(moved, {0.1, 1, 3.4});
  expect_refused(moved, file, "", "was made of something else (another scene, or seen from elsewhere");
  Scene changed;
  furnish(changed);
  changed.add_floor({0, 1, 0}, 0.1);
  expect_refused(changed, file, "", "was made of something else (another scene, or seen from elsewhere)");
  Graph wide(graph_text("params.samples = 8\nparams.checkpoint = \"" + file + "\"\n", kDim, 24));
  EXPECT_EQ(heddle_render(wide.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT);
  EXPECT_THAT(heddle_error(Host::get().handle), testing::HasSubstr("extent \"16 x 16\" instead of \"24 x 24\""));
  // One of another format, and one of another version of what a sample is.
  const std::string whole = bytes_of(file);
  const std::string old = (folder.path() / "old").string();
  std::ofstream(old, std::ios::binary) << "HDLPATH1" << whole.substr(8);
  expect_refused(scene, old, "", "(its format is of another version)");
  EXPECT_THAT(whole, testing::HasSubstr("\"version\": 5, "));
  Graph again(graph_text("params.samples = 8\nparams.checkpoint = \"" + file + "\"\n", kDim, 16));
  again.render(scene);
  EXPECT_EQ(counter(again, "samples_taken_up"), 8U) << "after all this it is still good";
}

TEST(PathTracer, ACheckpointOfMoreSamplesIsShownWholeAndSaysSo) {
  Scene scene;
  furnish(scene);
  const Folder folder;
  const std::string place = "params.checkpoint = \"" + folder.path().string() + "/\"\n";
  Host& host = Host::get();
  std::vector<Image> expected;
  for (const char* samples : {"8", "2"}) {
    host.log.clear();
    Graph graph(graph_text(std::string("params.samples = ") + samples + "\n" + place, kDim, 16));
    const std::vector<Image> shown = all_ports(graph, scene);
    if (expected.empty()) expected = shown;
    expect_same(shown, expected, samples);
    const auto said = std::ranges::count_if(host.log, [](const std::string& line) {
      return line.find(".path' holds 8 samples and `samples` asks for 2: all that it holds are shown") !=
             std::string::npos;
    });
    EXPECT_EQ(said, std::string(samples) == "2" ? 1 : 0);
  }
}

TEST(PathTracer, ADamagedCheckpointIsSetAside) {
  Scene scene;
  furnish(scene);
  const Folder folder;
  std::filesystem::create_directories(folder.path());
  const std::filesystem::path file = folder.path() / "room";
  const std::string text = graph_text("params.samples = 8\nparams.checkpoint = \"" + file.string() + "\"\n", kDim, 16);
  Graph(text).render(scene);
  const std::string whole = bytes_of(file);
  Host& host = Host::get();
  // In its key, its size, its settings and its pixels; cut short behind its head, and within it.
  int i = 0;
  for (const std::size_t at : {8U, 24U, 60U, 2000U, 1000U, 20U}) {
    std::string damaged = whole;
    if (++i > 4) {
      damaged.resize(at);
    } else {
      damaged[at] = static_cast<char>(damaged[at] ^ 4);
    }
    std::ofstream(file, std::ios::binary | std::ios::trunc) << damaged;
    host.log.clear();
    Graph after(text);
    after.render(scene);
    EXPECT_EQ(counter(after, "samples"), 8U) << at;
    const std::string aside = "room.damaged" + (i > 1 ? std::to_string(i) : "");
    EXPECT_THAT(host.log,
                testing::Contains(testing::HasSubstr("checkpoint '" + file.string() + "' is damaged: it is '" + aside +
                                                     "' now, and its samples are taken anew")));
    EXPECT_EQ(bytes_of(folder.path() / aside), damaged) << at;
    EXPECT_EQ(bytes_of(file), whole) << at;
  }
}

/// Another host in the shared one's place, that is cancelled at its n-th word of how far a trace has come.
class CancellingHost {
 public:
  explicit CancellingHost(int after) : after_(after) {
    const std::string path = HEDDLE_BUILD_DIR "/lib/heddle/plugins:" HEDDLE_BUILD_DIR "/tests/plugins";
    heddle_host_options options{};
    options.struct_size = sizeof options;
    options.plugin_path = path.c_str();
    options.progress = [](void* user, const char* activity, double done) -> std::uint32_t {
      auto& self = *static_cast<CancellingHost*>(user);
      if (std::string(activity) != "stage 'trace' of pass 'pt'") return 0;
      // The first word is the host's, of the frame as it begins the stage.
      if (!std::exchange(self.has_begun_, true)) return 0;
      self.told.push_back(done);
      if (static_cast<int>(self.told.size()) == self.after_) heddle_cancel(self.handle_);
      return 0;
    };
    options.progress_user = this;
    EXPECT_EQ(heddle_create(&options, &handle_), HEDDLE_OK) << heddle_error(nullptr);
    std::swap(handle_, Host::get().handle);
    shared_ = handle_;
    handle_ = Host::get().handle;
  }
  ~CancellingHost() {
    Host::get().handle = shared_;
    heddle_destroy(handle_);
  }
  CancellingHost(const CancellingHost&) = delete;
  CancellingHost& operator=(const CancellingHost&) = delete;
  std::vector<double> told;

 private:
  int after_;
  bool has_begun_ = false;
  heddle_host* handle_ = nullptr;
  heddle_host* shared_ = nullptr;
};

TEST(PathTracer, StopsWithinAStepAndKeepsWhatIsTraced) {
  const Folder folder;
  constexpr int kTold = 3;
  // A tile of many samples, and more tiles than a step has.
  for (const auto& [extent, samples, most] : {std::tuple{8U, 1000000U, 1024U}, std::tuple{144U, 1000U, 4U}}) {
    const std::string place = "params.checkpoint = \"" + folder.path().string() + "/\"\n";
    const std::string sky = "technique = \"uniform\"";
    {
      CancellingHost host(kTold);
      Scene nothing;
      nothing.look({0, 0, 1}, {0, 0, 0});
      Graph graph(graph_text("params.samples = " + std::to_string(samples) + "\n" + place, sky, extent));
      EXPECT_EQ(heddle_render(graph.handle, nothing.handle, nullptr), HEDDLE_CANCELLED);
      ASSERT_EQ(host.told.size(), static_cast<std::size_t>(kTold)) << "nothing goes on after it was cancelled";
      for (std::size_t i = 0; i < host.told.size(); ++i) {
        const double paths = (host.told[i] - (i > 0 ? host.told[i - 1] : 0.0)) * samples * extent * extent;
        EXPECT_GT(paths, 0.0);
        EXPECT_LE(paths, 65536.0 * (1 + 1e-9));
      }
    }
    // Up to the step in which it was cancelled, and that one.
    Scene nothing;
    nothing.look({0, 0, 1}, {0, 0, 0});
    const std::uint32_t more = extent == 8 ? 5000 : 10;
    Graph graph(graph_text("params.samples = " + std::to_string(more) + "\n" + place, sky, extent));
    graph.render(nothing);
    const std::uint64_t kept = counter(graph, "samples_taken_up");
    EXPECT_GT(kept, 0U);
    EXPECT_LE(kept, (kTold + 1) * most);
    EXPECT_EQ(counter(graph, "samples"), more - kept);
  }
}

TEST(PathTracer, H3PartsSumUpToRadianceAndEndWhereBouncesDo) {
  Scene scene;
  furnish(scene);
  Graph graph(graph_text("params.samples = 16", kDim, 32));
  const std::vector<Image> images = all_ports(graph, scene);
  for (std::size_t i = 0; i < images[0].pixels.size(); ++i) {
    if (i % 4 == 3) continue;
    const float sum = images[2].pixels[i] + images[3].pixels[i] + images[5].pixels[i] + images[6].pixels[i];
    ASSERT_NEAR(images[0].pixels[i], sum, 1e-6F * (1.0F + sum));
  }
  for (const float pixel : images[4].pixels) EXPECT_EQ(pixel, 1.0F);
  EXPECT_EQ(counter(graph, "visibility_rays"), 0U) << "nobody asked for visibility";
  Graph once(graph_text("params.samples = 16\nparams.bounces = 1", kDim, 32));
  const std::vector<Image> single = all_ports(once, scene);
  for (std::size_t i = 0; i < single[5].pixels.size(); ++i) {
    if (i % 4 == 3) continue;
    ASSERT_EQ(single[5].pixels[i] + single[6].pixels[i], 0.0F);
  }
}

TEST(PathTracer, RaysThatAreReplayedMeetWhatTheyMet) {
  Scene scene;
  furnish(scene);
  const std::string settings = "params.samples = 8\nparams.visibility = true\nparams.threads = ";
  Graph traced(graph_text(settings + "2", kDim, 16)),
      replayed(graph_text(settings + "2\nparams.replay = true", kDim, 16));
  const std::vector<Image> images = all_ports(traced, scene), same = all_ports(replayed, scene);
  for (std::size_t i = 0; i < images.size(); ++i) EXPECT_EQ(images[i].pixels, same[i].pixels) << i;
  EXPECT_GT(counter(replayed, "hits"), counter(replayed, "rays") / 2);
  EXPECT_EQ(counter(replayed, "replayed_hits"), counter(replayed, "hits"));
  EXPECT_GT(counter(replayed, "replay_us"), 0U);
  EXPECT_EQ(counter(traced, "replay_us"), 0U) << "nobody asked";
}

TEST(PathTracer, VisibilityIsThatOfTheRolesItIsTheTruthOf) {
  // A ball of radius r at height h over the floor closes (r / h)^2 of the sky straight below it, and half of a lamp as
  // large as itself and twice as far is hidden behind an edge under its middle.
  Scene ball;
  ball.use_material(surface(0.5, 1.0, 0.0));
  ball.add_floor({0, 0, 0}, 3.0);
  ball.add_sphere({0, 2, 0}, 1.0, 96);
  ball.add_light(light(HEDDLE_LIGHT_POINT, {0, -1, 0}, 1.0), {0, 5, 0});
  ball.look({0.3, 0.9, 0}, {0, 0, 0}, 1e-3);
  Graph graph(graph_text(
      "params.samples = 1024\nparams.visibility = true\nparams.occlusion_radius = 100\nparams.bounces = 1", "", 8));
  std::vector<Image> images = all_ports(graph, ball);
  double open = 0.0;
  for (const float pixel : images[4].pixels) open += static_cast<double>(pixel) / 64.0;
  EXPECT_NEAR(open, 0.75, 4e-3);  // binomial over 65,536 rays: 4 times 1.7e-3 at worst, far less by Sobol's points
  for (const float pixel : images[7].pixels) EXPECT_EQ(pixel, 0.0F);
  EXPECT_GT(counter(graph, "visibility_rays"), 0U);

  Scene edge;
  edge.use_material(surface(0.5, 1.0, 0.0));
  edge.add_floor({0, 0, 0}, 3.0);
  edge.add_box({-5, 0.9, -5}, {0, 1, 5});
  HeddleLight lamp = light(HEDDLE_LIGHT_RECTANGLE, {0, -1, 0}, 1.0);
  lamp.half_extent[0] = lamp.half_extent[1] = 0.2F;
  edge.add_light(lamp, {0, 2, 0});
  edge.look({0.6, 0.7, 0}, {0, 0, 0}, 1e-3);
  Graph half(graph_text("params.samples = 256\nparams.visibility = true\nparams.bounces = 1", "", 8));
  images = all_ports(half, edge);
  double lit = 0.0;
  for (const float pixel : images[7].pixels) lit += static_cast<double>(pixel) / 64.0;
  EXPECT_NEAR(lit, 0.5, 5e-3);
}

TEST(PathTracer, ShadowOfAllLightsIsTheirMeanByWhatTheySend) {
  // Three lamps over a floor's middle, from above, from the side and from below; a roof hides the first. What they send
  // there: 40 / 5^2, 100 / 50 cos 45 degrees; nothing from below.
  const auto mean_shadow = [](bool is_first_casting) {
    Scene scene;
    scene.use_material(surface(0.5, 1.0, 0.0));
    scene.add_floor({0, 0, 0}, 3.0);
    scene.add_box({-0.5, 2, -0.5}, {0.5, 2.1, 0.5});
    HeddleLight above = light(HEDDLE_LIGHT_POINT, {0, -1, 0}, 40.0);
    if (!is_first_casting) above.flags &= ~static_cast<std::uint32_t>(HEDDLE_LIGHT_CASTS_SHADOW);
    scene.add_light(above, {0, 5, 0});
    scene.add_light(light(HEDDLE_LIGHT_POINT, {0, -1, 0}, 100.0), {5, 5, 0});
    scene.add_light(light(HEDDLE_LIGHT_POINT, {0, 1, 0}, 1000.0), {0, -1, 0});
    scene.look({0.9, 1, 0}, {0, 0, 0}, 1e-3);
    Graph graph(graph_text(
        "params.samples = 1024\nparams.visibility = true\nparams.shadow_light = -2\nparams.bounces = 1", "", 8));
    double sum = 0.0;
    const std::vector<Image> images = all_ports(graph, scene);
    for (const float pixel : images[7].pixels) sum += static_cast<double>(pixel) / 64.0;
    return sum;
  };
  const double hidden = 40.0 / 25.0, seen = 100.0 / 50.0 * std::sqrt(0.5);
  // Binomial over 65,536 samples: 4 standard deviations are 8e-3 without a plan, and these are Sobol's points.
  EXPECT_NEAR(mean_shadow(true), seen / (hidden + seen), 4e-3);
  EXPECT_EQ(mean_shadow(false), 1.0);
}

TEST(PathTracer, VisibilityIsThatOfTheFirstSolidSurfaceBehindLayers) {
  // A floor in a closed box is neither open nor lit; the camera within it looks through two layers.
  const auto show = [](int layers) {
    Scene scene;
    scene.use_material(surface(0.5, 1.0, 0.0));
    scene.add_floor({0, 0, 0}, 1.0);
    scene.add_box({-1, 1, -1}, {1, 1.1, 1});  // the lid
    for (const double side : {-1.0, 1.0}) {
      scene.add_box({side - 0.05, -0.1, -1.1}, {side + 0.05, 1.1, 1.1});
      scene.add_box({-1.1, -0.1, side - 0.05}, {1.1, 1.1, side + 0.05});
    }
    HeddleMaterial half = surface(0.5, 1.0, 0.0);
    half.alpha_mode = HEDDLE_ALPHA_BLEND;
    half.base_color[3] = 0.5F;
    HeddleMaterial whole = half;  // blended, yet nothing is seen through it
    whole.base_color[3] = 1.0F;
    if (layers > 0) scene.use_material(half);
    if (layers > 0) scene.add_floor({0, 0.3, 0}, 0.8);
    if (layers > 1) scene.use_material(whole);
    if (layers > 1) scene.add_floor({0, 0.2, 0}, 0.8);
    scene.add_light(light(HEDDLE_LIGHT_POINT, {0, -1, 0}, 1.0), {0, 5, 0});
    scene.look({0.1, 0.8, 0}, {0, 0, 0}, 0.3);
    Graph graph(graph_text("params.samples = 64\nparams.visibility = true\nparams.occlusion_radius = 10", "", 16));
    std::vector<Image> images = all_ports(graph, scene);
    // One ray of each kind for each sample, whatever is in front.
    EXPECT_EQ(counter(graph, "visibility_rays"), 2U * 64 * 16 * 16) << layers;
    return images;
  };
  for (const int layers : {0, 1, 2}) {
    const std::vector<Image> images = show(layers);
    for (const int port : {4, 7})
      for (const float pixel : images[static_cast<std::size_t>(port)].pixels) ASSERT_EQ(pixel, 0.0F) << layers;
  }
}

TEST(PathTracer, ShadowLightIsOneOfThoseThatThereAre) {
  const auto refused = [](Scene& scene, const char* number) -> std::string {
    Graph graph(
        graph_text(std::string("params.samples = 1\nparams.visibility = true\nparams.shadow_light = ") + number));
    EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT);
    return heddle_error(Host::get().handle);
  };
  Scene scene;
  scene.add_floor({0, 0, 0}, 1.0);
  scene.look({0, 1, 1}, {0, 0, 0});
  EXPECT_THAT(refused(scene, "0"), testing::HasSubstr("shadow_light: no light has the number 0; there are no lights"));
  scene.add_light(light(HEDDLE_LIGHT_POINT), {0, 1, 0});
  EXPECT_THAT(refused(scene, "1"), testing::HasSubstr("no light has the number 1; there is 1 light, number 0"));
  scene.add_light(light(HEDDLE_LIGHT_POINT), {0, 2, 0});
  EXPECT_THAT(refused(scene, "7"), testing::HasSubstr("no light has the number 7; there are 2 lights, numbers 0 to 1"));
  Graph last(graph_text("params.samples = 1\nparams.visibility = true\nparams.shadow_light = 1"));
  last.render(scene);
}

/// A plane under count x count point lights with a range of two of their distances: the exact sum is known.
Measured grid_of_lights(int count, double& truth) {
  Scene scene;
  const HeddleMaterial record = surface(0.5, 1.0, 0.0);
  scene.use_material(record);
  scene.add_floor({0, 0, 0}, 60.0);
  const heddle_surface_point point = point_of(record);
  const dvec3 V = glm::normalize(dvec3(0.5, 1.0, 0.2));
  const dvec3 v(V.x, -V.z, V.y);
  truth = 0.0;
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j) {
      HeddleLight lamp = light(HEDDLE_LIGHT_POINT, {0, -1, 0}, 0.5 + (i * 7 + j * 3) % 5);
      lamp.flags = 0;
      lamp.range = 2.0F;
      const dvec3 position(i - 0.5 * count + 0.37, 0.5 + 0.1 * ((i + j) % 3), j - 0.5 * count + 0.21);
      scene.add_light(lamp, position);
      const double d2 = glm::dot(position, position);
      if (d2 >= 4.0) continue;
      const dvec3 L = position / std::sqrt(d2), l(L.x, -L.z, L.y);
      double rgb[3];
      material_service().evaluate(&point, &v.x, &l.x, 0, 1, rgb);
      truth += rgb[0] * L.y * static_cast<double>(lamp.intensity[0]) * (1 - d2 * d2 / 16.0) / d2;
    }
  scene.look(V, {0, 0, 0}, 1e-4);
  return measure(scene, graph_text("params.samples = 64\nparams.bounces = 1\nparams.points = \"independent\"", "", 8));
}

TEST(PathTracer, H5TenThousandLightsAreSampledAsWellAsAHundred) {
  double truth = 0.0, truth_of_few = 0.0;
  const Measured few = grid_of_lights(10, truth_of_few);
  const Measured many = grid_of_lights(100, truth);
  // No light beyond the hundred reaches the point: both sums are the same, and so both means, within their errors.
  EXPECT_NEAR(truth, truth_of_few, 1e-12 * truth);
  EXPECT_LT(std::abs(many.mean.x - few.mean.x),
            4.0 * std::hypot(few.standard_error.x, many.standard_error.x) + 2e-4 * truth);
  EXPECT_LT(std::abs(few.mean.x - truth_of_few), 4.0 * few.standard_error.x + 2e-4 * truth_of_few);
  EXPECT_LT(std::abs(many.mean.x - truth), 4.0 * many.standard_error.x + 2e-4 * truth);
  EXPECT_LT(many.standard_error.x / truth, 1.25 * few.standard_error.x / truth_of_few);
  // 4096 samples of one light each: chosen evenly among 10,000, one in about 800 would meet a light that reaches here,
  // and the error would be near sqrt(800 / 4096) of the whole.
  EXPECT_LT(many.standard_error.x / truth, 0.02);
}

TEST(PathTracer, ASunOfAnEnvironmentImageIsFoundByItsBrightness) {
  constexpr std::uint32_t kWidth = 64, kHeight = 32;
  std::vector<float> rgba(std::size_t{4} * kWidth * kHeight, 0.0F);
  for (std::size_t i = 0; i < std::size_t{kWidth} * kHeight; ++i)
    rgba[4 * i] = rgba[4 * i + 1] = rgba[4 * i + 2] = 0.05F;
  const std::size_t sun = (std::size_t{8} * kWidth + 40) * 4;
  rgba[sun] = rgba[sun + 1] = rgba[sun + 2] = 5000.0F;
  Scene scene;
  const HeddleMaterial record = surface(0.5, 1.0, 0.0);
  scene.use_material(record);
  scene.add_floor({0, 0, 0}, 5.0);
  heddle_environment environment{};
  environment.struct_size = sizeof environment;
  environment.width = kWidth;
  environment.height = kHeight;
  environment.channels = 4;
  environment.pixels = rgba.data();
  environment.scale = 1.0;
  environment.rotation[3] = 1.0;
  check(heddle_scene_set_environment(scene.handle, &environment));
  const dvec3 V = glm::normalize(dvec3(0.5, 1.0, 0.2));
  scene.look(V, {0, 0, 0}, 1e-4);
  // Bilinear between texel centres, by midpoints of 16 x 16 a texel.
  const heddle_surface_point point = point_of(record);
  const dvec3 v(V.x, -V.z, V.y);
  double truth = 0.0;
  constexpr int kFine = 16;
  for (int row = 0; row < static_cast<int>(kHeight / 2) * kFine; ++row)
    for (int column = 0; column < static_cast<int>(kWidth) * kFine; ++column) {
      const double x = (column + 0.5) / kFine, y = (row + 0.5) / kFine;
      const double near_x = std::max(1.0 - std::abs(x - 40.5), 0.0), near_y = std::max(1.0 - std::abs(y - 8.5), 0.0);
      const double radiance = 0.05 + (5000.0 - 0.05) * near_x * near_y;
      const double polar = y / kHeight * kPi, azimuth = (x / kWidth - 0.5) * 2 * kPi;
      const dvec3 L(std::sin(polar) * std::sin(azimuth), std::cos(polar), -std::sin(polar) * std::cos(azimuth));
      const dvec3 l(L.x, -L.z, L.y);
      double rgb[3];
      material_service().evaluate(&point, &v.x, &l.x, 0, 1, rgb);
      truth += rgb[0] * L.y * radiance * std::sin(polar) * (kPi / kHeight) * (2 * kPi / kWidth) / (kFine * kFine);
    }
  const Measured measured =
      measure(scene, graph_text("params.samples = 64\nparams.bounces = 1\nparams.sky_resolution = 8",
                                "technique = \"environment_map\"", 8));
  EXPECT_LT(std::abs(measured.mean.x - truth), 4.0 * measured.standard_error.x + 1e-3 * truth)
      << measured.mean.x << " +- " << measured.standard_error.x << " for " << truth;
  EXPECT_LT(measured.standard_error.x, 5e-3 * truth);
}

TEST(PathTracer, H7TheSceneMovedBy100KilometresGivesTheSamePicture) {
  Scene here, far(dvec3(1e5, -3e4, 7e4));
  furnish(here);
  furnish(far);
  const std::string text = graph_text("params.samples = 64", kDim, 24);
  const Measured a = measure(here, text), b = measure(far, text);
  for (int c = 0; c < 3; ++c)
    EXPECT_LT(std::abs(a.mean[c] - b.mean[c]), 4.0 * std::hypot(a.standard_error[c], b.standard_error[c]));
}

TEST(PathTracer, H8NumbersAreFiniteWhereCamerasAndLightsAreInTheWay) {
  Scene scene;
  scene.use_material(surface(0.5, 0.0, 1.0));
  scene.add_floor({0, 0, 0}, 2.0);
  scene.add_mesh({0, 1, 0, 0, 1, 0, 1, 1, 0}, {}, {0, 1, 2}, dmat4(1.0));  // without area
  HeddleMaterial glow = surface(0.5, 1.0, 0.0);
  glow.emissive[0] = 1.0F;
  scene.use_material(glow);
  scene.add_mesh({0, 1, 0, 0, 1, 0, 1, 1, 0}, {}, {0, 1, 2}, dmat4(1.0));
  for (const std::uint32_t type :
       {HEDDLE_LIGHT_POINT, HEDDLE_LIGHT_SPHERE, HEDDLE_LIGHT_RECTANGLE, HEDDLE_LIGHT_CAPSULE, HEDDLE_LIGHT_WEDGE}) {
    for (const dvec3& place : {dvec3(0, 0, 0), dvec3(0, 1, 1)}) {
      HeddleLight lamp = light(type, {0, -1, 0}, 1.0);
      lamp.radius = 0.5F;
      lamp.segment_length = 1.0F;
      lamp.half_extent[0] = lamp.half_extent[1] = 0.5F;
      scene.add_light(lamp, place);
    }
  }
  HeddleLight nothing = light(HEDDLE_LIGHT_SPHERE, {0, -1, 0}, 1.0);
  scene.add_light(nothing, {0, 0.5, 0});
  scene.look({0, 1, 1}, {0, 0, 0}, 1.0);
  Graph graph(graph_text("params.samples = 32\nparams.visibility = true", kDim, 24));
  for (const Image& image : all_ports(graph, scene))
    for (const float pixel : image.pixels) ASSERT_TRUE(std::isfinite(pixel) && pixel >= 0.0F);
}

/// Of the red channel.
float brightest(const Image& image) {
  float most = 0.0F;
  for (std::size_t i = 0; i < image.pixels.size(); i += image.channels) most = std::max(most, image.pixels[i]);
  return most;
}

TEST(PathTracer, WhatGlowsIsSeenAloneWhereLightsStandForIt) {
  Scene scene;
  HeddleMaterial glow = surface(0.0, 1.0, 0.0);
  glow.emissive[0] = 5.0F;
  scene.use_material(glow);
  scene.add_box({-0.2, 0.5, -0.2}, {0.2, 0.7, 0.2});
  scene.use_material(surface(0.7, 1.0, 0.0));
  scene.add_floor({0, 0, 0}, 2.0);
  scene.look({0, 1, 3}, {0, 0.3, 0}, 0.6);
  Graph graph(graph_text("params.samples = 16\nparams.emission = \"seen\"", "", 16));
  const std::vector<Image> images = all_ports(graph, scene);
  EXPECT_EQ(counter(graph, "glowing_triangles"), 0U);
  EXPECT_EQ(brightest(images[3]), 0.0F);
  EXPECT_GT(brightest(images[2]), 4.0F);
  Graph lit(graph_text("params.samples = 16", "", 16));
  EXPECT_GT(brightest(all_ports(lit, scene)[3]), 0.1F);
  EXPECT_EQ(counter(lit, "glowing_triangles"), 12U);
}

TEST(PathTracer, AnAlphaMaskHasHolesForTheCameraAndForLight) {
  Scene scene;
  HeddleMaterial hole = surface(0.5, 1.0, 0.0);
  hole.alpha_mode = HEDDLE_ALPHA_MASK;
  hole.base_color[3] = 0.2F;
  scene.use_material(hole);
  scene.add_floor({0, 0.5, 0}, 2.0);
  scene.use_material(surface(0.5, 1.0, 0.0));
  scene.add_floor({0, 0, 0}, 2.0);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0}, 1.0));
  scene.look({0.5, 2, 0}, {0, 0, 0}, 1e-3);
  const Measured with = measure(scene, graph_text("params.samples = 8", "", 8));
  Scene without;
  without.use_material(surface(0.5, 1.0, 0.0));
  without.add_floor({0, 0, 0}, 2.0);
  without.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0}, 1.0));
  without.look({0.5, 2, 0}, {0, 0, 0}, 1e-3);
  const Measured alone = measure(without, graph_text("params.samples = 8", "", 8));
  EXPECT_GT(alone.mean.x, 0.1);
  EXPECT_NEAR(with.mean.x, alone.mean.x, 1e-6);
}

TEST(PathTracer, TexturesNormalsAndVertexColoursAreThoseThatRasterizersDraw) {
  Scene scene;
  heddle_material material{};
  material.struct_size = sizeof material;
  material.record = surface(0.9, 0.9, 0.8);
  material.record.emissive[0] = 0.3F;
  material.record.emissive[2] = 0.2F;
  material.record.normal_scale = 0.7F;
  material.record.occlusion_strength = 0.0F;
  // Each texture with a transform of its own, two of them on uv1.
  material.record.texture_uv_sets = 1U << HEDDLE_TEXTURE_METALLIC_ROUGHNESS | 1U << HEDDLE_TEXTURE_EMISSIVE;
  const auto place = [](float* matrix, float* offset, float scale, float turn) {
    matrix[0] = matrix[3] = scale * std::cos(turn);
    matrix[1] = scale * std::sin(turn);
    matrix[2] = -matrix[1];
    offset[0] = 0.1F * turn;
    offset[1] = 0.3F;
  };
  place(material.record.uv_rotation_scale, material.record.uv_offset, 0.6F, 0.0F);
  place(material.record.uv_rotation_scale_1, material.record.uv_offset_1_2, 0.8F, 0.5F);
  place(material.record.uv_rotation_scale_2, material.record.uv_offset_1_2 + 2, 1.0F, 1.0F);
  place(material.record.uv_rotation_scale_4, material.record.uv_offset_3_4 + 2, 1.2F, 2.0F);
  std::uint32_t state = 7;
  for (std::uint32_t slot = 0; slot < HEDDLE_TEXTURE_COUNT; ++slot) {
    std::array<std::uint8_t, 8 * 4 * 4> rgba;
    for (std::size_t i = 0; i < rgba.size(); ++i) {
      state = state * 1664525U + 1013904223U;
      const bool is_up = slot == HEDDLE_TEXTURE_NORMAL && i % 4 == 2;
      rgba[i] = static_cast<std::uint8_t>(i % 4 == 3 || is_up ? 255 : 64 + (state >> 24U) / 2);
    }
    heddle_texture texture{};
    texture.struct_size = sizeof texture;
    texture.width = 8;
    texture.height = 4;
    texture.is_srgb = slot == HEDDLE_TEXTURE_BASE_COLOR || slot == HEDDLE_TEXTURE_EMISSIVE ? 1 : 0;
    texture.wrap_u = slot % 3;
    texture.wrap_v = (slot + 1) % 3;
    texture.filter = HEDDLE_FILTER_FINEST_LEVEL;
    texture.rgba = rgba.data();
    check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &material.textures[slot]));
  }
  std::uint32_t id = 0;
  check(heddle_scene_add_material(scene.handle, nullptr, &material, &id));
  const std::vector<float> positions{-1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, -1};
  const std::vector<float> uv0{0, 0, 0, 1, 1, 1, 1, 0}, uv1{1, 0, 0, 0.5F, 0.7F, 1, 1, 1};
  const std::vector<float> colors{1, 0.5F, 1, 1, 1, 1, 0.25F, 1, 0.5F, 1, 1, 1, 1, 1, 1, 1};
  const std::vector<std::uint32_t> indices{0, 1, 2, 0, 2, 3};
  heddle_mesh mesh{};
  mesh.struct_size = sizeof mesh;
  mesh.vertex_count = 4;
  mesh.index_count = 6;
  mesh.positions = positions.data();
  mesh.uv0 = uv0.data();
  mesh.uv1 = uv1.data();
  mesh.colors = colors.data();
  mesh.indices = indices.data();
  std::uint32_t mesh_id = 0;
  check(heddle_scene_add_mesh(scene.handle, nullptr, &mesh, id, &mesh_id));
  // One of them mirrored: its bumps are, too.
  for (const double side : {1.0, -1.0}) {
    const dmat4 matrix = glm::scale(glm::translate(dmat4(1.0), dvec3(side, 0, 0)), dvec3(side, 1, 1));
    check(heddle_scene_add_instance(scene.handle, nullptr, mesh_id, &matrix[0][0], &id));
  }
  HeddleLight sun = light(HEDDLE_LIGHT_DIRECTIONAL, {0.4, -1, 0.3}, 3.0);
  sun.flags = 0;
  scene.add_light(sun);
  scene.look({0.2, 1.6, 0.7}, {0, 0, 0}, 0.9);
  Graph traced(graph_text(
      "params.samples = 1\nparams.filter = \"point\"\nparams.emission = \"seen\"\nparams.bounces = 1", "", 64));
  const Image ours = traced.image(scene);
  Graph drawn(
      "extent = [64, 64]\noutput = \"lighting.radiance\"\n[[pass]]\nname = \"material\"\nrole = \"surface_material\"\n"
      "technique = \"ggx\"\n[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\ntechnique = \"raster\"\n"
      "params.precision = \"float32\"\n[[pass]]\nname = \"lighting\"\nrole = \"lighting\"\ntechnique = \"deferred\"\n"
      "params.precision = \"float32\"\n");
  const Image theirs = drawn.image(scene);
  int count = 0, off = 0;
  for (std::uint32_t y = 0; y < 64; ++y)
    for (std::uint32_t x = 0; x < 64; ++x) {
      if (ours.at(x, y, 3) != 1.0F || theirs.at(x, y, 3) != 1.0F) continue;
      ++count;
      // Texture units weigh by 1/256 of a texel, of at most half the range, which bumps and glossy lobes steepen. What
      // is looked up in a wrong place is off nearly everywhere.
      for (std::uint32_t c = 0; c < 3; ++c)
        off += std::abs(ours.at(x, y, c) - theirs.at(x, y, c)) > 0.04F * theirs.at(x, y, c) + 0.002F ? 1 : 0;
    }
  EXPECT_GT(count, 2000);
  EXPECT_LT(off, 3 * count / 50);
}

/// Slope of log error over log samples, from replicates, and the errors themselves.
double error_slope(const char* points, std::vector<double>& errors) {
  constexpr int kReplicates = 12;
  Scene scene;
  // Rough, because caustics of lamps in a smooth sphere, found by chance, would be most of the error: a few paths, of
  // which a dozen replicates say nothing.
  furnish(scene, dvec3(0, 1, 3.4), 0.5);
  Graph graph(graph_text(std::string("params.points = \"") + points + "\"", kDim, 12));
  std::vector<double> logs_n, logs_e;
  for (const int samples : {16, 64, 256}) {
    graph.set("pt.params.samples=" + std::to_string(samples));
    std::vector<std::vector<float>> images;
    for (int i = 0; i < kReplicates; ++i) {
      heddle_render_options options{};
      options.struct_size = sizeof options;
      options.seed = static_cast<std::uint64_t>(1000 * samples + i);
      check(heddle_render(graph.handle, scene.handle, &options));
      images.push_back(graph.read("pt.radiance").pixels);
    }
    double variance = 0.0;
    for (std::size_t p = 0; p < images[0].size(); ++p) {
      double sum = 0.0, squares = 0.0;
      for (const auto& image : images) {
        sum += static_cast<double>(image[p]);
        squares += static_cast<double>(image[p]) * static_cast<double>(image[p]);
      }
      variance += (squares - sum * sum / kReplicates) / (kReplicates - 1);
    }
    errors.push_back(std::sqrt(variance / static_cast<double>(images[0].size())));
    logs_n.push_back(std::log(samples));
    logs_e.push_back(std::log(errors.back()));
  }
  return (logs_e.back() - logs_e.front()) / (logs_n.back() - logs_n.front());
}

TEST(PathTracer, ErrorFallsWithTheRootOfTheSamplesAndFasterBySobol) {
  std::vector<double> independent, sobol;
  const double slope = error_slope("independent", independent);
  EXPECT_NEAR(slope, -0.5, 0.05);
  EXPECT_LE(error_slope("sobol", sobol), -0.45);
  for (std::size_t i = 0; i < sobol.size(); ++i) EXPECT_LE(sobol[i], independent[i]) << i;
}

TEST(PathTracer, EndsAtTheErrorThatIsAskedFor) {
  Scene scene;
  furnish(scene);
  Graph graph(graph_text("params.samples = 100000\nparams.target_error = 0.1", kDim, 16));
  graph.render(scene);
  EXPECT_LE(counter(graph, "relative_error_ppm"), 100000U);
  EXPECT_LT(counter(graph, "samples"), 100000U);
}

TEST(PathTracer, SaysWhatItMisses) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 1.0);
  Graph graph(
      "extent = [8, 8]\noutput = \"pt.radiance\"\n[[pass]]\nname = \"pt\"\nrole = \"ray_tracing\"\ntechnique = "
      "\"path_tracer\"\n");
  EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_BAD_INPUT);
  EXPECT_THAT(
      heddle_error(Host::get().handle),
      testing::HasSubstr("needs a surface_material that answers on the CPU too; found none above it: add a pass "
                         "of role 'surface_material', technique 'ggx'"));
}

TEST(PathTracer, ReadmeHasTheDescriptorsTable) {
  const char* text = nullptr;
  check(heddle_list(Host::get().handle, &text));
  std::ifstream file(HEDDLE_SOURCE_DIR "/plugins/ray_tracing/path_tracer/README.md");
  const std::string readme((std::istreambuf_iterator<char>(file)), {});
  EXPECT_THAT(readme, testing::HasSubstr(parameter_table(parsed::json(text), "ray_tracing/path_tracer")));
}

}  // namespace
