// SPDX-License-Identifier: Apache-2.0
// Metrics by their names: which there are, with their formulas; the values of a pair of pictures; error images.
#pragma once

#include "compare/flip.hpp"

#include <map>
#include <optional>
#include <string>

namespace heddle::compare {

struct Options {
  std::vector<std::string> metrics;  // names; empty: all but those that must know how values are encoded (FLIP)
  double pixels_per_degree = kPixelsPerDegree;
  std::optional<Exposures> exposures;  // of hdr_flip; nothing: the paper's, from the reference
  ToneMapper tone_mapper = ToneMapper::kAces;
  std::uint32_t threads = 0;  // 0: one a processor; bits do not depend on it
  bool keeps_maps = false;
};

struct Comparison {
  std::string json;                          // see heddle_comparison_describe
  std::map<std::string, image::Image> maps;  // by metric, if they were asked for
};

/// b is the reference. Throws Error(HEDDLE_BAD_INPUT) for what check_pair refuses, an unknown metric, viewing
/// conditions or exposures that make no sense, and colours that a metric does not know.
Comparison compare(const Picture& a, const Picture& b, const Options& options);

/// [{"name", "formula", "better": "lower" or "higher", "map": what a pixel of its error image is}] as JSON, in the
/// order in which they are computed.
const std::string& metrics_json();

/// A map of one channel or more for the eye: each pixel's largest channel as a part of `white`, through a ramp whose
/// lightness grows all along: black, violet, red, orange, yellow, white.
image::Image false_colors(const image::Image& map, double white);

}  // namespace heddle::compare
