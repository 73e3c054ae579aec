// SPDX-License-Identifier: Apache-2.0
// A display and a view, of OpenColorIO's built-in transforms or of a config file -> shader text and tables, and the
// same transform on the CPU. Knows no host.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace ocio_display {

/// What the parameters `display` and `view` may be; NULL-terminated.
inline constexpr const char* kDisplayNames[] = {"srgb",       "rec1886_rec709", "gamma22_rec709", "rec1886_rec2020",
                                                "gamma26_p3", "rec2100_pq",     "rec2100_hlg",    "st2084_p3",
                                                nullptr};
inline constexpr const char* kViewNames[] = {
    "aces_sdr",      "aces_sdr_rec709_limit", "aces_sdr_p3_limit", "aces_cinema", "aces_hdr_1000",
    "aces_hdr_2000", "aces_hdr_4000",         "aces_cinema_108",   "none",        nullptr};
/// Whether 8 bits are too few for the display's curve.
bool needs_16_bits(std::uint32_t display);

struct Request {
  std::uint32_t display = 0, view = 0;  // indices of the names; without a config
  bool compresses_gamut = false;
  std::string config;  // a file; empty: built-in transforms
  std::string config_source, config_display, config_view;
  std::uint32_t lut_size = 0;  // 0: the transform itself
  bool operator==(const Request&) const = default;
};

/// The request cannot be met, in words for the person who made it.
struct BadRequest : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Transform {
 public:
  /// Throws BadRequest.
  explicit Transform(const Request& request);
  ~Transform();
  Transform(Transform&&) noexcept;
  Transform& operator=(Transform&&) noexcept;

  /// Defines `vec4 ocio_transform(vec4 exposed)`; needs lookup.glsl.
  [[nodiscard]] const std::string& glsl() const { return glsl_; }
  /// Four floats a texel; never empty.
  [[nodiscard]] const std::vector<float>& lookups() const { return lookups_; }
  /// The CPU path of the library, of exposed linear Rec.709, in place; three floats a pixel. No table, whatever
  /// lut_size.
  void apply(std::span<float> rgb) const;

 private:
  void write_text();
  void bake(std::uint32_t size);

  struct Processor;
  std::unique_ptr<Processor> processor_;
  std::string glsl_;
  std::vector<float> lookups_;
};

/// Position in a baked table's axis, [0, 1], of an exposed value, and back: even in log2(1 + x / kShaperOffset).
inline constexpr double kShaperOffset = 1.0 / 1024.0, kShaperLargest = 1024.0;
double shape(double exposed);
double unshape(double position);

}  // namespace ocio_display
