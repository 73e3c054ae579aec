// SPDX-License-Identifier: Apache-2.0
// The structural similarity of two pictures.
// Source  Wang, Bovik, Sheikh and Simoncelli 2004, "Image Quality Assessment: From Error Visibility to Structural
// Similarity"
#pragma once

#include "compare/picture.hpp"

namespace heddle::compare {

/// Mean over colour channels, a value a pixel: (2 mu_a mu_b + C1)(2 s_ab + C2) / ((mu_a^2 + mu_b^2 + C1)(s_a^2 + s_b^2
/// + C2)), equation (13), with C1 = 0.01^2 and C2 = 0.03^2 (values of 0 to 1), and means under a Gaussian of
/// deviation 1.5 in 11 x 11 pixels. At the borders the window is what lies within, its weights adding up to 1. Alpha is
/// left out. Float64 throughout. The pair must be checked.
std::vector<float> ssim(const Picture& a, const Picture& b, std::uint32_t threads);

}  // namespace heddle::compare
