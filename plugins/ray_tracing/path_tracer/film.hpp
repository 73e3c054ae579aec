// SPDX-License-Identifier: Apache-2.0
// Estimates of pixels -> their means, how wrong these are, and a file to go on from. README "Samples", "Checkpoints".
#pragma once

#include "integrator.hpp"

#include <array>
#include <filesystem>
#include <string>

namespace heddle::path_tracer {

/// Sums of a pixel, in float64.
struct PixelSums {
  std::array<glm::dvec3, kReplicates> radiance{};  // a sum for each scrambling
  glm::dvec3 emission{0.0}, direct{0.0}, indirect_diffuse{0.0}, indirect_specular{0.0};
  double coverage = 0.0, occlusion = 0.0, shadow = 0.0;

  void add(std::uint64_t sample, const Estimate& estimate);
  [[nodiscard]] glm::dvec3 mean(std::uint32_t samples) const;
  /// Variance of that mean, from how much the scramblings' means differ; infinity for a single sample.
  [[nodiscard]] glm::dvec3 variance(std::uint32_t samples) const;
};

/// How wrong a picture is on the whole.
struct FilmError {
  double standard_error = 0.0;  // cd/m^2: root of the mean variance over pixels and channels
  double relative = 0.0;        // over the mean radiance; 0 where all is black
};

class Film {
 public:
  static constexpr std::uint32_t kTile = 16;  // pixels a side: samples are taken tile by tile

  void reset(std::uint32_t width, std::uint32_t height, std::uint64_t key);
  [[nodiscard]] bool is_of(std::uint32_t width, std::uint32_t height, std::uint64_t key) const {
    return width == width_ && height == height_ && key == key_ && !tiles_.empty();
  }
  [[nodiscard]] std::uint64_t key() const { return key_; }
  [[nodiscard]] std::uint32_t tile_count() const { return static_cast<std::uint32_t>(tiles_.size()); }
  [[nodiscard]] std::uint32_t tile_samples(std::uint32_t tile) const { return tiles_[tile]; }
  void set_tile_samples(std::uint32_t tile, std::uint32_t samples) { tiles_[tile] = samples; }
  /// Pixels of a tile: visit(x, y, sums).
  template <typename Visit>
  void for_tile(std::uint32_t tile, const Visit& visit);

  /// Samples that every pixel has.
  [[nodiscard]] std::uint32_t samples() const;
  [[nodiscard]] std::uint32_t samples_at(std::uint32_t x, std::uint32_t y) const {
    return tiles_[y / kTile * columns_ + x / kTile];
  }
  [[nodiscard]] const PixelSums& at(std::uint32_t x, std::uint32_t y) const {
    return pixels_[std::size_t{y} * width_ + x];
  }
  [[nodiscard]] FilmError error() const;

  /// Whole or not at all. `settings`: a line for people. Empty: done; else what went wrong.
  [[nodiscard]] std::string save(const std::filesystem::path& file, const std::string& settings) const;
  /// Foreign: no checkpoint at all, or one that cannot be read.
  enum class Found : std::uint32_t { kNothing, kForeign, kOther, kDamaged, kLoaded };
  /// Takes up what the file holds if it was made of the same: key and size of this film. `settings`: its line for
  /// people, of a whole file; of a film of another format "".
  [[nodiscard]] Found load(const std::filesystem::path& file, std::string& settings);

 private:
  std::uint32_t width_ = 0, height_ = 0, columns_ = 0;
  std::uint64_t key_ = 0;
  std::vector<PixelSums> pixels_;
  std::vector<std::uint32_t> tiles_;  // samples of each
};

template <typename Visit>
void Film::for_tile(std::uint32_t tile, const Visit& visit) {
  const std::uint32_t x0 = tile % columns_ * kTile, y0 = tile / columns_ * kTile;
  for (std::uint32_t y = y0; y < std::min(y0 + kTile, height_); ++y)
    for (std::uint32_t x = x0; x < std::min(x0 + kTile, width_); ++x) visit(x, y, pixels_[std::size_t{y} * width_ + x]);
}

}  // namespace heddle::path_tracer
