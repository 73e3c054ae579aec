// SPDX-License-Identifier: Apache-2.0
#include "view/knob.hpp"

#include <algorithm>
#include <cmath>

namespace heddle::view {

namespace {

// How near to a step of the ladder, in steps, the slider is drawn to it.
constexpr double kDetent = 0.15;
constexpr double kDigits = 3;
// Ranges that say "any length" are no help: a slider then covers this many times the default, and a field the rest.
constexpr double kMuch = 100, kMany = 4;

}  // namespace

Track::Track(const Json& parameter) : is_integer_(parameter.at("type") == "int") {
  const double minimum = parameter.at("minimum").get<double>(), maximum = parameter.at("maximum").get<double>();
  const Json& by_default = parameter.at("default");
  const double middle = (by_default.is_array() ? by_default.at(0) : by_default).get<double>();
  for (const Json& step : parameter.value("ladder", Json::array())) ladder_.push_back(step.get<double>());
  low_ = minimum;
  high_ = maximum;
  if (middle > 0 && minimum >= 0 && maximum > kMuch * middle) {
    is_logarithmic_ = minimum > 0;
    low_ = is_logarithmic_ ? std::max(minimum, middle / kMuch) : minimum;
    high_ = std::min(maximum, (is_logarithmic_ ? kMuch : kMany) * middle);
  }
}

double Track::rounded(double value) const {
  if (is_integer_) return std::round(value);
  // A pixel of a slider is worth no more digits than these.
  if (value == 0) return 0;
  const double unit = std::pow(10.0, kDigits - 1 - std::floor(std::log10(std::abs(value))));
  return std::clamp(std::round(value * unit) / unit, std::min(low_, high_), std::max(low_, high_));
}

double Track::between(double a, double b, double t) const {
  return a > 0 && b > 0 && (is_logarithmic_ || ladder_.size() > 1) ? a * std::pow(b / a, t) : a + (b - a) * t;
}

double Track::position_of(double value) const {
  const auto part = [&](double a, double b) {
    const bool is_by_factors = a > 0 && b > 0 && value > 0 && (is_logarithmic_ || ladder_.size() > 1);
    return is_by_factors ? std::log(value / a) / std::log(b / a) : (value - a) / (b - a);
  };
  if (ladder_.size() < 2) return high_ > low_ ? std::clamp(part(low_, high_), 0.0, 1.0) : 0.0;
  for (std::size_t i = 0; i < ladder_.size(); ++i)
    if (value == ladder_[i]) return static_cast<double>(i);
  for (std::size_t i = 0; i + 1 < ladder_.size(); ++i) {
    const auto [low, high] = std::minmax(ladder_[i], ladder_[i + 1]);
    if (value > low && value < high) return static_cast<double>(i) + part(ladder_[i], ladder_[i + 1]);
  }
  const bool is_beyond_first = (value < ladder_.front()) == (ladder_.front() < ladder_.back());
  return is_beyond_first ? 0.0 : end();
}

double Track::value_at(double position) const {
  position = std::clamp(position, 0.0, end());
  if (ladder_.size() < 2) return rounded(between(low_, high_, position));
  const double nearest = std::round(position);
  if (std::abs(position - nearest) <= kDetent) return ladder_[static_cast<std::size_t>(nearest)];
  const auto step = static_cast<std::size_t>(position);
  return rounded(between(ladder_[step], ladder_[step + 1], position - static_cast<double>(step)));
}

std::string setting_text(const Json& value) {
  return write_json(value);
}

}  // namespace heddle::view
