// SPDX-License-Identifier: Apache-2.0
// Jobs through the C API: what they leave, from where, by what key; slices that are stopped, killed and gone on with;
// what frame graphs take from them; mistakes.
#include "execute/cached_host.hpp"
#include "parsed.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstring>

namespace {

using heddle_test::CachedHost;
using heddle_test::Json;
namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kCountJob =
    "kind = \"job\"\n[[pass]]\nname = \"count\"\nrole = \"job_probe\"\ntechnique = \"count\"\n";
constexpr const char* kGpuJob =
    "kind = \"job\"\n[[pass]]\nname = \"sums\"\nrole = \"job_probe\"\ntechnique = \"gpu\"\n";

constexpr const char* kPairJob =
    "kind = \"job\"\n[[pass]]\nname = \"pair\"\nrole = \"job_probe\"\ntechnique = \"pair\"\n";

class Host : public CachedHost {
 public:
  using CachedHost::CachedHost;
  Json run(const heddle_render_options* options = nullptr) {
    const char* text = nullptr;
    EXPECT_EQ(heddle_job_run(graph, scene, options, &text), HEDDLE_OK) << error();
    return text == nullptr ? Json() : parsed::json(text);
  }
  heddle_status try_run() {
    const char* text = nullptr;
    return heddle_job_run(graph, scene, nullptr, &text);
  }
  std::vector<double> table(const char* name = nullptr) {
    const void* data = nullptr;
    std::uint64_t bytes = 0;
    EXPECT_EQ(heddle_job_artifact(graph, name, &data, &bytes), HEDDLE_OK) << error();
    std::vector<double> numbers(bytes / sizeof(double));
    if (bytes > 0) std::memcpy(numbers.data(), data, bytes);
    return numbers;
  }
  /// The first number of a kept image.
  float first_of(const char* resource) {
    heddle_image image{};
    image.struct_size = sizeof image;
    EXPECT_EQ(heddle_read(graph, resource, 0, 0, &image), HEDDLE_OK) << error();
    return image.pixels == nullptr ? -1 : image.pixels[0];
  }
  /// A rectangle light, the first one, with a texture of 2 x 1 texels of these greys.
  void add_lamp(float left, float right) {
    heddle_light light{};
    light.struct_size = sizeof light;
    light.record.type = HEDDLE_LIGHT_RECTANGLE;
    light.record.direction[2] = light.record.tangent[0] = 1;
    std::fill_n(light.record.half_extent, 2, 1.0F);
    std::fill_n(light.record.intensity, 3, 1.0F);
    std::uint32_t id = 0;
    ASSERT_EQ(heddle_scene_add_light(scene, "lamp", &light, &id), HEDDLE_OK) << error();
    set_texture(left, right);
  }
  void set_texture(float left, float right) {
    const std::array<float, 2> texels{left, right};
    heddle_image image{};
    image.struct_size = sizeof image;
    image.width = 2;
    image.height = image.channels = 1;
    image.pixels = texels.data();
    ASSERT_EQ(heddle_scene_set_light_texture(scene, 0, &image), HEDDLE_OK) << error();
  }
  [[nodiscard]] std::ptrdiff_t slices() const { return count_said("): slice "); }
  /// One triangle with corners at 0, (width, 0, 0) and (0, 1, 0).
  void add_triangle(float width) {
    heddle_material material{};
    material.struct_size = sizeof material;
    for (std::uint32_t& texture : material.textures) texture = HEDDLE_NONE;
    material.record.roughness = 1;
    material.record.ior = 1.5F;
    material.record.base_color[0] = material.record.base_color[3] = 1;
    std::uint32_t id = 0;
    ASSERT_EQ(heddle_scene_add_material(scene, "grey", &material, &id), HEDDLE_OK) << error();
    const std::array<float, 9> positions{0, 0, 0, width, 0, 0, 0, 1, 0};
    const std::array<float, 9> normals{0, 0, 1, 0, 0, 1, 0, 0, 1};
    heddle_mesh mesh{};
    mesh.struct_size = sizeof mesh;
    mesh.vertex_count = 3;
    mesh.positions = positions.data();
    mesh.normals = normals.data();
    std::uint32_t made = 0;
    ASSERT_EQ(heddle_scene_add_mesh(scene, "triangle", &mesh, id, &made), HEDDLE_OK) << error();
    const std::array<double, 16> identity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    ASSERT_EQ(heddle_scene_add_instance(scene, "it", made, identity.data(), &id), HEDDLE_OK) << error();
  }
};

class Jobs : public heddle_test::CacheTest {
 protected:
  /// What a new process would do with a job: the origin of its first artifact.
  std::string origin(const std::string& job, const std::vector<std::string>& settings = {}, std::uint32_t flags = 0) {
    Host host(cache_, flags);
    EXPECT_EQ(host.parse(job, "job.toml", folder_, settings), HEDDLE_OK) << host.error();
    return host.run()["artifacts"][0]["origin"];
  }
  std::string error_of(const std::string& text, const std::vector<std::string>& settings = {}) {
    Host host(cache_);
    EXPECT_EQ(host.parse(text, "job.toml", folder_, settings), HEDDLE_BAD_INPUT);
    return host.error();
  }
};

TEST_F(Jobs, LeaveArtifactsAndReportsOnceAndThenTakeThemFromTheCache) {
  Host host(cache_);
  ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_), HEDDLE_OK) << host.error();
  const Json made = host.run();
  EXPECT_EQ(made["errors"], 0);
  ASSERT_EQ(made["artifacts"].size(), 1U);
  const Json artifact = made["artifacts"][0];
  EXPECT_EQ(artifact["name"], "count.table");
  EXPECT_EQ(artifact["origin"], "made");
  EXPECT_EQ(artifact["bytes"], 8 * 8);
  ASSERT_EQ(files().size(), 1U) << "one file, nothing unfinished";
  EXPECT_EQ(artifact["file"], files()[0].string());
  EXPECT_THAT(host.table(), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8));
  ASSERT_EQ(made["reports"][0]["rows"].size(), 4U);
  EXPECT_EQ(
      made["reports"][0]["rows"][2],
      parsed::json(R"({"level": "info", "message": "a slice is done", "values": {"slice": 2.0, "of": "count"}})"));
  EXPECT_EQ(host.slices(), 4);

  EXPECT_EQ(host.run()["artifacts"][0]["origin"], "made") << "what this host made is there still";
  EXPECT_EQ(host.slices(), 4);
  Host other(cache_);
  ASSERT_EQ(other.parse(kCountJob, "job.toml", folder_), HEDDLE_OK);
  const Json found = other.run();
  EXPECT_EQ(found["artifacts"][0]["origin"], "cache");
  EXPECT_EQ(found["reports"][0]["rows"], made["reports"][0]["rows"]) << "a report is kept as artifacts are";
  EXPECT_EQ(other.slices(), 0);
  EXPECT_THAT(other.table("count.table"), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8));
}

TEST_F(Jobs, CountErrorsOfReportsAlsoFromTheCache) {
  for (const char* origin : {"made", "cache"}) {
    Host host(cache_);
    ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_, {"count.params.fails=true"}), HEDDLE_OK);
    const Json result = host.run();
    EXPECT_EQ(result["errors"], 1);
    EXPECT_EQ(result["reports"][0]["origin"], origin);
    EXPECT_EQ(result["reports"][0]["rows"][4],
              parsed::json(R"({"level": "error", "message": "it was asked to fail", "values": {"limit": "nan"}})"));
  }
}

TEST_F(Jobs, AreKeptByParametersFilesAndOptions) {
  EXPECT_EQ(origin(kCountJob), "made");
  EXPECT_EQ(origin(kCountJob, {"count.params.first=2"}), "made");
  EXPECT_EQ(origin(kCountJob, {"count.params.first=2"}), "cache");
  EXPECT_EQ(origin(kCountJob), "cache");
  write("number.bin", "\1");
  const std::vector<std::string> with_file{"count.params.file=number.bin"};
  EXPECT_EQ(origin(kCountJob, with_file), "made");
  write("number.bin", "\2");
  EXPECT_EQ(origin(kCountJob, with_file), "made") << "what a file holds counts";
  write("number.bin", "\1");
  EXPECT_EQ(origin(kCountJob, with_file), "cache") << "and its time does not";
  EXPECT_EQ(origin(kCountJob, {}, HEDDLE_HOST_REMAKE), "made");
  Host host(cache_);
  ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_), HEDDLE_OK);
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.seed = 3;
  EXPECT_EQ(host.run(&options)["artifacts"][0]["origin"], "made");
}

TEST_F(Jobs, AreKeptByTheLibraryThatMakesThem) {
  // A copy of the plugin in a folder that is searched first, the second time with other bytes behind its end.
  const fs::path built = HEDDLE_BUILD_DIR "/tests/plugins/job_probe";
  const fs::path copy = folder_ / "plugins" / "job_probe";
  fs::create_directories(copy.parent_path());
  fs::copy(built, copy, fs::copy_options::recursive);
  const auto origin_there = [&] {
    const std::string plugins = (folder_ / "plugins").string();
    heddle_host_options options{};
    options.struct_size = sizeof options;
    options.plugin_path = plugins.c_str();
    options.cache_path = cache_.c_str();
    heddle_host* host = nullptr;
    EXPECT_EQ(heddle_create(&options, &host), HEDDLE_OK) << heddle_error(nullptr);
    heddle_scene* scene = nullptr;
    EXPECT_EQ(heddle_scene_create(host, &scene), HEDDLE_OK);
    heddle_graph* graph = nullptr;
    EXPECT_EQ(heddle_graph_parse(host, kCountJob, "job.toml", "", nullptr, 0, &graph), HEDDLE_OK) << heddle_error(host);
    const char* text = nullptr;
    EXPECT_EQ(heddle_job_run(graph, scene, nullptr, &text), HEDDLE_OK) << heddle_error(host);
    const std::string from = parsed::json(text)["artifacts"][0]["origin"];
    heddle_graph_destroy(graph);
    heddle_scene_destroy(scene);
    heddle_destroy(host);
    return from;
  };
  EXPECT_EQ(origin_there(), "made");
  EXPECT_EQ(origin_there(), "cache");
  std::ofstream(copy / "job_probe" / "job_probe.so", std::ios::binary | std::ios::app) << "another build";
  EXPECT_EQ(origin_there(), "made");
  std::ofstream(copy / "job_probe" / "add.comp.glsl", std::ios::app) << "// another shader\n";
  EXPECT_EQ(origin_there(), "made");
}

TEST_F(Jobs, AreKeptByTheSceneThatTheyLookAt) {
  constexpr const char* kAreas =
      "kind = \"job\"\n[[pass]]\nname = \"areas\"\nrole = \"job_probe\"\ntechnique = \"areas\"\n";
  const auto measure = [&](float width) {
    Host host(cache_);
    host.add_triangle(width);
    EXPECT_EQ(host.parse(kAreas, "job.toml", folder_), HEDDLE_OK) << host.error();
    const Json result = host.run();
    EXPECT_THAT(host.table(), ElementsAre(testing::DoubleEq(static_cast<double>(width) / 2)));
    EXPECT_EQ(result["errors"], width > 0 ? 0 : 1);
    return result["artifacts"][0]["origin"].get<std::string>();
  };
  EXPECT_EQ(measure(2), "made");
  EXPECT_EQ(measure(2), "cache");
  EXPECT_EQ(measure(std::nextafter(2.0F, 3.0F)), "made") << "one bit of one corner";
  EXPECT_EQ(measure(0), "made");
  EXPECT_EQ(measure(0), "cache") << "with its error";

  Host host(cache_);
  ASSERT_EQ(host.parse(kAreas, "job.toml", folder_), HEDDLE_OK);
  EXPECT_EQ(host.try_run(), HEDDLE_BAD_INPUT);
  EXPECT_EQ(host.error(),
            "job.toml:2:1: error: pass 'areas' has nothing to work on: the scene has no 'surfaces'\n"
            "  expected: a scene with 'surfaces'");
}

TEST_F(Jobs, AreKeptByTheTexturesOfLightsThatTheyLookAt) {
  constexpr const char* kFilm =
      "kind = \"job\"\n[[pass]]\nname = \"film\"\nrole = \"job_probe\"\ntechnique = \"film\"\n"
      "inputs.light_textures = \"scene.light_textures\"\n";
  const auto look = [&](float left, float right) {
    Host host(cache_);
    host.add_lamp(left, right);
    EXPECT_EQ(host.parse(kFilm, "film.toml", folder_), HEDDLE_OK) << host.error();
    const Json result = host.run();
    // Three channels of both texels, and of the one texel of the level below: their mean.
    EXPECT_THAT(host.table(), ElementsAre(1, 4.5 * static_cast<double>(left + right)));
    return result["artifacts"][0]["origin"].get<std::string>();
  };
  EXPECT_EQ(look(1, 3), "made");
  EXPECT_EQ(look(1, 3), "cache") << "not by what a process counts";
  EXPECT_EQ(look(1, 7), "made");
  EXPECT_EQ(look(3, 1), "made") << "the same sum of other texels";
  EXPECT_EQ(look(1, 3), "cache");

  // A frame graph that names the job runs it again.
  write("film.toml", kFilm);
  Host host(cache_);
  host.add_lamp(1, 3);
  ASSERT_EQ(host.parse("extent = [8, 8]\noutput = \"show.color\"\n[[pass]]\nname = \"show\"\nrole = \"job_probe\"\n"
                       "technique = \"show\"\ninputs.links = \"film.toml#table\"\n",
                       "frames.toml", folder_),
            HEDDLE_OK)
      << host.error();
  EXPECT_THAT(host.render(), ElementsAre(1, 2, 0, 0));
  EXPECT_EQ(host.artifacts()[0]["origin"], "cache");
  host.set_texture(1, 5);
  host.render();
  EXPECT_EQ(host.count_said("adds texels"), 1);
  EXPECT_EQ(host.artifacts()[0]["origin"], "made");
  host.render();
  EXPECT_EQ(host.count_said("adds texels"), 1) << "and not with every frame";
}

TEST_F(Jobs, StopBetweenSlicesAndGoOnInAnotherProcess) {
  std::size_t jobs_done = 0;
  for (const auto& [job, expected] :
       {std::pair(kCountJob, std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8}),
        std::pair(kGpuJob, std::vector<double>(8, 15.0)), std::pair(kPairJob, std::vector<double>(8, 15.0))}) {
    // Cancelled in each slice, by another host each time.
    const std::ptrdiff_t count = job == kCountJob ? 4 : 5;
    for (std::ptrdiff_t slice = 0; slice + 1 < count; ++slice) {
      Host host(cache_);
      ASSERT_EQ(host.parse(job, "job.toml", folder_), HEDDLE_OK);
      host.cancel_at = "slice " + std::to_string(slice);
      EXPECT_EQ(host.try_run(), HEDDLE_CANCELLED);
      EXPECT_EQ(host.error(), "error: stopped, as heddle_cancel asked for");
      EXPECT_EQ(host.slices(), 1) << "the one slice that was left to do before";
      EXPECT_EQ(host.count_said("is kept; the next run goes on there"), 1);
      EXPECT_EQ(host.count_said("goes on where an earlier run was stopped"), slice > 0 ? 1 : 0);
    }
    Host host(cache_);
    ASSERT_EQ(host.parse(job, "job.toml", folder_), HEDDLE_OK);
    const Json result = host.run();
    EXPECT_EQ(result["artifacts"][0]["origin"], "made");
    EXPECT_EQ(host.slices(), 1);
    EXPECT_EQ(host.table(), expected);
    if (job == kCountJob) {
      EXPECT_EQ(result["reports"][0]["rows"].size(), 4U) << "rows of all runs, none twice";
    }
    EXPECT_EQ(files().size(), ++jobs_done) << "what was unfinished is gone";
  }
}

TEST_F(Jobs, StopBehindASliceOfSeveralStagesAndNeverWithinIt) {
  // Asked to stop by the first stage of a slice: the slice is done whole, and kept with those before it.
  for (const int slice : {1, 3}) {
    Host host(cache_);
    ASSERT_EQ(host.parse(kPairJob, "job.toml", folder_), HEDDLE_OK);
    host.cancel_at = "adds part " + std::to_string(slice);
    EXPECT_EQ(host.try_run(), HEDDLE_CANCELLED);
    EXPECT_EQ(host.count_said("): slice " + std::to_string(slice)), 1);
    EXPECT_EQ(host.count_said("is kept; the next run goes on there"), 1);
  }
  Host host(cache_);
  ASSERT_EQ(host.parse(kPairJob, "job.toml", folder_), HEDDLE_OK);
  host.run();
  EXPECT_EQ(host.count_said("): slice "), 1) << "the last of five";
  EXPECT_EQ(host.table(), std::vector<double>(8, 15.0));
}

TEST_F(Jobs, DoSlicesOfSeveralStagesTogether) {
  Host host(cache_);
  ASSERT_EQ(host.parse(kPairJob, "job.toml", folder_), HEDDLE_OK);
  host.run();
  // Added to what was cleared in the same slice: 1 + 2 + ... + 5, and not 1 + 3 + 6 + 10 + 15.
  EXPECT_EQ(host.table(), std::vector<double>(8, 15.0));
  EXPECT_EQ(host.slices(), 5);
  ASSERT_EQ(host.parse(kPairJob, "job.toml", folder_, {"pair.params.first=add"}), HEDDLE_OK);
  host.run();
  EXPECT_EQ(host.table(), std::vector<double>(8, 35.0)) << "what is only cleared before keeps what it holds";
  for (const char* first : {"keep", "nonsense"}) {
    ASSERT_EQ(host.parse(kPairJob, "job.toml", folder_, {std::string("pair.params.first=") + first}), HEDDLE_OK);
    EXPECT_EQ(host.try_run(), HEDDLE_BUG);
    EXPECT_EQ(host.error(),
              std::string("job.toml:2:1: error: pass 'pair' (job_probe/pair): begins a slice of stage "
                          "'keep' with '") +
                  first +
                  "', which is no earlier stage of it\n  help:     this is a mistake of the technique, not "
                  "of the graph");
  }
}

TEST_F(Jobs, ThatCannotGoOnStopWhereTheyAskAndLeaveNothing) {
  constexpr const char* kPlain =
      "kind = \"job\"\n[[pass]]\nname = \"plain\"\nrole = \"job_probe\"\ntechnique = \"plain\"\n";
  Host host(cache_);
  ASSERT_EQ(host.parse(kPlain, "job.toml", folder_), HEDDLE_OK);
  host.cancel_at = "slice 1";
  EXPECT_EQ(host.try_run(), HEDDLE_CANCELLED);
  EXPECT_EQ(host.slices(), 2);
  EXPECT_TRUE(files().empty());
  host.cancel_at.clear();
  EXPECT_EQ(host.run()["artifacts"][0]["origin"], "made");
  EXPECT_EQ(host.slices(), 2 + 4);
  EXPECT_THAT(host.table(), ElementsAre(1, 2, 3, 4));
}

TEST_F(Jobs, ThatAreKilledLeaveNothingHalfAndGoOn) {
  for (const auto& [job, expected] :
       {std::pair(kCountJob, std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8}),
        std::pair(kGpuJob, std::vector<double>(8, 15.0)), std::pair(kPairJob, std::vector<double>(8, 15.0))}) {
    const pid_t child = fork();
    if (child == 0) {
      setenv("HEDDLE_PROBE_KILL_AT", "2", 1);
      Host host(cache_);
      if (host.parse(job, "job.toml", folder_) == HEDDLE_OK) (void)host.try_run();
      _exit(1);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << status;
    Host host(cache_);
    ASSERT_EQ(host.parse(job, "job.toml", folder_), HEDDLE_OK);
    EXPECT_EQ(host.run()["artifacts"][0]["origin"], "made");
    EXPECT_EQ(host.table(), expected);
    // What the first slice made was kept for certain; the second's if that was quick.
    EXPECT_LT(host.slices(), job == kCountJob ? 4 : 5);
    for (const fs::path& file : files()) EXPECT_EQ(file.extension(), ".artifact") << file;
  }
}

TEST_F(Jobs, BeginAnewWhereWhatWasKeptIsOfNoUse) {
  const std::vector<std::string> forgets{"count.params.forgets=true"};
  const auto stop = [&](const std::vector<std::string>& settings) {
    Host host(cache_);
    ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_, settings), HEDDLE_OK);
    host.cancel_at = "slice 1";
    EXPECT_EQ(host.try_run(), HEDDLE_CANCELLED);
    ASSERT_EQ(files().size(), 1U);
  };
  const auto finish = [&](const std::vector<std::string>& settings, const std::string& said) {
    Host host(cache_);
    ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_, settings), HEDDLE_OK);
    EXPECT_EQ(host.run()["reports"][0]["rows"].size(), 4U);
    EXPECT_THAT(host.table(), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8));
    EXPECT_EQ(host.slices(), 4);
    EXPECT_EQ(host.count_said(said), 1) << said;
  };
  stop(forgets);
  finish(forgets,
         "1: job.toml:2:1: warning: pass 'count' (job_probe/count): stage 'count' has no use for what an earlier run "
         "had done, and begins anew");
  fs::remove_all(cache_);
  stop({});
  const fs::path file = files().at(0);
  fs::resize_file(file, fs::file_size(file) / 2);
  finish({}, file.string() + ", is damaged: its bytes are not those that were written; the stage begins anew");
}

TEST_F(Jobs, OfTwoProcessesAtOnceMakeOneWholeFile) {
  std::array<pid_t, 2> children{};
  for (pid_t& child : children) {
    child = fork();
    if (child != 0) continue;
    Host host(cache_);
    const bool is_good = host.parse(kCountJob, "job.toml", folder_) == HEDDLE_OK && host.try_run() == HEDDLE_OK &&
                         host.table() == std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8};
    _exit(is_good ? 0 : 1);
  }
  for (const pid_t child : children) {
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  }
  EXPECT_EQ(files().size(), 1U);
  EXPECT_EQ(origin(kCountJob), "cache");
}

TEST_F(Jobs, GoOnWithoutACacheThatCannotBeWritten) {
  fs::create_directories(cache_);
  std::ofstream(cache_ / "artifacts") << "a file where the folder should be";
  Host host(cache_);
  ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_), HEDDLE_OK);
  const Json result = host.run();
  EXPECT_EQ(result["artifacts"][0]["file"], "");
  EXPECT_THAT(host.table(), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8));
  EXPECT_EQ(host.count_said("1: job.toml:2:1: warning: pass 'count' (job_probe/count): the artifact cache " +
                            (cache_ / "artifacts").string() +
                            " cannot be made: Not a directory; it will be made again next time"),
            1);
  EXPECT_EQ(host.run()["artifacts"][0]["origin"], "made");
  EXPECT_EQ(host.slices(), 4) << "this host has it, at least";
}

TEST_F(Jobs, ThatAreDamagedAreToldAndMadeAgain) {
  EXPECT_EQ(origin(kCountJob), "made");
  const fs::path file = files().at(0);
  std::fstream(file, std::ios::binary | std::ios::in | std::ios::out).seekp(-3, std::ios::end).put('x');
  Host host(cache_);
  ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_), HEDDLE_OK);
  EXPECT_EQ(host.run()["artifacts"][0]["origin"], "made");
  EXPECT_EQ(host.count_said("1: job.toml:2:1: warning: pass 'count' (job_probe/count): the artifact " + file.string() +
                            " is damaged: its bytes are not those that were written; it is made again"),
            1);
  EXPECT_EQ(origin(kCountJob), "cache");
}

TEST_F(Jobs, MakeArtifactsOfArtifactsInOneFileAndAcrossFiles) {
  write("first.toml", kCountJob);
  const std::string chain =
      std::string(kCountJob) +
      "[[pass]]\nname = \"more\"\nrole = \"job_probe\"\ntechnique = \"count\"\ninputs.base = \"count.table\"\n"
      "[[pass]]\nname = \"most\"\nrole = \"job_probe\"\ntechnique = \"count\"\n"
      "inputs.base = \"first.toml#count.table\"\nparams.first = 10\n";
  Host host(cache_);
  ASSERT_EQ(host.parse(chain, "job.toml", folder_), HEDDLE_OK) << host.error();
  const Json result = host.run();
  EXPECT_THAT(host.table("more.table"), ElementsAre(2, 4, 6, 8, 10, 12, 14, 16));
  EXPECT_THAT(host.table("most.table"), ElementsAre(11, 13, 15, 17, 19, 21, 23, 25));
  EXPECT_EQ(host.slices(), 3 * 4) << "the same work in both files is done once";
  EXPECT_EQ(files().size(), 3U);
  for (const Json& artifact : result["artifacts"])
    EXPECT_EQ(artifact["origin"], artifact["name"] == "count.table" ? "cache" : "made") << artifact;

  // What changes in the first changes what is made of it, and nothing else.
  Host other(cache_);
  ASSERT_EQ(other.parse(chain, "job.toml", folder_, {"count.params.first=3"}), HEDDLE_OK);
  other.run();
  EXPECT_THAT(other.table("more.table"), ElementsAre(4, 6, 8, 10, 12, 14, 16, 18));
  EXPECT_EQ(other.slices(), 2 * 4);
  const void* data = nullptr;
  std::uint64_t bytes = 0;
  EXPECT_EQ(heddle_job_artifact(other.graph, "more.tabel", &data, &bytes), HEDDLE_BAD_INPUT);
  EXPECT_EQ(other.error(),
            "job.toml: error: the job left no artifact 'more.tabel'\n"
            "  expected: one of count.table, more.table, most.table\n"
            "  help:     did you mean 'more.table'?");
}

TEST_F(Jobs, AreRunByFrameGraphsThatNameThem) {
  write("links.toml", kCountJob);
  constexpr const char* kFrames =
      "extent = [8, 8]\noutput = \"show.color\"\n"
      "[[pass]]\nname = \"show\"\nrole = \"job_probe\"\ntechnique = \"show\"\ninputs.links = \"links.toml#table\"\n";
  for (const std::string origin : {"made", "cache"}) {
    Host host(cache_);
    ASSERT_EQ(host.parse(kFrames, "frames.toml", folder_), HEDDLE_OK) << host.error();
    EXPECT_THAT(host.render(), ElementsAre(1, 8, 0, 0));
    const Json artifact = host.artifacts()[0];
    EXPECT_EQ(artifact["job"], "links.toml");
    EXPECT_EQ(artifact["port"], "table");
    EXPECT_EQ(artifact["origin"], origin);
    host.render();
    EXPECT_EQ(host.slices(), origin == "made" ? 4 : 0) << "once for all frames";
  }
  // Another artifact is another table: the pass is created anew, with another extent.
  Host host(cache_);
  ASSERT_EQ(host.parse(kFrames, "frames.toml", folder_), HEDDLE_OK);
  host.render();
  write("links.toml", std::string(kCountJob) + "params.size = 3\nparams.first = 5\n");
  ASSERT_EQ(heddle_graph_reload(host.graph), HEDDLE_OK) << host.error();
  EXPECT_THAT(host.render(), ElementsAre(5, 3, 0, 0));
  write("others.toml", std::string(kCountJob) + "params.first = 7\n");
  ASSERT_EQ(heddle_graph_set(host.graph, "show.inputs.links=\"others.toml#count.table\""), HEDDLE_OK) << host.error();
  EXPECT_THAT(host.render(), ElementsAre(7, 8, 0, 0));
  EXPECT_EQ(heddle_graph_set(host.graph, "show.inputs.links=\"missing.toml#table\""), HEDDLE_BAD_INPUT);
  EXPECT_THAT(host.error(), HasSubstr("--set:1:19: error: there is neither a file nor a shipped graph 'missing.toml'"));
  EXPECT_THAT(host.render(), ElementsAre(7, 8, 0, 0)) << "on an error the graph is as it was";

  // It is one of the files to watch, and so is what it reads.
  const char* text = nullptr;
  ASSERT_EQ(heddle_graph_files(host.graph, &text), HEDDLE_OK);
  EXPECT_THAT(text, HasSubstr((folder_ / "others.toml").string()));
}

TEST_F(Jobs, TakeSettingsThroughTheGraphThatNamesThem) {
  write("first.toml", kCountJob);
  write("links.toml", std::string(kCountJob) + "inputs.base = \"first.toml#count.table\"\nparams.first = 10\n");
  write("frames.toml",
        "extent = [8, 8]\noutput = \"show.color\"\n"
        "[[pass]]\nname = \"show\"\nrole = \"job_probe\"\ntechnique = \"show\"\ninputs.links = "
        "\"links.toml#table\"\n");
  const auto shown = [&](const std::vector<const char*>& settings) {
    Host host(cache_);
    EXPECT_EQ(heddle_graph_load(host.handle, (folder_ / "frames.toml").c_str(), settings.data(),
                                static_cast<std::uint32_t>(settings.size()), &host.graph),
              HEDDLE_OK)
        << host.error();
    return host.render();
  };
  const auto plain = shown({});
  const auto larger = shown({"links.toml#count.params.first=20"});
  EXPECT_EQ(larger[0], plain[0] + 10);
  EXPECT_EQ(shown({"links.toml#count.params.first=15", "links.toml#count.params.first=20"})[0], larger[0])
      << "the last word counts";
  // A job that the job names, by the name that it is called there.
  EXPECT_EQ(shown({"links.toml#first.toml#count.params.first=3"})[0], plain[0] + 2) << "in place of 1";

  // In a graph that is there, and back.
  Host host(cache_);
  ASSERT_EQ(heddle_graph_load(host.handle, (folder_ / "frames.toml").c_str(), nullptr, 0, &host.graph), HEDDLE_OK);
  EXPECT_EQ(host.render(), plain);
  ASSERT_EQ(heddle_graph_set(host.graph, "links.toml#count.params.first=20"), HEDDLE_OK) << host.error();
  EXPECT_EQ(host.render(), larger);
  ASSERT_EQ(heddle_graph_reload(host.graph), HEDDLE_OK) << host.error();
  EXPECT_EQ(host.render(), larger) << "settings outlast a reload";
  ASSERT_EQ(heddle_graph_set(host.graph, "links.toml#count.params.first=10"), HEDDLE_OK) << host.error();
  EXPECT_EQ(host.render(), plain);

  EXPECT_EQ(heddle_graph_set(host.graph, "link.toml#count.params.first=1"), HEDDLE_BAD_INPUT);
  EXPECT_EQ(host.error(),
            "--set:1:1: error: no input of the graph names the job 'link.toml'\n"
            "  found:    link.toml#count.params.first=1\n"
            "  expected: one of links.toml\n"
            "  help:     did you mean 'links.toml'?");
  EXPECT_EQ(heddle_graph_set(host.graph, "links.toml#cuont.params.first=1"), HEDDLE_BAD_INPUT);
  EXPECT_EQ(host.error(),
            "--set:1:12: error: the graph has no pass 'cuont'\n"
            "  found:    links.toml#cuont.params.first=1\n"
            "  expected: one of count, extent, output, params, joins\n"
            "  help:     did you mean 'count'?");
  EXPECT_EQ(heddle_graph_set(host.graph, "links.toml#count.params.frist=1"), HEDDLE_BAD_INPUT);
  EXPECT_THAT(host.error(), HasSubstr("--set:1:25: error: pass 'count': technique 'job_probe/count' has no parameter "
                                      "'frist'"));
  EXPECT_EQ(heddle_graph_set(host.graph, "count.params.first=1"), HEDDLE_BAD_INPUT);
  EXPECT_THAT(host.error(), HasSubstr("has no pass 'count'\n  found:    count.params.first=1\n  expected: one of show, "
                                      "extent, output, params, joins\n  help:     a job that the graph names has it: "
                                      "links.toml#count.params.first=1"));
  EXPECT_EQ(host.render(), plain) << "on an error the graph is as it was";
  Host other(cache_);  // at its first reading jobs are not read yet
  const char* setting = "count.params.first=1";
  EXPECT_EQ(heddle_graph_load(other.handle, (folder_ / "frames.toml").c_str(), &setting, 1, &other.graph),
            HEDDLE_BAD_INPUT);
  EXPECT_THAT(other.error(), HasSubstr("help:     a job that the graph names has it: links.toml#count.params.first=1"));
}

TEST_F(Jobs, StayWithTheirInputsWhenAReloadFails) {
  write("low.toml", std::string(kCountJob) + "params.first = 30\n");
  write("high.toml", std::string(kCountJob) + "params.first = 60\n");
  const auto show = [](const std::string& name, const std::string& job) {
    return "[[pass]]\nname = \"" + name + "\"\nrole = \"job_probe\"\ntechnique = \"show\"\ninputs.links = \"" + job +
           ".toml#table\"\n";
  };
  const std::string good = "extent = [8, 8]\noutput = \"a.color\"\n" + show("a", "low") + show("b", "high");
  write("base.toml", good);
  Host host(cache_);
  ASSERT_EQ(host.parse("extends = \"base.toml\"\n", "frames.toml", folder_), HEDDLE_OK) << host.error();
  ASSERT_EQ(heddle_graph_keep(host.graph, "b.color"), HEDDLE_OK) << host.error();
  host.render();
  EXPECT_EQ(host.first_of("a.color"), 30);
  EXPECT_EQ(host.first_of("b.color"), 60);

  // One job less, so that the other takes its place; and a pass that cannot be planned.
  write("base.toml", "extent = [8, 8]\noutput = \"c.color\"\n" + show("a", "high") + show("b", "high") +
                         show("c", "high") + "params.fails = true\n");
  EXPECT_EQ(heddle_graph_reload(host.graph), HEDDLE_UNSUPPORTED);
  EXPECT_THAT(host.error(), HasSubstr("it was asked to fail"));
  for (const float width : {2.0F, 3.0F}) {
    host.render();
    EXPECT_EQ(host.first_of("a.color"), 30);
    EXPECT_EQ(host.first_of("b.color"), 60);
    host.add_triangle(width);  // the jobs are due again
  }
  EXPECT_EQ(host.slices(), 8) << "what both made is there still";

  write("base.toml", "extent = [8, 8]\noutput = \"a.color\"\n" + show("a", "high") + show("b", "low"));
  ASSERT_EQ(heddle_graph_reload(host.graph), HEDDLE_OK) << host.error();
  host.render();
  EXPECT_EQ(host.first_of("a.color"), 60);
  EXPECT_EQ(host.first_of("b.color"), 30);
}

TEST_F(Jobs, OfFrameGraphsRunAgainWhenTheSceneChangesAndNotWhenItMoves) {
  write("areas.toml", "kind = \"job\"\n[[pass]]\nname = \"areas\"\nrole = \"job_probe\"\ntechnique = \"areas\"\n");
  Host host(cache_);
  host.add_triangle(2);
  ASSERT_EQ(host.parse("extent = [8, 8]\noutput = \"show.color\"\n[[pass]]\nname = \"show\"\nrole = \"job_probe\"\n"
                       "technique = \"show\"\ninputs.links = \"areas.toml#table\"\n",
                       "frames.toml", folder_),
            HEDDLE_OK);
  EXPECT_THAT(host.render(), ElementsAre(1, 1, 0, 0));
  const std::array<double, 16> twice{2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1};
  ASSERT_EQ(heddle_scene_set_instance(host.scene, 0, twice.data()), HEDDLE_OK) << host.error();
  EXPECT_THAT(host.render(), ElementsAre(1, 1, 0, 0)) << "as it was posed in the first frame";
  EXPECT_EQ(host.count_said("measures"), 1);
  host.add_triangle(6);
  EXPECT_THAT(host.render(), ElementsAre(4, 2, 0, 0)) << "two triangles, the first twice as large";
  EXPECT_EQ(host.count_said("measures"), 2);
}

TEST_F(Jobs, ThatNoWantedPassNeedsAreNotRun) {
  write("links.toml", kCountJob);
  const std::string frames =
      "extent = [8, 8]\noutput = \"paint.color\"\n[[pass]]\nname = \"paint\"\nrole = \"job_probe\"\ntechnique = "
      "\"picture\"\n"
      "[[pass]]\nname = \"show\"\nrole = \"job_probe\"\ntechnique = \"show\"\ninputs.links = \"links.toml#table\"\n";
  Host host(cache_);
  ASSERT_EQ(host.parse(frames, "frames.toml", folder_), HEDDLE_OK) << host.error();
  EXPECT_THAT(host.render(), ElementsAre(0.25, 0.25, 0.25, 0.25));
  EXPECT_TRUE(host.artifacts().empty());
  EXPECT_TRUE(files().empty());
  // Asked for between frames: then it is run, with the next one.
  ASSERT_EQ(heddle_graph_keep(host.graph, "show.color"), HEDDLE_OK) << host.error();
  host.render();
  EXPECT_EQ(host.slices(), 4);
  heddle_image image{};
  image.struct_size = sizeof image;
  ASSERT_EQ(heddle_read(host.graph, "show.color", 0, 0, &image), HEDDLE_OK) << host.error();
  EXPECT_EQ(image.width, 8U);
  EXPECT_EQ(image.pixels[4 * 7], 8.0F);
}

TEST_F(Jobs, OfAFrameGraphThatIsProvenComeFromTheCache) {
  write("links.toml", kCountJob);
  EXPECT_EQ(origin(kCountJob), "made");
  Host host(cache_, HEDDLE_HOST_CHECK);
  ASSERT_EQ(host.parse("extent = [8, 8]\noutput = \"show.color\"\n[[pass]]\nname = \"show\"\nrole = \"job_probe\"\n"
                       "technique = \"show\"\ninputs.links = \"links.toml#table\"\n",
                       "frames.toml", folder_),
            HEDDLE_OK);
  const char* text = nullptr;
  ASSERT_EQ(heddle_graph_check(host.graph, host.scene, nullptr, 3, &text), HEDDLE_OK) << host.error();
  EXPECT_EQ(host.slices(), 0);
}

TEST_F(Jobs, StopWithTheFrameThatNeedsThem) {
  write("links.toml", kCountJob);
  Host host(cache_);
  ASSERT_EQ(host.parse("extent = [8, 8]\noutput = \"show.color\"\n[[pass]]\nname = \"show\"\nrole = \"job_probe\"\n"
                       "technique = \"show\"\ninputs.links = \"links.toml#table\"\n",
                       "frames.toml", folder_),
            HEDDLE_OK);
  host.cancel_at = "slice 1";
  EXPECT_EQ(heddle_render(host.graph, host.scene, nullptr), HEDDLE_CANCELLED);
  host.cancel_at.clear();
  EXPECT_THAT(host.render(), ElementsAre(1, 8, 0, 0));
  EXPECT_EQ(host.slices(), 4) << "two, and the two that were left";
}

TEST_F(Jobs, WriteImagesOfTheExtentThatTheySay) {
  constexpr const char* kPicture =
      "kind = \"job\"\noutput = \"paint.color\"\n[[pass]]\nname = \"paint\"\nrole = \"job_probe\"\ntechnique = "
      "\"picture\"\n";
  Host host(cache_);
  ASSERT_EQ(host.parse(kPicture, "job.toml", folder_), HEDDLE_OK) << host.error();
  EXPECT_EQ(host.try_run(), HEDDLE_BAD_INPUT);
  EXPECT_EQ(host.error(),
            "job.toml:3:1: error: 'paint.color' is as large as the frame, and this job says no extent\n"
            "  expected: extent = [width, height], in pixels, above the first [[pass]]");
  ASSERT_EQ(host.parse(kPicture, "job.toml", folder_, {"extent=[5,3]"}), HEDDLE_OK) << host.error();
  host.run();
  heddle_image image{};
  image.struct_size = sizeof image;
  ASSERT_EQ(heddle_read(host.graph, nullptr, 0, 0, &image), HEDDLE_OK) << host.error();
  EXPECT_EQ(image.width, 5U);
  EXPECT_EQ(image.height, 3U);
  EXPECT_EQ(image.pixels[14], 0.25F);
}

TEST_F(Jobs, AreProvenInCheckModeWithoutTheCache) {
  EXPECT_EQ(origin(kGpuJob), "made");
  Host host(cache_, HEDDLE_HOST_CHECK);
  ASSERT_EQ(host.parse(kGpuJob, "job.toml", folder_), HEDDLE_OK);
  EXPECT_EQ(host.run()["artifacts"][0]["origin"], "made");
  EXPECT_EQ(host.slices(), 5);
  const char* text = nullptr;
  ASSERT_EQ(heddle_graph_check(host.graph, host.scene, nullptr, 3, &text), HEDDLE_OK) << host.error();
  const Json report = parsed::json(text);
  EXPECT_EQ(report["compared"], Json({"sums.table"}));
  EXPECT_EQ(report["frames"], 1);
  EXPECT_GE(report["runs"], 2);
  EXPECT_EQ(host.slices(), 5 + 5 * report["runs"].get<int>());
  EXPECT_EQ(files().size(), 1U) << "nothing of it is kept";
}

TEST_F(Jobs, AreProvenInAllTheirWaves) {
  const std::string chain = std::string(kCountJob) +
                            "[[pass]]\nname = \"more\"\nrole = \"job_probe\"\ntechnique = \"count\"\n"
                            "inputs.base = \"count.table\"\n" +
                            "[[pass]]\nname = \"sums\"\nrole = \"job_probe\"\ntechnique = \"gpu\"\n";
  Host host(cache_, HEDDLE_HOST_CHECK);
  ASSERT_EQ(host.parse(chain, "job.toml", folder_), HEDDLE_OK) << host.error();
  const char* text = nullptr;
  ASSERT_EQ(heddle_graph_check(host.graph, host.scene, nullptr, 1, &text), HEDDLE_OK) << host.error();
  const Json report = parsed::json(text);
  EXPECT_EQ(report["compared"], Json({"count.table", "count.report", "more.table", "more.report", "sums.table"}));
  EXPECT_GT(report["orders"], 1) << "'count' and 'sums' wait for nothing of each other";
  EXPECT_EQ(report["unordered_pairs"], report["seen_both_ways"]);
  EXPECT_EQ(host.slices(), (4 + 4 + 5) * report["runs"].get<int>());
  EXPECT_TRUE(files().empty());
}

TEST_F(Jobs, AreExplainedAndDescribed) {
  write("links.toml", kCountJob);
  Host host(cache_);
  ASSERT_EQ(host.parse(kGpuJob, "job.toml", folder_), HEDDLE_OK);
  const char* text = nullptr;
  ASSERT_EQ(heddle_graph_explain(host.graph, "text", &text), HEDDLE_OK) << host.error();
  EXPECT_THAT(text, testing::StartsWith("job.toml: a job; keeps 'sums.table'\n"));
  EXPECT_THAT(text, HasSubstr("makes 'sums.table', which is asked for"));
  ASSERT_EQ(heddle_graph_describe(host.graph, &text), HEDDLE_OK);
  EXPECT_EQ(parsed::json(text)["kind"], "job");
  EXPECT_TRUE(parsed::json(text)["output"].is_null());
  ASSERT_EQ(heddle_graph_get(host.graph, "kind", &text), HEDDLE_OK) << host.error();
  EXPECT_STREQ(text, "\"job\"");
  ASSERT_EQ(host.parse("extent = [8, 8]\noutput = \"show.color\"\n[[pass]]\nname = \"show\"\nrole = \"job_probe\"\n"
                       "technique = \"show\"\ninputs.links = \"links.toml#table\"\n",
                       "frames.toml", folder_),
            HEDDLE_OK);
  ASSERT_EQ(heddle_graph_explain(host.graph, "text", &text), HEDDLE_OK) << host.error();
  EXPECT_THAT(text, HasSubstr("\nartifacts\n  links.toml#count.table  made by 'count.table' of the job " +
                              (folder_ / "links.toml").string() + ", unless the cache holds it\n"));
  ASSERT_EQ(heddle_graph_explain(host.graph, "dot", &text), HEDDLE_OK) << host.error();
  EXPECT_THAT(text, HasSubstr("\"links.toml\" -> \"show\""));
}

TEST_F(Jobs, RefuseWhatTheyCannotHave) {
  const std::string job = "kind = \"job\"\n";
  EXPECT_EQ(error_of(job + "[[pass]]\nrole = \"job_probe\"\ntechnique = \"look\"\n"),
            "job.toml:2:1: error: pass 'job_probe': 'job_probe/look' needs the frame's camera, and a job has none\n"
            "  expected: a technique that needs no camera, or inputs.camera = \"pass.camera\"\n"
            "  help:     a job bakes, encodes or inspects; what renders from a camera belongs into a graph of frames");
  EXPECT_EQ(error_of(job + "[[pass]]\nrole = \"job_probe\"\ntechnique = \"look\"\ninputs.camera = \"scene.camera\"\n"),
            "job.toml:5:17: error: pass 'job_probe': inputs.camera: a job has no camera\n"
            "  found:    \"scene.camera\"\n"
            "  expected: one of environment, light_textures, lights, surfaces");
  EXPECT_EQ(
      error_of("output = \"job_probe.table\"\n[[pass]]\nrole = \"job_probe\"\ntechnique = \"count\"\n").substr(0, 160),
      std::string(
          "job.toml:1:10: error: the graph's output 'job_probe.table' is an artifact\n"
          "  found:    output = \"job_probe.table\"\n"
          "  expected: an image\n"
          "job.toml:2:1: error: pass 'job_probe': what 'job_probe/count' makes is made once, in a job, and this graph "
          "is one of frames\n")
          .substr(0, 160));
  EXPECT_EQ(error_of(job + "[[pass]]\nrole = \"job_probe\"\ntechnique = \"picture\"\n"),
            "job.toml: error: the job leaves nothing\n"
            "  expected: a pass that makes an artifact or a report\n"
            "  help:     or output = \"pass.port\", an image");
  EXPECT_EQ(error_of("kind = \"bake\"\n"),
            "job.toml:1:8: error: 'kind' is a string\n"
            "  found:    kind = \"bake\"\n"
            "  expected: \"frame\" or \"job\"");
  Host host(cache_);
  ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_), HEDDLE_OK);
  EXPECT_EQ(heddle_render(host.graph, host.scene, nullptr), HEDDLE_BAD_INPUT);
  EXPECT_EQ(host.error(),
            "job.toml: error: this graph is a job, and renders no frames\n"
            "  help:     heddle_job_run, Job.run and heddle run run it");
  ASSERT_EQ(host.parse(kCountJob, "job.toml", folder_, {"count.params.other_file=secret"}), HEDDLE_OK);
  EXPECT_EQ(host.try_run(), HEDDLE_BUG);
  EXPECT_EQ(host.error(),
            "job.toml:2:1: error: pass 'count' (job_probe/count): asks for the file './secret', which no parameter "
            "names: what a job reads is part of its key\n"
            "  help:     this is a mistake of the technique, not of the graph");
}

TEST_F(Jobs, RefuseCirclesAndWhatIsNoJob) {
  const auto names = [](const std::string& other) {
    return std::string(kCountJob) + "inputs.base = \"" + other + "#table\"\n";
  };
  write("a.toml", names("b.toml"));
  write("b.toml", names("a.toml"));
  const std::string a = (folder_ / "a.toml").string(), b = (folder_ / "b.toml").string();
  EXPECT_EQ(error_of(names("a.toml")), b + ":6:15: error: jobs need each other's artifacts in a circle\n  found:    " +
                                           a + ":6 names 'b.toml', " + b +
                                           ":6 names 'a.toml'\n"
                                           "  expected: a job at the end that needs no other");
  Host host(cache_);
  ASSERT_EQ(host.parse(std::string(kCountJob) +
                           "inputs.base = \"more.table\"\n[[pass]]\nname = \"more\"\nrole = \"job_probe\"\n"
                           "technique = \"count\"\ninputs.base = \"count.table\"\n",
                       "job.toml", folder_),
            HEDDLE_OK);
  EXPECT_EQ(host.try_run(), HEDDLE_BAD_INPUT);
  EXPECT_THAT(host.error(), HasSubstr("job.toml:2:1: error: "));
  EXPECT_THAT(host.error(),
              testing::AllOf(HasSubstr("'count' reads 'more.table'"), HasSubstr("'more' reads 'count.table'")));
  write("frames.toml",
        "output = \"paint.color\"\n[[pass]]\nname = \"paint\"\nrole = \"job_probe\"\ntechnique = \"picture\"\n");
  EXPECT_EQ(error_of(names("frames.toml")), "job.toml:6:15: error: '" + (folder_ / "frames.toml").string() +
                                                "' is no job, so it makes no artifact\n"
                                                "  found:    a graph without 'kind'\n"
                                                "  expected: kind = \"job\" in that file");
  write("good.toml", kCountJob);
  EXPECT_EQ(error_of(std::string(kCountJob) + "inputs.base = \"good.toml#tabel\"\n"),
            "job.toml:6:15: error: pass 'count': inputs.base: the job '" + (folder_ / "good.toml").string() +
                "' makes no artifact 'tabel'\n"
                "  found:    \"good.toml#tabel\"\n"
                "  expected: one of count.table");
  write("broken.toml", std::string(kCountJob) + "params.firts = 1\n");
  EXPECT_THAT(error_of(names("broken.toml")),
              HasSubstr("broken.toml:6:8: error: pass 'count': technique 'job_probe/count' has no "
                        "parameter 'firts'"));
}

}  // namespace
