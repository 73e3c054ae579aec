// SPDX-License-Identifier: Apache-2.0
// Number of a sample -> where in its pixel it is taken. README equations (1) to (5).
#pragma once

#include "pixel_filter.hpp"
#include "point_sequences.hpp"

namespace supersampled {

using sampling::Filter;
using sampling::Point;

enum class Sequence : std::uint32_t { kR2, kHalton, kRandom };

inline Point unit_point(Sequence sequence, std::uint32_t index) {
  return sequence == Sequence::kR2       ? sampling::r2_point(index)
         : sequence == Sequence::kHalton ? sampling::halton_point(index)
                                         : sampling::random_point(index);
}

/// Where sample `index` is taken, in pixels from the centre, x to the right, y down.
inline Point sample_offset(Sequence sequence, Filter filter, std::uint32_t index) {
  const Point u = unit_point(sequence, index);
  return {sampling::filter_offset(filter, u[0]), sampling::filter_offset(filter, u[1])};
}

}  // namespace supersampled
