// SPDX-License-Identifier: Apache-2.0
// Lists that shaders append to, against the same choice made here: counts, overflow, growth, order, and contents that
// outgrow their memory.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <gmock/gmock.h>

#include <heddle/plugin.h>

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <numeric>
#include <set>

namespace {

using namespace rendering;
using testing::HasSubstr;

constexpr std::uint32_t kWidth = 96, kHeight = 40;

// As in lists/choose.glsl.
std::uint32_t hash(std::uint32_t x, std::uint32_t y, std::uint32_t salt) {
  const std::uint32_t state = (x + 4096U * y + 77U * salt) * 747796405U + 2891336453U;
  const std::uint32_t word = ((state >> ((state >> 28U) + 4U)) ^ state) * 277803737U;
  return (word >> 22U) ^ word;
}
/// What is drawn at a pixel; 0: it is not chosen.
std::uint32_t drawn(std::uint32_t x, std::uint32_t y, std::uint32_t share = 250, std::uint32_t salt = 1) {
  const std::uint32_t value = hash(x, y, salt);
  return value % 1000U < share ? value % 256U + 1U : 0U;
}
std::uint32_t count_drawn(std::uint32_t share = 250, std::uint32_t salt = 1) {
  std::uint32_t count = 0;
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x) count += drawn(x, y, share, salt) != 0 ? 1 : 0;
  return count;
}

std::string pass(const std::string& name, const std::string& technique, const std::string& more = {}) {
  return "[[pass]]\nname = \"" + name + "\"\nrole = \"lists\"\ntechnique = \"" + technique + "\"\n" + more;
}
std::string graph_of(const std::string& output, const std::string& passes) {
  return "extent = [96, 40]\noutput = \"" + output + ".color\"\n" + passes;
}
std::string shaded(const std::string& parameters) {
  return graph_of("shade",
                  pass("find", "find", parameters) + pass("shade", "shade", "inputs.pixels = \"find.pixels\"\n"));
}

Image frame(Graph& graph, Scene& scene, bool is_cut = false) {
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.cut = is_cut ? 1 : 0;
  check(heddle_render(graph.handle, scene.handle, &options));
  return graph.read();
}
nlohmann::json stats(Graph& graph) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text);
}
nlohmann::json list_of(const std::string& name, std::uint32_t capacity, std::uint32_t count, std::uint32_t overflow) {
  return {{"name", name}, {"capacity", capacity}, {"count", count}, {"overflow", overflow}};
}
std::uint32_t shown(const Image& image) {
  std::uint32_t count = 0;
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x) count += image.at(x, y) != 0.0F ? 1 : 0;
  return count;
}
void expect_whole(const Image& image) {
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x)
      ASSERT_EQ(image.at(x, y), static_cast<float>(drawn(x, y))) << x << ", " << y;
}

TEST(List, HoldsWhatWasAppendedAndIsShadedWithoutReadingBack) {
  Scene scene;
  Graph graph(shaded("params.room = 3840\n"));
  for (int k = 0; k < 3; ++k) {
    expect_whole(frame(graph, scene));
    const nlohmann::json now = stats(graph);
    EXPECT_EQ(now["lists"], nlohmann::json::array({list_of("find.pixels", 3840, count_drawn(), 0)}));
    EXPECT_EQ(now["stalls"], 0);
    if (k > 0) {
      EXPECT_EQ(now["counters"]["submits"], 1);
    }
    // find, clear, the number of work groups, shade.
    EXPECT_EQ(now["counters"]["dispatches"], 4);
    EXPECT_EQ(now["counters"]["read_back_bytes"], 16);
  }
}

TEST(List, CountsExactlyWhatHasNoRoom) {
  Scene scene;
  const std::uint32_t all = count_drawn();
  for (const std::uint32_t room : {0U, 1U, 2U, 100U, all - 1, all, all + 1}) {
    Graph graph(shaded("params.grows = false\nparams.room = " + std::to_string(room) + "\n"));
    for (int k = 0; k < 2; ++k) {
      const Image image = frame(graph, scene);
      const std::uint32_t held = std::min(room, all);
      EXPECT_EQ(stats(graph)["lists"], nlohmann::json::array({list_of("find.pixels", room, held, all - held)}));
      EXPECT_EQ(stats(graph)["stalls"], 0);
      EXPECT_EQ(shown(image), held);
      for (std::uint32_t y = 0; y < kHeight; ++y)
        for (std::uint32_t x = 0; x < kWidth; ++x)
          ASSERT_TRUE(image.at(x, y) == 0.0F || image.at(x, y) == static_cast<float>(drawn(x, y))) << x << ", " << y;
    }
  }
}

TEST(List, SaysOnceThatThereIsNoRoom) {
  Scene scene;
  Graph graph(shaded("params.grows = false\nparams.room = 100\n"));
  Host::get().log.clear();
  for (int k = 0; k < 3; ++k) frame(graph, scene);
  EXPECT_THAT(Host::get().log,
              testing::ElementsAre("test.toml:3:1: warning: frame 0, pass 'find' (lists/find): the list 'find.pixels' "
                                   "has room for 100 elements, and " +
                                   std::to_string(count_drawn() - 100) +
                                   " more were left out\n  help:     its technique keeps it as it is"));
}

TEST(List, GrowsUntilThePictureIsWhole) {
  Scene scene;
  const std::uint32_t all = count_drawn();
  Graph graph(graph_of("shade", pass("find", "find", "params.room = 64\n") +
                                    pass("other", "find", "params.salt = 2\nparams.room = 3840\n") +
                                    pass("shade", "shade", "inputs.pixels = \"find.pixels\"\n")));
  graph.keep("other.color");
  Host::get().log.clear();
  EXPECT_EQ(shown(frame(graph, scene)), 64U);
  EXPECT_EQ(stats(graph)["lists"][0], list_of("find.pixels", 64, 64, all - 64));
  EXPECT_THAT(Host::get().log,
              testing::ElementsAre(HasSubstr("help:     it is made larger for the next frame: render more than one")));
  for (int k = 1; k < 4; ++k) {
    expect_whole(frame(graph, scene));
    const nlohmann::json now = stats(graph);
    EXPECT_EQ(now["lists"][0], list_of("find.pixels", all, all, 0));
    EXPECT_EQ(now["stalls"], 0);
    // Who makes the list and who reads it are declared again; nothing is made or compiled anew.
    EXPECT_EQ(now["plan"]["passes_made"], 0);
    EXPECT_EQ(now["plan"]["passes_kept"], 3);
    EXPECT_EQ(now["plan"]["passes_redeclared"], 2);
    EXPECT_EQ(now["plan"]["pipelines_made"], 0);
  }
  const char* text = nullptr;
  check(heddle_graph_explain(graph.handle, "text", &text));
  EXPECT_THAT(text, HasSubstr("list of at most " + std::to_string(all) + " elements of 8 bytes"));
}

TEST(List, OfTwoProducersHoldsTheSecondsElementsBehindTheFirsts) {
  Scene scene;
  Graph graph(graph_of(
      "order", pass("find", "find", "params.share = 100\nparams.room = 3840\n") +
                   pass("more", "more", "inputs.pixels = \"find.pixels\"\nparams.share = 300\nparams.salt = 9\n") +
                   pass("order", "order", "inputs.pixels = \"more.pixels\"\n")));
  const std::uint32_t first = count_drawn(100, 1);
  const std::uint32_t second = count_drawn(300, 9);
  for (int k = 0; k < 2; ++k) {
    const Image image = frame(graph, scene);
    EXPECT_EQ(stats(graph)["lists"], nlohmann::json::array({list_of("find.pixels", 3840, first + second, 0)}));
    std::set<std::pair<std::uint32_t, std::uint32_t>> seen;
    for (std::uint32_t i = 0; i < first + second; ++i) {
      const std::uint32_t at_x = i % kWidth;
      const std::uint32_t at_y = i / kWidth;
      const auto x = static_cast<std::uint32_t>(image.at(at_x, at_y, 0));
      const auto y = static_cast<std::uint32_t>(image.at(at_x, at_y, 1));
      const auto value = static_cast<std::uint32_t>(image.at(at_x, at_y, 2));
      if (i == first) seen.clear();
      EXPECT_TRUE(seen.insert({x, y}).second) << "element " << i << " stands twice";
      ASSERT_EQ(value, i < first ? drawn(x, y, 100, 1) : drawn(x, y, 300, 9)) << "element " << i << " of " << first;
    }
  }
}

TEST(List, ThatIsAbsentHasNoElements) {
  Scene scene;
  Graph graph(graph_of("shade", pass("shade", "shade", "inputs.pixels = \"none\"\n")));
  EXPECT_EQ(shown(frame(graph, scene)), 0U);
}

TEST(List, IsReadLateByTheCpuWithItsCount) {
  Scene scene;
  const std::uint32_t all = count_drawn();
  float sum = 0;
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x) sum += static_cast<float>(drawn(x, y));
  Graph graph(graph_of(
      "late", pass("find", "find", "params.room = 64\n") + pass("late", "late", "inputs.pixels = \"find.pixels\"\n")));
  frame(graph, scene);
  // The copy of a list that has outgrown its memory does not arrive; frame 0 had room for 64.
  const Image second = frame(graph, scene);
  EXPECT_EQ(second.at(3, 3, 0), 0.0F);
  EXPECT_EQ(second.at(3, 3, 1), 0.0F);
  for (int k = 2; k < 4; ++k) {
    const Image image = frame(graph, scene);
    EXPECT_EQ(image.at(3, 3, 0), static_cast<float>(k)) << "the frame before";
    EXPECT_EQ(image.at(3, 3, 1), static_cast<float>(all));
    EXPECT_EQ(image.at(3, 3, 2), 0.0F);
    EXPECT_EQ(image.at(3, 3, 3), sum);
    EXPECT_EQ(stats(graph)["stalls"], 0);
  }
}

TEST(List, ThatIsKeptGoesOnAndCarriesItsElementsWhenItGrows) {
  Scene scene;
  Graph graph(graph_of("collect", pass("collect", "collect", "params.share = 10\nparams.room = 25\n")));
  // 10 a frame: frame 2 overflows by 5, which are lost; from frame 3 on there is room for 50, then for 100.
  std::vector<std::uint32_t> held;
  std::uint32_t capacity = 25;
  for (std::uint32_t k = 0; k < 9; ++k) {
    const Image image = frame(graph, scene);
    const std::uint32_t before = std::accumulate(held.begin(), held.end(), 0U);
    held.push_back(std::min(10U, capacity - before));
    const std::uint32_t count = before + held.back();
    EXPECT_EQ(stats(graph)["lists"],
              nlohmann::json::array({list_of("collect.pixels", capacity, count, 10 - held.back())}))
        << "frame " << k;
    for (std::uint32_t f = 0; f < 16; ++f) {
      EXPECT_EQ(image.at(f, 0, 0), static_cast<float>(count)) << "frame " << k;
      EXPECT_EQ(image.at(f, 0, 1), f < held.size() ? static_cast<float>(held[f]) : 0.0F)
          << "frame " << k << ", of " << f;
      const bool is_whole = f < held.size() && held[f] == 10;
      EXPECT_TRUE(!is_whole || image.at(f, 0, 2) == 45.0F) << "0 to 9, each once";
      EXPECT_EQ(image.at(f, 0, 3), static_cast<float>(capacity));
    }
    if (held.back() < 10) capacity = std::max(2 * capacity, count + 10 - held.back());
  }
  EXPECT_EQ(capacity, 100U);
}

TEST(List, ThatIsKeptTellsOfEachFrameHowManyHadNoRoom) {
  Scene scene;
  Graph graph(
      graph_of("collect", pass("collect", "collect", "params.share = 10\nparams.room = 25\nparams.grows = false\n")));
  for (std::uint32_t k = 0; k < 5; ++k) {
    const Image image = frame(graph, scene);
    const std::uint32_t count = std::min(10 * (k + 1), 25U);
    EXPECT_EQ(stats(graph)["lists"], nlohmann::json::array({list_of("collect.pixels", 25, count,
                                                                    k < 2    ? 0
                                                                    : k == 2 ? 5
                                                                             : 10)}))
        << "frame " << k;
    EXPECT_EQ(image.at(0, 0, 0), static_cast<float>(count)) << "frame " << k;
  }
  // A frame that appends nothing leaves nothing out.
  graph.set(fmt::format("collect.params.activity={}", HEDDLE_KEEP));
  frame(graph, scene);
  EXPECT_EQ(stats(graph)["lists"], nlohmann::json::array({list_of("collect.pixels", 25, 25, 0)}));
}

TEST(List, ThatIsKeptIsEmptiedByACutAndByItsMakerAlone) {
  Scene scene;
  for (const bool is_rewritten : {false, true}) {
    Graph graph(graph_of(
        "collect", pass("collect", is_rewritten ? "rewrite" : "collect", "params.share = 10\nparams.room = 100\n")));
    std::uint32_t count = 0;
    const auto expect = [&](std::uint32_t activity, bool is_cut) {
      graph.set(fmt::format("collect.params.activity={}", activity));
      const bool runs = activity == HEDDLE_RUN;
      if (activity == HEDDLE_NOTHING || (is_cut && runs) || (is_rewritten && runs)) count = 0;
      if (runs) count += 10;
      const Image image = frame(graph, scene, is_cut);
      EXPECT_EQ(stats(graph)["lists"], nlohmann::json::array({list_of("collect.pixels", 100, count, 0)}));
      EXPECT_EQ(image.at(0, 0, 0), static_cast<float>(count))
          << "rewritten " << is_rewritten << ", activity " << activity << ", cut " << is_cut;
    };
    expect(HEDDLE_RUN, false);
    expect(HEDDLE_RUN, false);
    expect(HEDDLE_KEEP, false);
    expect(HEDDLE_RUN, true);
    expect(HEDDLE_RUN, false);
    expect(HEDDLE_NOTHING, false);
    expect(HEDDLE_RUN, false);
    expect(HEDDLE_KEEP, false);
  }
}

TEST(List, IsMadeByWhoeverComesFirst) {
  Scene scene;
  Graph alone(graph_of("shade", pass("own", "own", "params.room = 3840\n") +
                                    pass("shade", "shade", "inputs.pixels = \"own.pixels\"\n")));
  expect_whole(frame(alone, scene));
  EXPECT_EQ(stats(alone)["lists"], nlohmann::json::array({list_of("own.pixels", 3840, count_drawn(), 0)}));
  Graph behind(graph_of("shade", pass("find", "find", "params.share = 0\nparams.room = 3000\n") +
                                     pass("own", "own", "inputs.pixels = \"find.pixels\"\nparams.room = 1\n") +
                                     pass("shade", "shade", "inputs.pixels = \"own.pixels\"\n")));
  expect_whole(frame(behind, scene));
  EXPECT_EQ(stats(behind)["lists"], nlohmann::json::array({list_of("find.pixels", 3000, count_drawn(), 0)}));
}

TEST(List, SurvivesASwapOfAnotherPassWithItsElements) {
  Scene scene;
  Graph graph(graph_of("order", pass("collect", "collect", "params.share = 10\nparams.room = 100\n") +
                                    pass("order", "order", "inputs.pixels = \"collect.pixels\"\n")));
  for (int k = 0; k < 3; ++k) frame(graph, scene);
  graph.set("order.technique=shade");
  frame(graph, scene);
  EXPECT_EQ(stats(graph)["lists"], nlohmann::json::array({list_of("collect.pixels", 100, 40, 0)}));
  EXPECT_EQ(stats(graph)["plan"]["passes_made"], 1);
}

TEST(Redeclare, MigratesAKeptImageAndItsHistory) {
  Scene scene;
  Graph graph(graph_of("canvas", pass("canvas", "canvas")));
  std::uint32_t width = 2;
  for (std::uint32_t k = 0; k < 10; ++k) {
    const Image image = frame(graph, scene);
    for (std::uint32_t x = 0; x < 16; ++x) {
      const float made = static_cast<float>(x) + 1.0F;
      EXPECT_EQ(image.at(x, 2), x >= width ? -1.0F : x <= k ? made : 0.0F) << "frame " << k << ", column " << x;
      EXPECT_EQ(image.at(x, 6), x >= width ? -1.0F
                                : x < k    ? made
                                           : 0.0F)
          << "last frame's, frame " << k << ", column " << x;
    }
    if (k + 1 == width) width += 3;
  }
  EXPECT_EQ(width, 11U);
}

std::string error_of(const std::string& text) {
  Scene scene;
  Graph graph(text);
  return heddle_render(graph.handle, scene.handle, nullptr) == HEDDLE_OK ? "" : heddle_error(Host::get().handle);
}

TEST(List, IsNotWhatReadsABufferOfFixedLengthExpects) {
  Scene scene;
  const std::string text =
      graph_of("fixed", pass("find", "find") + pass("fixed", "fixed", "inputs.pixels = \"find.pixels\"\n"));
  heddle_graph* graph = nullptr;
  EXPECT_EQ(heddle_graph_parse(Host::get().handle, text.c_str(), "test.toml", ".", nullptr, 0, &graph),
            HEDDLE_BAD_INPUT);
  EXPECT_STREQ(
      heddle_error(Host::get().handle),
      "test.toml:11:17: error: pass 'fixed': input 'pixels' is a buffer of fixed length, but 'find.pixels' is a "
      "list\n  found:    \"find.pixels\"\n  expected: a port that is a buffer of fixed length");
}

TEST(List, ThatIsTooLargeForTheDeviceIsRefused) {
  EXPECT_EQ(error_of(shaded("params.room = 2000000000\n")),
            "test.toml:3:1: error: the list 'find.pixels' is too large for this device\n"
            "  found:    2000000000 elements of 8 bytes\n"
            "  expected: at most 16777214 elements: 134217728 bytes in all");
}

TEST(List, IsNotDispatchedOverInMoreWorkGroupsThanTheDeviceHas) {
  EXPECT_EQ(error_of(shaded("params.room = 524288\n")),
            "error: pass 'shade': shader 'shade' has 8 invocations in a work group, and this device dispatches at most "
            "65535 of them: not over 'find.pixels' with its 524288 elements\n"
            "  help:     a larger local_size_x, or a smaller capacity");
  EXPECT_EQ(error_of(shaded("params.room = 524280\n")), "");
}

TEST(List, IsDispatchedOverOnlyWhereItIsDeclared) {
  EXPECT_EQ(
      error_of(graph_of("undeclared",
                        pass("find", "find") + pass("undeclared", "undeclared", "inputs.pixels = \"find.pixels\"\n"))),
      "test.toml:7:1: error: pass 'undeclared' (lists/undeclared): dispatches over 'pixels', which is no list that "
      "stage 'clear' declares as STORAGE_READ or STORAGE_READ_WRITE\n"
      "  help:     this is a mistake of the technique, not of the graph");
}

}  // namespace
