// SPDX-License-Identifier: Apache-2.0
// Two images -> numbers and an image of their difference.
#include "compare/metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace heddle::compare {
namespace {

/// |a - b| of every value.
std::vector<double> magnitudes_of(const Picture& a, const Picture& b) {
  std::vector<double> magnitudes(a.pixels.size());
  std::transform(a.pixels.begin(), a.pixels.end(), b.pixels.begin(), magnitudes.begin(),
                 [](float left, float right) { return std::abs(double{left} - right); });
  return magnitudes;
}

/// Nearest rank: the smallest value that at least `percent` of 100 values do not exceed. Reorders.
double nearest_rank(std::vector<double>& values, double percent) {
  // A rank that is whole but for rounding is that rank.
  const double rank = std::ceil(percent / 100.0 * static_cast<double>(values.size()) * (1.0 - 1e-14));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(std::max(rank, 1.0)) - 1;
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

}  // namespace

Metrics measure(const Picture& a, const Picture& b) {
  check_pair(a, b);
  const std::size_t count = a.pixels.size();
  Metrics metrics;
  double sum_squares = 0, sum_relative = 0, sum = 0;
  std::vector<double> magnitudes = magnitudes_of(a, b);
  std::size_t largest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double reference = b.pixels[i];
    const double difference = double{a.pixels[i]} - reference;
    const double square = difference * difference;
    sum += difference;
    sum_squares += square;
    sum_relative += square / (reference * reference + kRelativeEpsilon);
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
  metrics.percentile_99 = nearest_rank(magnitudes, 99);  // last, since it reorders
  return metrics;
}

double percentile(const Picture& a, const Picture& b, double percent) {
  check_pair(a, b);
  std::vector<double> magnitudes = magnitudes_of(a, b);
  return nearest_rank(magnitudes, percent);
}

image::Image difference(const Picture& a, const Picture& b) {
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
