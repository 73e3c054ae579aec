// SPDX-License-Identifier: Apache-2.0
// How many frames fit between two pictures: with times that are given, never measured.
#include "view/pace.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace heddle::view {
namespace {

/// Frames of each turn while frames take frame_ms and showing show_ms.
std::vector<std::uint32_t> turns(double frame_ms, double show_ms, double budget_ms, int count) {
  std::vector<std::uint32_t> frames;
  Turn last;
  for (int i = 0; i < count; ++i) {
    last.frames = frames_before_picture(last, budget_ms);
    last.render_ms = last.frames * frame_ms;
    last.show_ms = show_ms;
    frames.push_back(last.frames);
  }
  return frames;
}

TEST(Pace, ShowsTheFirstFrameAfterAChangeAtOnce) {
  EXPECT_EQ(frames_before_picture({}, 1e9), 1U);
}

TEST(Pace, DoublesUntilTheBudgetIsFullAndStaysThere) {
  EXPECT_EQ(turns(1, 10, 32, 8), (std::vector<std::uint32_t>{1, 2, 4, 8, 16, 22, 22, 22}));
  EXPECT_EQ(turns(4, 0, 32, 6), (std::vector<std::uint32_t>{1, 2, 4, 8, 8, 8}));
}

TEST(Pace, ShowsEachFrameWhereNoSecondOneFits) {
  EXPECT_EQ(turns(17, 0, 33, 4), (std::vector<std::uint32_t>{1, 1, 1, 1}));
  EXPECT_EQ(turns(1, 40, 33, 4), (std::vector<std::uint32_t>{1, 1, 1, 1})) << "showing alone takes longer";
  EXPECT_EQ(turns(1, 0, 0, 4), (std::vector<std::uint32_t>{1, 1, 1, 1})) << "no budget";
}

TEST(Pace, TakesLessAgainWhereFramesHaveBecomeSlower) {
  EXPECT_EQ(frames_before_picture({16, 16 * 8.0, 1}, 33), 4U);
  EXPECT_EQ(frames_before_picture({16, 16 * 1000.0, 1}, 33), 1U);
}

TEST(Pace, BearsTimesThatAreNone) {
  EXPECT_EQ(frames_before_picture({3, 0, 0}, 33), 6U) << "quicker than the clock's step";
  EXPECT_EQ(frames_before_picture({3, std::numeric_limits<double>::infinity(), 0}, 33), 1U);
  EXPECT_EQ(frames_before_picture({3, 1, std::numeric_limits<double>::quiet_NaN()}, 33), 1U);
  EXPECT_EQ(turns(0, 0, 33, 40).back(), 65536U);
}

}  // namespace
}  // namespace heddle::view
