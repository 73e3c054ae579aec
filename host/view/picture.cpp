// SPDX-License-Identifier: Apache-2.0
#include "view/picture.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace heddle::view {

namespace {

std::uint8_t byte_of(float value) {
  // Written so that NaN fails the comparison and becomes 0, as in files.
  const float clamped = value > 0.0F ? std::min(value, 1.0F) : 0.0F;
  return static_cast<std::uint8_t>(std::lround(clamped * 255.0F));
}

}  // namespace

std::vector<std::uint8_t> bytes_of(const std::vector<float>& values, std::uint32_t channels) {
  const std::size_t pixels = values.size() / channels;
  std::vector<std::uint8_t> rgba(4 * pixels, 255);
  const std::uint32_t colors = channels < 3 ? 1 : 3;
  for (std::size_t i = 0; i < pixels; ++i)
    for (std::uint32_t c = 0; c < 3; ++c)
      rgba[4 * i + c] = c < colors ? byte_of(values[i * channels + c]) : rgba[4 * i];
  return rgba;
}

std::shared_ptr<Picture> PictureMemory::take() {
  auto picture = std::make_unique<Picture>();
  {
    const std::lock_guard lock(free_->mutex);
    if (!free_->bytes.empty()) {
      picture->rgba = std::move(free_->bytes.back());
      free_->bytes.pop_back();
    }
  }
  // The deleter holds what it gives back to: pictures may outlive their memory's owner.
  return {picture.release(), [free = free_](Picture* ended) {
            const std::unique_ptr<Picture> owned(ended);
            const std::lock_guard lock(free->mutex);
            if (free->bytes.size() < kMostFree) free->bytes.push_back(std::move(owned->rgba));
          }};
}

Distance difference(const Picture& a, const Picture& b, double gain, std::vector<std::uint8_t>& rgba) {
  rgba.assign(a.rgba.size(), 255);
  Distance distance;
  std::uint64_t squares = 0;
  for (std::size_t i = 0; i < a.rgba.size(); i += 4) {
    bool differs = false;
    for (std::size_t c = 0; c < 3; ++c) {
      const int far = std::abs(a.rgba[i + c] - b.rgba[i + c]);
      differs = differs || far > 0;
      distance.maximum = std::max(distance.maximum, far);
      squares += static_cast<std::uint64_t>(far) * static_cast<std::uint64_t>(far);
      rgba[i + c] = static_cast<std::uint8_t>(std::lround(std::min(255.0, far * gain)));
    }
    distance.differing_pixels += differs ? 1 : 0;
  }
  const double samples = 0.75 * static_cast<double>(a.rgba.size());
  distance.root_mean_square = samples > 0 ? std::sqrt(static_cast<double>(squares) / samples) : 0;
  return distance;
}

}  // namespace heddle::view
