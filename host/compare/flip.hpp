// SPDX-License-Identifier: Apache-2.0
// FLIP: how different two pictures look when one flips between them, 0 to 1 a pixel.
// Source  Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom and Fairchild 2020, "FLIP: A Difference Evaluator for
//         Alternating Images"; Andersson, Nilsson, Shirley and Akenine-Moller 2021, "Visualizing Errors in Rendered
//         High Dynamic Range Images"
#pragma once

#include "compare/picture.hpp"

#include <numbers>

namespace heddle::compare {

/// A display 3840 pixels and 0.7 m wide, seen from 0.7 m: the papers' viewing conditions.
constexpr double kPixelsPerDegree = 3840.0 * std::numbers::pi / 180.0;

enum class ToneMapper : std::uint32_t { kAces, kHable, kReinhard };

struct Exposures {
  double start = 0, stop = 0;  // stops: radiance is multiplied by 2^exposure
  std::uint32_t count = 0;     // at least 1; evenly from start to stop
};

/// Both display-referred: values encoded as sRGB, 0 to 1 (others are clamped), as in 8-bit files. One or three colours;
/// alpha is left out. `map` is one value a pixel. The pair must be checked. Throws Error for two colours.
std::vector<float> flip(const Picture& a, const Picture& b, double pixels_per_degree, std::uint32_t threads);

/// Both scene-referred: linear Rec.709 radiance; negative values count as 0. For each pixel the largest FLIP over the
/// exposures, each tone-mapped by `tone_mapper`.
std::vector<float> hdr_flip(const Picture& a, const Picture& b, double pixels_per_degree, const Exposures& exposures,
                            ToneMapper tone_mapper, std::uint32_t threads);

/// The paper's exposures for a reference: the brightest pixel's luminance comes out as 0.85 at the first, the median
/// one at the last, and at least two of them, a stop or less apart. Where the median is 0 the paper has no answer; it
/// is then the median of those luminances that are not 0, and of a black reference the exposure is 0.
Exposures exposures_of(const Picture& reference, ToneMapper tone_mapper);

}  // namespace heddle::compare
