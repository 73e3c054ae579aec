// SPDX-License-Identifier: Apache-2.0
#include "film.hpp"

#include "content_hash.hpp"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

namespace heddle::path_tracer {
namespace {

using glm::dvec3;

/// A file: this head, `settings_bytes` of text, samples of the tiles, the pixels' sums.
struct FileHead {
  char magic[8];
  std::uint64_t key;
  std::uint64_t check;  // of all else
  std::uint32_t width, height, tile_count, settings_bytes;
};
// The last of these is the format: 4 has two scramblings' sums, 3 had four.
constexpr char kMagic[8] = {'H', 'D', 'L', 'P', 'A', 'T', 'H', '4'};

std::uint64_t check_of(FileHead head, const std::string& settings, const std::vector<std::uint32_t>& tiles,
                       const std::vector<PixelSums>& pixels) {
  ContentHash hash;
  head.check = 0;
  hash.add(head);
  hash.add_bytes(settings.data(), settings.size());
  hash.add_bytes(tiles.data(), tiles.size() * sizeof(std::uint32_t));
  hash.add_bytes(pixels.data(), pixels.size() * sizeof(PixelSums));
  return hash.value();
}

std::string problem(const std::filesystem::path& file) {
  return "'" + file.string() + "': " + std::strerror(errno);
}

}  // namespace

void PixelSums::add(std::uint64_t sample, const Estimate& e) {
  radiance[sample % kReplicates] += e.emission + e.direct + e.indirect_diffuse + e.indirect_specular;
  emission += e.emission;
  direct += e.direct;
  indirect_diffuse += e.indirect_diffuse;
  indirect_specular += e.indirect_specular;
  coverage += e.coverage;
  occlusion += e.occlusion;
  shadow += e.shadow;
}

dvec3 PixelSums::mean(std::uint32_t samples) const {
  if (samples == 0) return dvec3(0.0);
  return (emission + direct + indirect_diffuse + indirect_specular) / static_cast<double>(samples);
}

dvec3 PixelSums::variance(std::uint32_t samples) const {
  const std::uint32_t parts = std::min(samples, kReplicates);
  if (parts < 2) return dvec3(std::numeric_limits<double>::infinity());
  const dvec3 whole = mean(samples);
  dvec3 sum(0.0);
  double free = static_cast<double>(samples) * samples;
  for (std::uint32_t i = 0; i < parts; ++i) {
    const double count = samples / kReplicates + (i < samples % kReplicates ? 1U : 0U);
    const dvec3 off = radiance[i] - count * whole;
    sum += off * off;
    free -= count * count;
  }
  return sum / free;
}

void Film::reset(std::uint32_t width, std::uint32_t height, std::uint64_t key) {
  width_ = width;
  height_ = height;
  key_ = key;
  columns_ = (width + kTile - 1) / kTile;
  pixels_.assign(std::size_t{width} * height, {});
  tiles_.assign(std::size_t{columns_} * ((height + kTile - 1) / kTile), 0);
}

std::uint32_t Film::samples() const {
  return tiles_.empty() ? 0 : *std::min_element(tiles_.begin(), tiles_.end());
}

FilmError Film::error() const {
  double variance = 0.0, radiance = 0.0;
  for (std::uint32_t y = 0; y < height_; ++y)
    for (std::uint32_t x = 0; x < width_; ++x) {
      const std::uint32_t samples = samples_at(x, y);
      const dvec3 v = at(x, y).variance(samples), m = at(x, y).mean(samples);
      variance += (v.x + v.y + v.z) / 3.0;
      radiance += (m.x + m.y + m.z) / 3.0;
    }
  const double count = static_cast<double>(pixels_.size());
  FilmError error;
  if (count == 0.0) return error;
  error.standard_error = std::sqrt(variance / count);
  if (radiance > 0.0) error.relative = error.standard_error / (radiance / count);
  return error;
}

std::string Film::save(const std::filesystem::path& file, const std::string& settings) const {
  static_assert(std::is_trivially_copyable_v<PixelSums> &&
                sizeof(PixelSums) == (3 * kReplicates + 15) * sizeof(double));
  FileHead head{};
  std::memcpy(head.magic, kMagic, sizeof kMagic);
  head.key = key_;
  head.width = width_;
  head.height = height_;
  head.tile_count = tile_count();
  head.settings_bytes = static_cast<std::uint32_t>(settings.size());
  head.check = check_of(head, settings, tiles_, pixels_);
  std::error_code code;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), code);
  std::filesystem::path partial = file;
  partial += ".partial";
  errno = 0;
  {
    std::ofstream out(partial, std::ios::binary | std::ios::trunc);
    const auto write = [&](const void* data, std::size_t bytes) {
      out.write(static_cast<const char*>(data), static_cast<std::streamsize>(bytes));
    };
    write(&head, sizeof head);
    write(settings.data(), settings.size());
    write(tiles_.data(), tiles_.size() * sizeof(std::uint32_t));
    write(pixels_.data(), pixels_.size() * sizeof(PixelSums));
    out.flush();
    if (!out) {
      const std::string text = problem(partial);
      std::filesystem::remove(partial, code);
      return text;
    }
  }
  std::filesystem::rename(partial, file, code);
  if (!code) return {};
  std::string text = "'" + file.string() + "': " + code.message();
  std::filesystem::remove(partial, code);
  return text;
}

Film::Found Film::load(const std::filesystem::path& file, std::string& settings) {
  settings.clear();
  std::error_code code;
  const auto kind = std::filesystem::status(file, code).type();
  if (kind == std::filesystem::file_type::not_found) return Found::kNothing;
  if (kind != std::filesystem::file_type::regular) return Found::kForeign;
  std::ifstream in(file, std::ios::binary);
  const auto read = [&](void* data, std::size_t bytes) {
    in.read(static_cast<char*>(data), static_cast<std::streamsize>(bytes));
    return static_cast<bool>(in);
  };
  FileHead head{};
  constexpr std::size_t kName = sizeof kMagic - 1;
  if (!read(head.magic, sizeof head.magic) || std::memcmp(head.magic, kMagic, kName) != 0) return Found::kForeign;
  if (head.magic[kName] != kMagic[kName]) return Found::kOther;
  if (!read(&head.key, sizeof head - sizeof head.magic)) return Found::kDamaged;
  // Sizes are believed once they add up to the file's own.
  constexpr std::uint64_t kMostSide = 1U << 20U;
  const std::uint64_t width = head.width, height = head.height, bytes = std::filesystem::file_size(file, code);
  if (code || width > kMostSide || height > kMostSide ||
      head.tile_count != (width + kTile - 1) / kTile * ((height + kTile - 1) / kTile) ||
      bytes != sizeof head + head.settings_bytes + std::uint64_t{head.tile_count} * sizeof(std::uint32_t) +
                   width * height * sizeof(PixelSums))
    return Found::kDamaged;
  std::string text(head.settings_bytes, '\0');
  std::vector<std::uint32_t> tiles(head.tile_count);
  std::vector<PixelSums> pixels(width * height);
  if (!read(text.data(), text.size()) || !read(tiles.data(), tiles.size() * sizeof(std::uint32_t)) ||
      !read(pixels.data(), pixels.size() * sizeof(PixelSums)) || check_of(head, text, tiles, pixels) != head.check)
    return Found::kDamaged;
  settings = std::move(text);
  if (head.key != key_ || head.width != width_ || head.height != height_) return Found::kOther;
  tiles_ = std::move(tiles);
  pixels_ = std::move(pixels);
  return Found::kLoaded;
}

}  // namespace heddle::path_tracer
