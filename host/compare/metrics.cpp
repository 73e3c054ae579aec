// SPDX-License-Identifier: Apache-2.0
// Two images -> numbers and an image of their difference.
#include "compare/metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace heddle::compare {
namespace {

// Keeps relMSE finite where the reference is black; the value that papers on denoising use.
constexpr double kRelativeEpsilon = 0.01;

std::string shape_of(const image::Image& image) {
  return fmt::format("{} x {} x {}", image.width, image.height, image.channels);
}

void check_finite(const image::Image& image, std::string_view name) {
  const auto bad =
      std::find_if(image.pixels.begin(), image.pixels.end(), [](float value) { return !std::isfinite(value); });
  if (bad == image.pixels.end()) {
    return;
  }
  const auto index = static_cast<std::size_t>(bad - image.pixels.begin());
  const std::size_t pixel = index / image.channels;
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                           {},
                                           fmt::format("a value of {} is not finite", name),
                                           fmt::format("{} at x {}, y {}, channel {}", *bad, pixel % image.width,
                                                       pixel / image.width, index % image.channels),
                                           "finite values",
                                           ""});
}

void check_pair(const image::Image& a, const image::Image& b) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels) {
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             {},
                                             "images of different shapes cannot be compared",
                                             fmt::format("image a is {}, image b {}", shape_of(a), shape_of(b)),
                                             "the same width, height and channels",
                                             ""});
  }
  for (const image::Image* image : {&a, &b}) {
    if (image->pixels.empty() || image->pixels.size() != std::size_t{image->width} * image->height * image->channels) {
      throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                               {},
                                               "an image without pixels cannot be compared",
                                               fmt::format("{} with {} values", shape_of(*image), image->pixels.size()),
                                               "width x height x channels values, at least one",
                                               ""});
    }
  }
  check_finite(a, "image a");
  check_finite(b, "image b (the reference)");
}

}  // namespace

Metrics measure(const image::Image& a, const image::Image& b) {
  check_pair(a, b);
  const std::size_t count = a.pixels.size();
  Metrics metrics;
  double sum_squares = 0, sum_relative = 0, sum = 0;
  std::vector<double> magnitudes(count);
  std::size_t largest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double reference = b.pixels[i];
    const double difference = double{a.pixels[i]} - reference;
    const double square = difference * difference;
    sum += difference;
    sum_squares += square;
    sum_relative += square / (reference * reference + kRelativeEpsilon);
    magnitudes[i] = std::abs(difference);
    if (magnitudes[i] > magnitudes[largest]) {
      largest = i;
    }
  }
  for (std::size_t i = 0; i < count; i += a.channels) {
    const auto first = magnitudes.begin() + static_cast<std::ptrdiff_t>(i);
    metrics.differing_pixels += std::any_of(first, first + a.channels, [](double value) { return value != 0; }) ? 1 : 0;
  }
  const auto values = static_cast<double>(count);
  metrics.mse = sum_squares / values;
  metrics.rmse = std::sqrt(metrics.mse);
  metrics.relmse = sum_relative / values;
  metrics.psnr = metrics.mse > 0 ? 10.0 * std::log10(1.0 / metrics.mse) : std::numeric_limits<double>::infinity();
  metrics.mean_difference = sum / values;
  metrics.maximum = magnitudes[largest];
  metrics.maximum_channel = static_cast<std::uint32_t>(largest % a.channels);
  metrics.maximum_x = static_cast<std::uint32_t>(largest / a.channels % a.width);
  metrics.maximum_y = static_cast<std::uint32_t>(largest / a.channels / a.width);
  // Nearest rank: the smallest value that at least 99 of 100 values do not exceed. Last, since it reorders.
  const std::size_t rank = (count * 99 + 99) / 100;
  const auto nth = magnitudes.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::nth_element(magnitudes.begin(), nth, magnitudes.end());
  metrics.percentile_99 = *nth;
  return metrics;
}

image::Image difference(const image::Image& a, const image::Image& b) {
  check_pair(a, b);
  image::Image result{a.width, a.height, a.channels, std::vector<float>(a.pixels.size())};
  std::transform(a.pixels.begin(), a.pixels.end(), b.pixels.begin(), result.pixels.begin(),
                 [](float left, float right) { return static_cast<float>(std::abs(double{left} - right)); });
  return result;
}

std::string to_json(const Metrics& metrics) {
  const std::string psnr = std::isfinite(metrics.psnr) ? fmt::format("{}", metrics.psnr) : "null";
  return fmt::format(
      R"({{"mse": {}, "rmse": {}, "relmse": {}, "psnr": {}, "mean_difference": {}, "maximum": {}, )"
      R"("maximum_at": {{"x": {}, "y": {}, "channel": {}}}, "percentile_99": {}, "differing_pixels": {}}})",
      metrics.mse, metrics.rmse, metrics.relmse, psnr, metrics.mean_difference, metrics.maximum, metrics.maximum_x,
      metrics.maximum_y, metrics.maximum_channel, metrics.percentile_99, metrics.differing_pixels);
}

}  // namespace heddle::compare
