// SPDX-License-Identifier: Apache-2.0
#include "compare/compare.hpp"

#include "compare/metrics.hpp"
#include "compare/ssim.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace heddle::compare {
namespace {

/// What values a metric's error image holds.
enum class MapKind : std::uint8_t { kMagnitude, kSquare, kRelativeSquare, kDifference, kOwn };

struct MetricInfo {
  std::string_view name, formula, map;
  MapKind kind;
  bool is_higher_better = false;
  bool is_usual = true;  // computed if nobody names any
};

constexpr std::string_view kMagnitudeMap = "|a-b|";
// Over all values of all pixels, a against the reference b, unless it says otherwise.
constexpr std::array<MetricInfo, 11> kMetrics{{
    {"mse", "mean (a-b)^2", "(a-b)^2", MapKind::kSquare},
    {"rmse", "sqrt(mean (a-b)^2)", kMagnitudeMap, MapKind::kMagnitude},
    {"relmse", "mean (a-b)^2 / (b^2 + 0.01)", "(a-b)^2 / (b^2 + 0.01)", MapKind::kRelativeSquare},
    {"psnr", "10 log10(1 / mse), dB", kMagnitudeMap, MapKind::kMagnitude, true},
    {"ssim", "mean (2 m_a m_b + C1)(2 s_ab + C2) / ((m_a^2 + m_b^2 + C1)(s_a^2 + s_b^2 + C2)), Gauss 1.5 px, L = 1",
     "1 - SSIM", MapKind::kOwn, true},
    {"mean_difference", "mean (a-b)", "a-b", MapKind::kDifference},
    {"maximum", "max |a-b|", kMagnitudeMap, MapKind::kMagnitude},
    {"percentile_P", "P-th percentile of |a-b|, nearest rank", kMagnitudeMap, MapKind::kMagnitude},
    {"differing_pixels", "pixels with a != b", kMagnitudeMap, MapKind::kMagnitude},
    {"flip", "mean LDR-FLIP of values encoded as sRGB, 0..1", "FLIP", MapKind::kOwn, false, false},
    {"hdr_flip", "mean HDR-FLIP of linear values: largest over exposures", "HDR-FLIP", MapKind::kOwn, false, false},
}};
constexpr std::array<std::string_view, 3> kUsualPercentiles{"percentile_50", "percentile_95", "percentile_99"};
constexpr std::string_view kPercentile = "percentile_";
constexpr std::array<std::string_view, 3> kToneMapperNames{"aces", "hable", "reinhard"};

/// A metric as asked for.
struct Asked {
  const MetricInfo* info;
  std::string name;
  double percent = 0;  // of percentile_P
};

Asked ask(const std::string& name) {
  const auto info = [](std::string_view wanted) {
    return std::find_if(kMetrics.begin(), kMetrics.end(),
                        [&](const MetricInfo& metric) { return metric.name == wanted; });
  };
  if (name.starts_with(kPercentile)) {
    double percent = 0;
    const char* const end = name.data() + name.size();
    const auto [parsed, error] = std::from_chars(name.data() + kPercentile.size(), end, percent);
    if (error == std::errc() && parsed == end && percent > 0 && percent <= 100)
      return {info("percentile_P"), name, percent};
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             {},
                                             fmt::format("'{}' is no percentile", name),
                                             "",
                                             "a number above 0, at most 100, as in percentile_99.9",
                                             ""});
  }
  if (const auto found = info(name); found != kMetrics.end()) return {found, name};
  std::vector<std::string> names;
  names.reserve(kMetrics.size());
  for (const MetricInfo& metric : kMetrics) names.emplace_back(metric.name);
  const std::string nearest = nearest_name(name, names);
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                           {},
                                           fmt::format("there is no metric '{}'", name),
                                           "",
                                           fmt::format("one of {}", join_names(names)),
                                           nearest.empty() ? "" : fmt::format("did you mean '{}'?", nearest)});
}

std::vector<Asked> ask_all(const std::vector<std::string>& names) {
  std::vector<Asked> asked;
  asked.reserve(names.size());
  for (const std::string& name : names) asked.push_back(ask(name));
  if (!asked.empty()) return asked;
  for (const MetricInfo& metric : kMetrics) {
    if (metric.name == "percentile_P") {
      for (const std::string_view name : kUsualPercentiles) asked.push_back(ask(std::string(name)));
    } else if (metric.is_usual) {
      asked.push_back({&metric, std::string(metric.name)});
    }
  }
  return asked;
}

void check_options(const Options& options) {
  const auto fail = [](std::string message, std::string found, std::string expected) {
    throw Error(HEDDLE_BAD_INPUT,
                Diagnostic{Severity::kError, {}, std::move(message), std::move(found), std::move(expected), ""});
  };
  // Beyond it the filters are wider than any picture; below it they are narrower than a pixel can show.
  if (!(options.pixels_per_degree >= 1 && options.pixels_per_degree <= 1000)) {
    fail("FLIP's viewing conditions make no sense", fmt::format("{:g} pixels per degree", options.pixels_per_degree),
         "1 to 1000");
  }
  if (static_cast<std::uint32_t>(options.tone_mapper) >= kToneMapperNames.size()) {
    fail("unknown tone mapper", fmt::format("{}", static_cast<std::uint32_t>(options.tone_mapper)),
         "0 (ACES), 1 (Hable) or 2 (Reinhard)");
  }
  if (!options.exposures) return;
  const auto [start, stop, count] = *options.exposures;
  if (!(start >= -100 && stop <= 100 && start <= stop) || count < 1 || count > 1000 || (count == 1 && start != stop)) {
    fail("HDR-FLIP's exposures make no sense", fmt::format("{:g} to {:g} stops, {} of them", start, stop, count),
         "-100 <= start <= stop <= 100, and 1 to 1000 of them; one only where start is stop");
  }
}

image::Image map_of(MapKind kind, const Picture& a, const Picture& b) {
  image::Image map{a.width, a.height, a.channels, std::vector<float>(a.pixels.size())};
  std::transform(a.pixels.begin(), a.pixels.end(), b.pixels.begin(), map.pixels.begin(), [&](float left, float right) {
    const double difference = double{left} - right, square = difference * difference;
    const double value = kind == MapKind::kMagnitude        ? std::abs(difference)
                         : kind == MapKind::kSquare         ? square
                         : kind == MapKind::kRelativeSquare ? square / (double{right} * right + kRelativeEpsilon)
                                                            : difference;
    return static_cast<float>(value);
  });
  return map;
}

double mean_of(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

/// What the pair is asked for, each thing computed once.
class Pair {
 public:
  Pair(const Picture& a, const Picture& b, const Options& options) : a_(a), b_(b), options_(options) {}

  const Metrics& metrics() {
    if (!metrics_) metrics_ = measure(a_, b_);
    return *metrics_;
  }
  const std::vector<float>& own_map(std::string_view name) {
    std::vector<float>& map = maps_[std::string(name)];
    if (!map.empty()) return map;
    if (name == "ssim") {
      map = ssim(a_, b_, options_.threads);
    } else if (name == "flip") {
      map = flip(a_, b_, options_.pixels_per_degree, options_.threads);
    } else {
      map = hdr_flip(a_, b_, options_.pixels_per_degree, exposures(), options_.tone_mapper, options_.threads);
    }
    return map;
  }
  Exposures exposures() {
    if (!exposures_) exposures_ = options_.exposures ? *options_.exposures : exposures_of(b_, options_.tone_mapper);
    return *exposures_;
  }
  Json describe(const Asked& asked);
  image::Image map(const Asked& asked);

 private:
  const Picture& a_;
  const Picture& b_;
  const Options& options_;
  std::optional<Metrics> metrics_;
  std::optional<Exposures> exposures_;
  std::map<std::string, std::vector<float>> maps_;
};

Json Pair::describe(const Asked& asked) {
  const std::string_view name = asked.info->name;
  Json json{{"value", nullptr},
            {"formula", asked.info->formula},
            {"better", asked.info->is_higher_better ? "higher" : "lower"}};
  const auto set = [&](double value) {
    if (std::isfinite(value)) json["value"] = value;
  };
  if (asked.info->kind == MapKind::kOwn) {
    set(mean_of(own_map(name)));
    if (name != "ssim") json["pixels_per_degree"] = options_.pixels_per_degree;
    if (name == "hdr_flip") {
      json["start_exposure"] = exposures().start;
      json["stop_exposure"] = exposures().stop;
      json["exposures"] = exposures().count;
      json["tone_mapper"] = kToneMapperNames[static_cast<std::size_t>(options_.tone_mapper)];
    }
    return json;
  }
  if (asked.percent > 0) {
    set(percentile(a_, b_, asked.percent));
    return json;
  }
  const Metrics& m = metrics();
  if (name == "differing_pixels") {
    json["value"] = m.differing_pixels;
    return json;
  }
  set(name == "mse"               ? m.mse
      : name == "rmse"            ? m.rmse
      : name == "relmse"          ? m.relmse
      : name == "psnr"            ? m.psnr
      : name == "mean_difference" ? m.mean_difference
                                  : m.maximum);
  if (name == "maximum") {
    json["pixel"] = {m.maximum_x, m.maximum_y};
    json["channel"] = m.maximum_channel;
  }
  return json;
}

image::Image Pair::map(const Asked& asked) {
  if (asked.info->kind != MapKind::kOwn) return map_of(asked.info->kind, a_, b_);
  image::Image map{a_.width, a_.height, 1, own_map(asked.info->name)};
  if (asked.info->name == "ssim") {
    for (float& value : map.pixels) value = 1.0F - value;
  }
  return map;
}

}  // namespace

Comparison compare(const Picture& a, const Picture& b, const Options& options) {
  const std::vector<Asked> asked = ask_all(options.metrics);
  check_options(options);
  check_pair(a, b);
  Pair pair(a, b, options);
  Comparison comparison;
  Json json{{"width", a.width}, {"height", a.height}, {"channels", a.channels}, {"metrics", Json::object()}};
  for (const Asked& metric : asked) {
    json["metrics"][metric.name] = pair.describe(metric);
    if (options.keeps_maps) comparison.maps[metric.name] = pair.map(metric);
  }
  comparison.json = write_json(json);
  return comparison;
}

const std::string& metrics_json() {
  static const std::string text = [] {
    Json json = Json::array();
    for (const MetricInfo& metric : kMetrics) {
      json.push_back({{"name", metric.name},
                      {"formula", metric.formula},
                      {"better", metric.is_higher_better ? "higher" : "lower"},
                      {"map", metric.map}});
    }
    return write_json(json);
  }();
  return text;
}

image::Image false_colors(const image::Image& map, double white) {
  // sRGB; CIE lightness 0, 17, 36, 57, 80, 100 by construction: each is about as much lighter than the one before.
  constexpr std::array<std::array<float, 3>, 6> kRamp{{{0.0F, 0.0F, 0.0F},
                                                       {0.22F, 0.07F, 0.45F},
                                                       {0.66F, 0.13F, 0.36F},
                                                       {0.93F, 0.42F, 0.13F},
                                                       {0.97F, 0.79F, 0.20F},
                                                       {1.0F, 1.0F, 1.0F}}};
  image::Image colors{map.width, map.height, 3, {}};
  colors.pixels.reserve(std::size_t{map.width} * map.height * 3);
  for (std::size_t i = 0; i < map.pixels.size(); i += map.channels) {
    float largest = 0;
    for (std::size_t k = 0; k < map.channels; ++k) largest = std::max(largest, std::abs(map.pixels[i + k]));
    const double part = white > 0 ? std::min(largest / white, 1.0) : 0.0;
    const double place = part * static_cast<double>(kRamp.size() - 1);
    const auto first = std::min(static_cast<std::size_t>(place), kRamp.size() - 2);
    const auto t = static_cast<float>(place - static_cast<double>(first));
    for (std::size_t k = 0; k < 3; ++k) colors.pixels.push_back((1.0F - t) * kRamp[first][k] + t * kRamp[first + 1][k]);
  }
  return colors;
}

}  // namespace heddle::compare
