// SPDX-License-Identifier: Apache-2.0
#include "view/knob.hpp"
#include "view/catalog.hpp"

#include <gtest/gtest.h>

namespace {

using heddle::Json;
using heddle::view::Track;

Json parameter(const char* type, double minimum, double maximum, double by_default, std::vector<double> ladder = {}) {
  return {{"type", type},
          {"minimum", minimum},
          {"maximum", maximum},
          {"default", {by_default, 0.0, 0.0}},
          {"ladder", ladder}};
}

}  // namespace

TEST(Track, GivesEachStepOfALadderTheSameRoom) {
  const Track track(parameter("int", 1, 65536, 64, {1, 4, 16, 64, 256, 1024}));
  EXPECT_EQ(track.end(), 5);
  EXPECT_EQ(track.position_of(16), 2);
  EXPECT_EQ(track.value_at(2), 16);
  EXPECT_EQ(track.value_at(2.1), 16);  // a detent
  EXPECT_EQ(track.value_at(2.5), 32);  // by factors between them
  EXPECT_NEAR(track.position_of(32), 2.5, 1e-12);
}

TEST(Track, ReadsALadderThatFalls) {
  const Track track(parameter("int", 1, 8, 2, {4, 2, 1}));
  EXPECT_EQ(track.position_of(4), 0);
  EXPECT_EQ(track.position_of(1), 2);
  EXPECT_EQ(track.position_of(8), 0);  // beyond its cheap end
  EXPECT_EQ(track.value_at(1.5), 1);   // of 2 and 1, rounded
  EXPECT_NEAR(track.position_of(3), 0.415, 1e-3);
}

TEST(Track, CoversTheWantedPartOfEndlessRanges) {
  const Track track(parameter("float", 1e-6, 1e6, 0.5));
  EXPECT_NEAR(track.value_at(0), 0.005, 1e-15);
  EXPECT_NEAR(track.value_at(1), 50, 1e-12);
  EXPECT_EQ(track.value_at(0.5), 0.5);
  EXPECT_EQ(track.position_of(1e6), 1);
  EXPECT_EQ(track.position_of(1e-6), 0);
}

TEST(Track, IsEvenOverOrdinaryRanges) {
  const Track track(parameter("float", -16, 24, 15));
  EXPECT_NEAR(track.value_at(0.5), 4, 1e-12);
  EXPECT_NEAR(track.position_of(15), 31.0 / 40, 1e-12);
  const Track from_zero(parameter("float", 0, 1e9, 10));
  EXPECT_EQ(from_zero.value_at(1), 40);
}

TEST(Track, GivesNoMoreDigitsThanASliderHas) {
  const Track track(parameter("float", 1e-6, 1e6, 0.5));
  EXPECT_EQ(track.value_at(0.3), 0.0792);  // 0.0792446...
  EXPECT_EQ(Track(parameter("float", -1, 1, 0)).value_at(0.123456), -0.753);
}

TEST(Track, ComesBackToEachValueThatItGives) {
  for (const Json& one : {parameter("float", 1e-6, 1e6, 0.5), parameter("float", -16, 24, 15),
                          parameter("float", 0.25, 8, 1, {0.25, 0.5, 1, 2}), parameter("float", 0, 1, 0.9)}) {
    const Track track(one);
    for (int i = 0; i <= 200; ++i) {
      const double value = track.value_at(track.end() * i / 200);
      EXPECT_EQ(track.value_at(track.position_of(value)), value);
    }
  }
}

TEST(Catalog, KnowsWhichGraphsRemember) {
  const Json list{{"techniques",
                   {{{"role", "r"}, {"name", "kept"}, {"ports", {{{"flags", {"kept"}}}}}, {"stages", Json::array()}},
                    {{"role", "r"}, {"name", "plain"}, {"ports", Json::array()}, {"stages", {{{"latency", 0}}}}},
                    {{"role", "r"}, {"name", "late"}, {"ports", Json::array()}, {"stages", {{{"latency", 2}}}}}}}};
  const auto graph = [](const char* technique, bool is_left_out = false, const char* input = "a.b") {
    return Json{{"passes", Json::array({{{"name", "p"},
                                         {"role", "r"},
                                         {"technique", technique},
                                         {"is_left_out", is_left_out},
                                         {"inputs", {{"x", input}}}}})}};
  };
  EXPECT_TRUE(heddle::view::remembers(graph("kept"), list));
  EXPECT_FALSE(heddle::view::remembers(graph("kept", true), list));
  EXPECT_FALSE(heddle::view::remembers(graph("plain"), list));
  EXPECT_TRUE(heddle::view::remembers(graph("late"), list));
  EXPECT_TRUE(heddle::view::remembers(graph("plain", false, "a.b@previous"), list));
}
