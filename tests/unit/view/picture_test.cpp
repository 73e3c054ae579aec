// SPDX-License-Identifier: Apache-2.0
#include "view/picture.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

using heddle::view::bytes_of;
using testing::ElementsAre;

TEST(PictureMemory, IsUsedAgainOnceNobodyHoldsThePicture) {
  heddle::view::PictureMemory memory;
  auto first = memory.take();
  first->rgba.resize(64);
  first->serial = 3;
  const std::uint8_t* bytes = first->rgba.data();
  const std::shared_ptr<const heddle::view::Picture> shown = first;
  first.reset();
  auto second = memory.take();
  second->rgba.resize(64);
  EXPECT_NE(second->rgba.data(), bytes);
  EXPECT_EQ(shown->rgba.data(), bytes);
  const std::uint8_t* freed = second->rgba.data();
  second.reset();
  const auto third = memory.take();
  EXPECT_EQ(third->rgba.data(), freed);
  EXPECT_EQ(third->serial, 0U);
}

TEST(PictureMemory, MayEndBeforeItsPictures) {
  auto memory = std::make_unique<heddle::view::PictureMemory>();
  const auto picture = memory->take();
  picture->rgba.resize(16);
  memory.reset();
  EXPECT_EQ(picture->rgba.size(), 16U);
}

TEST(Picture, RoundsAsFilesDo) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  EXPECT_THAT(bytes_of({0.5F / 255, 0.4999F / 255, 254.5F / 255, nan, -1, infinity}, 3),
              ElementsAre(1, 0, 255, 255, 0, 0, 255, 255));
}

TEST(Picture, ShowsGreyAndNoAlpha) {
  EXPECT_THAT(bytes_of({1, 0, 0.2F, 0.1F}, 2), ElementsAre(255, 255, 255, 255, 51, 51, 51, 255));
  EXPECT_THAT(bytes_of({0, 0.2F, 1, 0}, 4), ElementsAre(0, 51, 255, 255));
}

TEST(Picture, MeasuresDifferencesInSteps) {
  heddle::view::Picture a, b;
  a.width = b.width = 2;
  a.height = b.height = 1;
  a.rgba = {10, 20, 30, 255, 0, 0, 0, 255};
  b.rgba = {10, 23, 26, 255, 0, 0, 0, 255};
  std::vector<std::uint8_t> rgba;
  const auto distance = heddle::view::difference(a, b, 100, rgba);
  EXPECT_EQ(distance.maximum, 4);
  EXPECT_EQ(distance.differing_pixels, 1U);
  EXPECT_DOUBLE_EQ(distance.root_mean_square, std::sqrt(25.0 / 6));
  EXPECT_THAT(rgba, ElementsAre(0, 255, 255, 255, 0, 0, 0, 255));
}
