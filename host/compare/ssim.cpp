// SPDX-License-Identifier: Apache-2.0
#include "compare/ssim.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace heddle::compare {
namespace {

constexpr std::ptrdiff_t kRadius = 5;
constexpr double kDeviation = 1.5;
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;

/// What is averaged under the window: a, b, a^2, b^2, a b.
constexpr std::size_t kMoments = 5;

/// Weights of the window about i in 0 .. size - 1, those outside 0, the others adding up to 1.
std::array<double, 2 * kRadius + 1> weights_at(std::ptrdiff_t i, std::ptrdiff_t size) {
  std::array<double, 2 * kRadius + 1> weights{};
  double sum = 0;
  for (std::ptrdiff_t k = -kRadius; k <= kRadius; ++k) {
    if (i + k < 0 || i + k >= size) continue;
    const auto x = static_cast<double>(k);
    sum += weights[static_cast<std::size_t>(k + kRadius)] = std::exp(-x * x / (2.0 * kDeviation * kDeviation));
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// Variances do not depend on where 0 is, and cancel least about the mean.
double mean_of(const Picture& picture, std::uint32_t channel) {
  double sum = 0;
  for (std::size_t i = channel; i < picture.pixels.size(); i += picture.channels) sum += picture.pixels[i];
  return sum / (static_cast<double>(picture.width) * picture.height);
}

double similarity(const std::array<double, kMoments>& m, double shift) {
  const double variance_a = std::max(0.0, m[2] - m[0] * m[0]), variance_b = std::max(0.0, m[3] - m[1] * m[1]);
  const double covariance = m[4] - m[0] * m[1], mean_a = m[0] + shift, mean_b = m[1] + shift;
  return (2.0 * mean_a * mean_b + kC1) * (2.0 * covariance + kC2) /
         ((mean_a * mean_a + mean_b * mean_b + kC1) * (variance_a + variance_b + kC2));
}

}  // namespace

std::vector<float> ssim(const Picture& a, const Picture& b, std::uint32_t threads) {
  const auto width = static_cast<std::ptrdiff_t>(a.width), height = static_cast<std::ptrdiff_t>(a.height);
  std::vector<double> total(std::size_t{a.width} * a.height, 0.0);
  std::vector<std::array<double, 2 * kRadius + 1>> across;
  for (std::ptrdiff_t x = 0; x < width; ++x) across.push_back(weights_at(x, width));
  for (std::uint32_t channel = 0; channel < a.colors(); ++channel) {
    const double shift = mean_of(b, channel);
    for_rows(a.height, threads, [&](std::uint32_t first, std::uint32_t last) {
      // A column's moments, then along the row.
      std::vector<std::array<double, kMoments>> columns(a.width);
      for (std::ptrdiff_t y = first; y < static_cast<std::ptrdiff_t>(last); ++y) {
        const auto down = weights_at(y, height);
        std::fill(columns.begin(), columns.end(), std::array<double, kMoments>{});
        for (std::ptrdiff_t k = std::max(-kRadius, -y); k <= std::min(kRadius, height - 1 - y); ++k) {
          const double weight = down[static_cast<std::size_t>(k + kRadius)];
          std::size_t at = static_cast<std::size_t>((y + k) * width) * a.channels + channel;
          for (std::size_t x = 0; x < a.width; ++x, at += a.channels) {
            const double p = a.pixels[at] - shift, q = b.pixels[at] - shift;
            const std::array<double, kMoments> values{p, q, p * p, q * q, p * q};
            for (std::size_t i = 0; i < kMoments; ++i) columns[x][i] += weight * values[i];
          }
        }
        for (std::ptrdiff_t x = 0; x < width; ++x) {
          std::array<double, kMoments> moments{};
          for (std::ptrdiff_t k = std::max(-kRadius, -x); k <= std::min(kRadius, width - 1 - x); ++k) {
            const double weight = across[static_cast<std::size_t>(x)][static_cast<std::size_t>(k + kRadius)];
            for (std::size_t i = 0; i < kMoments; ++i)
              moments[i] += weight * columns[static_cast<std::size_t>(x + k)][i];
          }
          total[static_cast<std::size_t>(y * width + x)] += similarity(moments, shift);
        }
      }
    });
  }
  std::vector<float> map(total.size());
  const double channels = a.colors();
  std::transform(total.begin(), total.end(), map.begin(),
                 [&](double sum) { return static_cast<float>(sum / channels); });
  return map;
}

}  // namespace heddle::compare
