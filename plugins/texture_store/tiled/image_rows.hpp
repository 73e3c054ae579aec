// SPDX-License-Identifier: Apache-2.0
// An image file of any size -> texels of a square texture whose side is a power of two, part by part: as they are where
// the image is such a square, else stretched. Files without tiles are read once, from top to bottom.
// Source  Catmull, Rom 1974, "A Class of Local Interpolating Splines"; Keys 1981, "Cubic Convolution Interpolation for
//         Digital Image Processing" (the same weights): a linear ramp stays one, and nothing moves
#pragma once

#include <heddle/images.h>
#include <heddle/pass.hpp>

#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "pyramid.hpp"

namespace heddle::texture_store {

/// A status that was reported, on its way out of nested calls.
struct Failed {
  heddle_status status = HEDDLE_FAILED;
};
inline void require(heddle_status status) {
  if (status != HEDDLE_OK) throw Failed{status};
}

class ImageRows {
 public:
  enum Encoding : std::uint32_t { kAuto, kSrgb, kLinear };

  ImageRows(const pass::PassHost& host, const heddle_images_service& images, const std::string& path,
            std::uint32_t encoding)
      : host_(host), images_(images) {
    require(images.open(host.raw(), path.c_str(), &file_));
    level_.struct_size = sizeof level_;
    require(images.level(host.raw(), file_, 0, &level_));
    is_linear_ = encoding == kLinear || (encoding == kAuto && level_.is_float != 0);
  }
  ~ImageRows() { images_.close(host_.raw(), file_); }
  ImageRows(const ImageRows&) = delete;
  ImageRows& operator=(const ImageRows&) = delete;

  [[nodiscard]] std::uint32_t width() const { return level_.width; }
  [[nodiscard]] std::uint32_t height() const { return level_.height; }
  [[nodiscard]] bool has_tiles() const { return level_.block_width < level_.width; }

  /// Texels of a texture of `extent` a side. Of files without tiles: all columns, rows one after the other.
  void texels(std::uint32_t extent, std::uint32_t x, std::uint32_t y, std::uint32_t width, std::uint32_t height,
              std::vector<Rgba8>& out) {
    out.resize(std::size_t{width} * height);
    const bool is_exact = level_.width == extent && level_.height == extent;
    if (is_exact && level_.is_float == 0 && !is_linear_) {
      read(x, y, width, height, HEDDLE_IMAGE_BYTES, out.data(), sizeof(Rgba8) * width);
      for (Rgba8& texel : out) texel.a = 255;
      return;
    }
    const Axis across(extent, level_.width, x, width), down(extent, level_.height, y, height);
    fetch(across.first, down.first, across.end - across.first, down.end - down.first);
    stretch(across, down, out);
  }

 private:
  /// Which pixels make a run of texels along one side, and with what weights.
  struct Axis {
    std::uint32_t first = 0, end = 0;                  // pixels
    std::vector<std::array<std::uint32_t, 4>> pixels;  // from `first` on
    std::vector<std::array<float, 4>> weights;
    Axis(std::uint32_t extent, std::uint32_t size, std::uint32_t begin, std::uint32_t count) {
      std::vector<std::array<std::int64_t, 4>> places(count);
      weights.resize(count);
      std::int64_t least = size - 1, most = 0;
      for (std::uint32_t i = 0; i < count; ++i) {
        // Texture and image share their sides, not their outermost centres.
        const double at = (begin + i + 0.5) * size / extent - 0.5, whole = std::floor(at), t = at - whole;
        weights[i] = {
            static_cast<float>(((-0.5 * t + 1.0) * t - 0.5) * t), static_cast<float>((1.5 * t - 2.5) * t * t + 1.0),
            static_cast<float>(((-1.5 * t + 2.0) * t + 0.5) * t), static_cast<float>((0.5 * t - 0.5) * t * t)};
        for (std::int64_t k = 0; k < 4; ++k) {
          // Where it is a pixel's own place its neighbours are not asked.
          const std::int64_t pixel =
              t == 0 ? static_cast<std::int64_t>(whole) : static_cast<std::int64_t>(whole) - 1 + k;
          places[i][static_cast<std::size_t>(k)] = std::clamp<std::int64_t>(pixel, 0, std::int64_t{size} - 1);
        }
        least = std::min(least, places[i][0]);
        most = std::max(most, places[i][3]);
      }
      first = static_cast<std::uint32_t>(least);
      end = static_cast<std::uint32_t>(most) + 1;
      for (const auto& place : places) {
        std::array<std::uint32_t, 4> of{};
        for (std::size_t k = 0; k < 4; ++k) of[k] = static_cast<std::uint32_t>(place[k] - least);
        pixels.push_back(of);
      }
    }
  };
  using Linear = std::array<float, 3>;

  void read(std::uint32_t x, std::uint32_t y, std::uint32_t width, std::uint32_t height, std::uint32_t samples,
            void* out, std::uint64_t row_bytes) const {
    const heddle_image_part part{sizeof part, 0, x, y, width, height, samples, 0};
    require(images_.read(host_.raw(), file_, &part, out, row_bytes));
  }

  [[nodiscard]] float linear(float stored) const {
    // What is no number is black, and what is beyond white is white once it is a code.
    if (!(stored > 0)) return 0;
    if (is_linear_) return stored;
    return stored <= 0.04045F ? stored / 12.92F : std::pow((stored + 0.055F) / 1.055F, 2.4F);
  }

  /// window_: these pixels, linear. Rows that it has already are not read again.
  void fetch(std::uint32_t x, std::uint32_t y, std::uint32_t width, std::uint32_t height) {
    std::uint32_t kept = 0;
    if (x == window_x_ && width == window_width_ && y >= window_y_ && y < window_y_ + window_height_) {
      kept = std::min(window_y_ + window_height_ - y, height);
      const auto from = window_.begin() + static_cast<std::ptrdiff_t>(std::size_t{width} * (y - window_y_));
      std::copy_n(from, std::size_t{width} * kept, window_.begin());
    }
    window_.resize(std::size_t{width} * height);
    window_x_ = x, window_y_ = y, window_width_ = width, window_height_ = height;
    Linear* out = window_.data() + std::size_t{width} * kept;
    if (level_.is_float == 0 && level_.sample_bits <= 8 && !is_linear_) {
      bytes_.resize(std::size_t{width} * (height - kept));
      read(x, y + kept, width, height - kept, HEDDLE_IMAGE_BYTES, bytes_.data(), sizeof(Rgba8) * width);
      const std::array<float, 256>& table = linear_of_codes();
      for (const Rgba8& pixel : bytes_) *out++ = {table[pixel.r], table[pixel.g], table[pixel.b]};
      return;
    }
    floats_.resize(4 * std::size_t{width} * (height - kept));
    read(x, y + kept, width, height - kept, HEDDLE_IMAGE_FLOATS, floats_.data(), 16 * std::uint64_t{width});
    for (std::size_t i = 0; i < floats_.size(); i += 4)
      *out++ = {linear(floats_[i]), linear(floats_[i + 1]), linear(floats_[i + 2])};
  }

  void stretch(const Axis& across, const Axis& down, std::vector<Rgba8>& out) {
    const std::size_t width = across.pixels.size();
    rows_.resize(width * window_height_);
    for (std::size_t row = 0; row < window_height_; ++row) {
      const Linear* from = window_.data() + row * window_width_;
      for (std::size_t i = 0; i < width; ++i)
        rows_[row * width + i] = mix(across.weights[i], [&](std::size_t k) { return from[across.pixels[i][k]]; });
    }
    std::size_t at = 0;
    for (std::size_t j = 0; j < down.pixels.size(); ++j) {
      for (std::size_t i = 0; i < width; ++i, ++at) {
        const Linear color = mix(down.weights[j], [&](std::size_t k) { return rows_[down.pixels[j][k] * width + i]; });
        out[at] = {code_of_linear(color[0]), code_of_linear(color[1]), code_of_linear(color[2]), 255};
      }
    }
  }
  template <typename Pick>
  static Linear mix(const std::array<float, 4>& weights, const Pick& pick) {
    Linear sum{};
    for (std::size_t k = 0; k < 4; ++k) {
      // Infinities of a file times 0 would be no number.
      if (weights[k] == 0) continue;
      const Linear value = pick(k);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weights[k] * value[c];
    }
    return sum;
  }

  const pass::PassHost host_;
  const heddle_images_service& images_;
  heddle_image_file* file_ = nullptr;
  heddle_image_level level_{};
  bool is_linear_ = false;
  std::vector<Linear> window_, rows_;
  std::uint32_t window_x_ = 0, window_y_ = 0, window_width_ = 0, window_height_ = 0;
  std::vector<Rgba8> bytes_;
  std::vector<float> floats_;
};

}  // namespace heddle::texture_store
