// SPDX-License-Identifier: Apache-2.0
// Both pictures -> linear RGB -> an opponent space -> filtered as the eye does, and for edges and points -> difference.
// Equation numbers are those of Andersson et al. 2020. All filters are separable: each is a product of two filters of
// one dimension, or (blue against yellow) the sum of two such products. Rows are filtered along x as they are needed,
// and kept for as long as the filter along y reaches. Loops run over 16 pixels at a time, so that compilers vectorize
// them.
#include "compare/flip.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace heddle::compare {
namespace {

using Matrix = std::array<std::array<double, 3>, 3>;

constexpr std::size_t kBlock = 16;

// ---- Constants of the paper ----
constexpr double kColorExponent = 0.7;              // q_c, equation (9)
constexpr double kColorKnee = 0.4, kKneeAt = 0.95;  // p_c and p_t, equation (10)
constexpr double kFeatureWidth = 0.082;             // w, degrees, section 4.2
// Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b) of the contrast sensitivity, table 1: achromatic, red-green, blue-yellow.
struct Sensitivity {
  double a, b;
};
constexpr Sensitivity kAchromatic{1.0, 0.0047}, kRedGreen{1.0, 0.0053};
constexpr std::array<Sensitivity, 2> kBlueYellow{{{34.1, 0.04}, {13.5, 0.025}}};

// ---- Colour: (x, y, z) is CIE XYZ as a part of the white ----
Matrix inverse(const Matrix& m) {
  Matrix cofactor{};
  double determinant = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      cofactor[i][j] = m[i1][j1] * m[i2][j2] - m[i1][j2] * m[i2][j1];
      if (i == 0) determinant += m[i][j] * cofactor[i][j];
    }
  }
  Matrix result{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) result[i][j] = cofactor[j][i] / determinant;
  }
  return result;
}

/// Linear RGB -> XYZ as a part of the white, from the chromaticities of sRGB (IEC 61966-2-1); the white in five digits,
/// as the authors' own program has it.
Matrix white_from_rgb() {
  constexpr std::array<std::array<double, 2>, 3> kPrimaries{{{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}}};
  constexpr std::array<double, 2> kWhite{0.31271, 0.32902};
  const auto xyz = [](const std::array<double, 2>& c) {
    return std::array<double, 3>{c[0] / c[1], 1.0, (1.0 - c[0] - c[1]) / c[1]};
  };
  Matrix m{};
  for (std::size_t j = 0; j < 3; ++j) {
    const auto primary = xyz(kPrimaries[j]);
    for (std::size_t i = 0; i < 3; ++i) m[i][j] = primary[i];
  }
  const Matrix inverted = inverse(m);
  const auto white = xyz(kWhite);
  for (std::size_t j = 0; j < 3; ++j) {
    double scale = 0;
    for (std::size_t i = 0; i < 3; ++i) scale += inverted[j][i] * white[i];
    for (std::size_t i = 0; i < 3; ++i) m[i][j] *= scale / white[i];
  }
  return m;
}

/// L, a, b with Hunt's effect (equation 6), in float64: for the largest distance alone.
std::array<double, 3> hunted_lab(const Matrix& white, std::size_t primary) {
  std::array<double, 3> f{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double t = white[i][primary];
    f[i] = t > 216.0 / 24389.0 ? std::cbrt(t) : t * 841.0 / 108.0 + 4.0 / 29.0;
  }
  const double lightness = 116.0 * f[1] - 16.0;
  return {lightness, 0.01 * lightness * 500.0 * (f[0] - f[1]), 0.01 * lightness * 200.0 * (f[1] - f[2])};
}

// ---- float32 functions that vectorize; relative error below 1e-6 where FLIP uses them ----
/// log2 of a positive normal number; -126 for all that is smaller.
inline float fast_log2(float x) {
  const auto bits = std::bit_cast<std::int32_t>(x > 1.17549435e-38F ? x : 1.17549435e-38F);
  // Mantissa in sqrt(1/2) .. sqrt(2), so that log2 is 0 at 1 without cancellation.
  const std::int32_t exponent = (bits - 0x3f3504f3) >> 23;
  const float m = std::bit_cast<float>(bits - (exponent << 23));
  // log2 m = 2 / ln 2 atanh(s), s = (m - 1) / (m + 1), |s| < 0.1716: the next term is below 1e-9.
  const float s = (m - 1.0F) / (m + 1.0F), s2 = s * s;
  const float series = 1.0F + s2 * (1.0F / 3.0F + s2 * (0.2F + s2 * (1.0F / 7.0F + s2 * (1.0F / 9.0F))));
  return static_cast<float>(exponent) + 2.885390081777927F * s * series;
}

/// 2^x for x of at least -126 and at most 126.
inline float fast_exp2(float x) {
  const float shifted = x + 12582912.0F;  // 1.5 * 2^23: rounds to the nearest integer
  const float whole = shifted - 12582912.0F;
  const float t = 0.6931471805599453F * (x - whole);  // |t| < 0.347: Taylor's next term is below 1e-9
  const float series =
      1.0F +
      t * (1.0F + t * (0.5F + t * (1.0F / 6.0F + t * (1.0F / 24.0F + t * (1.0F / 120.0F + t * (1.0F / 720.0F))))));
  const std::int32_t exponent = static_cast<std::int32_t>(whole);
  return std::bit_cast<float>(std::bit_cast<std::int32_t>(series) + (exponent << 23));
}

/// x^p for x >= 0 and p > 0; 0 where it is below the smallest normal number.
inline float fast_pow(float x, float p) {
  const float y = p * fast_log2(x);
  return x > 0.0F && y > -126.0F ? fast_exp2(y) : 0.0F;
}

inline float clamp01(float x) {
  return std::min(std::max(x, 0.0F), 1.0F);
}

// ---- Filters ----
struct Kernel {
  std::ptrdiff_t radius = 0;
  std::vector<float> weights;  // 2 radius + 1
};

/// Without weights at the ends that float32 sums cannot see.
Kernel kernel_of(const std::vector<double>& weights) {
  double largest = 0;
  for (const double weight : weights) largest = std::max(largest, std::abs(weight));
  std::size_t cut = 0;
  const auto is_small = [&](double weight) { return std::abs(weight) < 1e-10 * largest; };
  while (cut < weights.size() / 2 && is_small(weights[cut]) && is_small(weights[weights.size() - 1 - cut])) ++cut;
  Kernel kernel;
  kernel.radius = static_cast<std::ptrdiff_t>(weights.size() / 2 - cut);
  for (std::size_t i = cut; i + cut < weights.size(); ++i) kernel.weights.push_back(static_cast<float>(weights[i]));
  return kernel;
}

struct Filters {
  Kernel achromatic, red_green;
  std::array<Kernel, 2> blue_yellow;
  Kernel smooth, edge, point;  // a Gaussian, its first and its second derivative
  std::ptrdiff_t radius = 0;   // the largest
};

Filters make_filters(double pixels_per_degree) {
  constexpr double kPi = std::numbers::pi;
  // Section 4.1: three standard deviations of the widest.
  const auto radius =
      static_cast<std::ptrdiff_t>(std::ceil(3.0 * std::sqrt(kBlueYellow[0].b / (2.0 * kPi * kPi)) * pixels_per_degree));
  // `root`: of the factor before the exponential, so that the product of two along x and y has the whole.
  const auto gaussian = [&](const Sensitivity& s, bool root) {
    std::vector<double> weights;
    const double scale = s.a * std::sqrt(kPi / s.b);
    for (std::ptrdiff_t i = -radius; i <= radius; ++i) {
      const double x = static_cast<double>(i) / pixels_per_degree;
      weights.push_back((root ? std::sqrt(scale) : scale) * std::exp(-kPi * kPi * x * x / s.b));
    }
    return weights;
  };
  const auto sum = [](const std::vector<double>& weights) {
    double total = 0;
    for (const double weight : weights) total += weight;
    return total;
  };
  const auto scaled = [](std::vector<double> weights, double factor) {
    for (double& weight : weights) weight *= factor;
    return kernel_of(weights);
  };
  Filters filters;
  const std::vector<double> achromatic = gaussian(kAchromatic, false), red_green = gaussian(kRedGreen, false);
  filters.achromatic = scaled(achromatic, 1.0 / sum(achromatic));
  filters.red_green = scaled(red_green, 1.0 / sum(red_green));
  const std::array blue_yellow{gaussian(kBlueYellow[0], true), gaussian(kBlueYellow[1], true)};
  const double norm = std::hypot(sum(blue_yellow[0]), sum(blue_yellow[1]));
  for (std::size_t i = 0; i < 2; ++i) filters.blue_yellow[i] = scaled(blue_yellow[i], 1.0 / norm);

  // Section 4.2: positive and negative weights of a derivative each add up to 1.
  const double deviation = 0.5 * kFeatureWidth * pixels_per_degree;
  const auto feature_radius = static_cast<std::ptrdiff_t>(std::ceil(3.0 * deviation));
  std::array<std::vector<double>, 3> features;
  for (std::ptrdiff_t i = -feature_radius; i <= feature_radius; ++i) {
    const auto x = static_cast<double>(i);
    const double g = std::exp(-x * x / (2.0 * deviation * deviation));
    features[0].push_back(g);
    features[1].push_back(-x * g);
    features[2].push_back((x * x / (deviation * deviation) - 1.0) * g);
  }
  for (std::vector<double>& weights : features) {
    double positive = 0, negative = 0;
    for (const double weight : weights) (weight > 0 ? positive : negative) += std::abs(weight);
    for (double& weight : weights) weight /= weight > 0 ? positive : std::max(negative, 1e-300);
  }
  filters.smooth = kernel_of(features[0]);
  filters.edge = kernel_of(features[1]);
  filters.point = kernel_of(features[2]);
  filters.radius = std::max(radius, feature_radius);
  return filters;
}

/// out[x] = sum of weights[k] * source[x + k], for whole blocks.
void filter_along_x(const Kernel& kernel, const float* source, float* out, std::size_t blocks) {
  for (std::size_t block = 0; block < blocks; ++block, source += kBlock, out += kBlock) {
    std::array<float, kBlock> sum{};
    for (std::size_t k = 0; k < kernel.weights.size(); ++k) {
      const float weight = kernel.weights[k];
      for (std::size_t i = 0; i < kBlock; ++i) sum[i] += weight * source[k + i];
    }
    std::copy(sum.begin(), sum.end(), out);
  }
}

/// sum[i] = sum of weights[k] * rows[k][x + i]; rows[0] belongs to the first weight.
inline std::array<float, kBlock> filter_along_y(const Kernel& kernel, const float* const* rows, std::size_t x) {
  std::array<float, kBlock> sum{};
  for (std::size_t k = 0; k < kernel.weights.size(); ++k) {
    const float weight = kernel.weights[k];
    const float* row = rows[k] + x;
    for (std::size_t i = 0; i < kBlock; ++i) sum[i] += weight * row[i];
  }
  return sum;
}

/// What is kept of a picture's row after filtering along x.
enum Plane : std::size_t { kY, kCx, kCzWide, kCzNarrow, kSmooth, kEdge, kPoint, kPlaneCount };

/// What the difference needs, made once.
struct Setup {
  Filters filters;
  std::array<std::array<float, 3>, 3> white_from_rgb{}, rgb_from_white{};
  float largest = 0, knee = 0;  // c_max and p_c c_max of equation (10)

  explicit Setup(double pixels_per_degree) : filters(make_filters(pixels_per_degree)) {
    const Matrix forward = compare::white_from_rgb(), backward = inverse(forward);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        white_from_rgb[i][j] = static_cast<float>(forward[i][j]);
        rgb_from_white[i][j] = static_cast<float>(backward[i][j]);
      }
    }
    // The two colours of the RGB cube that HyAB sets farthest apart: green and blue.
    const auto green = hunted_lab(forward, 1), blue = hunted_lab(forward, 2);
    const double distance = std::abs(green[0] - blue[0]) + std::hypot(green[1] - blue[1], green[2] - blue[2]);
    largest = static_cast<float>(std::pow(distance, kColorExponent));
    knee = static_cast<float>(kColorKnee) * largest;
  }
};

/// sRGB -> linear (IEC 61966-2-1).
struct Decode {
  void operator()(float* r, float* g, float* b, std::size_t count) const {
    for (float* plane : {r, g, b}) {
      for (std::size_t i = 0; i < count; ++i) {
        const float value = clamp01(plane[i]);
        const float curve = fast_pow((value + 0.055F) * (1.0F / 1.055F), 2.4F);
        plane[i] = value <= 0.04045F ? value * (1.0F / 12.92F) : curve;
      }
    }
  }
};

/// (p[0] x^2 + p[1] x) / (p[2] x^2 + p[3] x + p[4]).
using Curve = std::array<double, 5>;
// ACES: Narkowicz 2015's fit with its exposure taken back; Hable 2010; both as in Andersson et al. 2021, section 4.
constexpr Curve kAcesCurve{0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14};
constexpr Curve kHableCurve{0.231683, 0.013791, 0.18, 0.3, 0.018};
constexpr Curve kReinhardCurve{0.0, 1.0, 0.0, 1.0, 1.0};  // of the luminance
constexpr std::array<float, 3> kLuminance{0.2126F, 0.7152F, 0.0722F};

const Curve& curve_of(ToneMapper tone_mapper) {
  return tone_mapper == ToneMapper::kAces    ? kAcesCurve
         : tone_mapper == ToneMapper::kHable ? kHableCurve
                                             : kReinhardCurve;
}

/// Linear radiance -> what a display shows of it.
struct Expose {
  float scale = 1;
  bool is_of_luminance = false;
  std::array<float, 5> p{};

  Expose(double exposure, ToneMapper tone_mapper)
      : scale(static_cast<float>(std::exp2(exposure))), is_of_luminance(tone_mapper == ToneMapper::kReinhard) {
    std::transform(curve_of(tone_mapper).begin(), curve_of(tone_mapper).end(), p.begin(),
                   [](double value) { return static_cast<float>(value); });
  }
  void operator()(float* r, float* g, float* b, std::size_t count) const {
    // Far beyond where every curve has come to its end, and squares stay finite.
    constexpr float kBright = 1e12F;
    for (float* plane : {r, g, b}) {
      for (std::size_t i = 0; i < count; ++i) {
        const float x = std::min(std::max(plane[i], 0.0F) * scale, kBright);
        plane[i] = is_of_luminance ? x : clamp01(x * (p[0] * x + p[1]) / (x * (p[2] * x + p[3]) + p[4]));
      }
    }
    if (!is_of_luminance) return;
    for (std::size_t i = 0; i < count; ++i) {
      const float share = 1.0F / (1.0F + kLuminance[0] * r[i] + kLuminance[1] * g[i] + kLuminance[2] * b[i]);
      r[i] = clamp01(r[i] * share);
      g[i] = clamp01(g[i] * share);
      b[i] = clamp01(b[i] * share);
    }
  }
};

/// One of the two pictures, row by row; the rows that the filter along y reaches stay.
template <class Display>
class FilteredRows {
 public:
  FilteredRows(const Picture& picture, const Setup& setup, const Display& display)
      : picture_(picture),
        setup_(setup),
        display_(display),
        blocks_((picture.width + kBlock - 1) / kBlock),
        margin_(static_cast<std::size_t>(setup.filters.radius)),
        kept_(2 * margin_ + 1),
        rows_(kept_ * kPlaneCount * blocks_ * kBlock),
        planes_(3 * padded_width()) {}

  [[nodiscard]] const float* row(std::ptrdiff_t y, Plane plane) const {
    return rows_.data() + ((static_cast<std::size_t>(y) % kept_) * kPlaneCount + plane) * blocks_ * kBlock;
  }

  void filter(std::size_t y) {
    const std::size_t width = picture_.width, channels = picture_.channels;
    std::array<float*, 3> p{};
    for (std::size_t i = 0; i < 3; ++i) p[i] = planes_.data() + i * padded_width();
    const float* source = picture_.pixels.data() + y * width * channels;
    const std::size_t step = picture_.colors() == 1 ? 0 : 1;  // gray: all three alike
    for (std::size_t x = 0; x < width; ++x) {
      for (std::size_t i = 0; i < 3; ++i) p[i][margin_ + x] = source[x * channels + i * step];
    }
    float *a = p[0] + margin_, *b = p[1] + margin_, *c = p[2] + margin_;
    display_(a, b, c, width);
    const auto& m = setup_.white_from_rgb;
    for (std::size_t x = 0; x < width; ++x) {
      const float u = m[0][0] * a[x] + m[0][1] * b[x] + m[0][2] * c[x];
      const float v = m[1][0] * a[x] + m[1][1] * b[x] + m[1][2] * c[x];
      const float w = m[2][0] * a[x] + m[2][1] * b[x] + m[2][2] * c[x];
      a[x] = v;      // (Y + 16) / 116 of YCxCz
      b[x] = u - v;  // Cx / 500
      c[x] = v - w;  // Cz / 200
    }
    for (float* plane : p) {  // beyond its borders a picture goes on as it ends
      std::fill_n(plane, margin_, plane[margin_]);
      std::fill(plane + margin_ + width, plane + padded_width(), plane[margin_ + width - 1]);
    }
    const Filters& f = setup_.filters;
    const auto along_x = [&](const Kernel& kernel, const float* plane, Plane to) {
      float* out = rows_.data() + ((y % kept_) * kPlaneCount + to) * blocks_ * kBlock;
      filter_along_x(kernel, plane + margin_ - static_cast<std::size_t>(kernel.radius), out, blocks_);
    };
    along_x(f.achromatic, p[0], kY);
    along_x(f.red_green, p[1], kCx);
    along_x(f.blue_yellow[0], p[2], kCzWide);
    along_x(f.blue_yellow[1], p[2], kCzNarrow);
    along_x(f.smooth, p[0], kSmooth);
    along_x(f.edge, p[0], kEdge);
    along_x(f.point, p[0], kPoint);
  }

 private:
  [[nodiscard]] std::size_t padded_width() const { return blocks_ * kBlock + 2 * margin_; }

  Picture picture_;
  const Setup& setup_;
  const Display& display_;
  std::size_t blocks_, margin_, kept_;
  std::vector<float> rows_, planes_;
};

/// A block of a picture as it is compared.
struct Seen {
  std::array<float, kBlock> lightness{}, a{}, b{};  // CIE Lab with Hunt's effect
  std::array<float, kBlock> edge{}, point{};        // lengths of the gradients
};

/// f of CIE Lab.
inline float lab_curve(float t) {
  const float root = fast_exp2(fast_log2(t) * (1.0F / 3.0F));
  return t > 216.0F / 24389.0F ? root : t * (841.0F / 108.0F) + 4.0F / 29.0F;
}

/// rows[plane][k]: filtered rows from `radius` above on.
using RowTable = std::array<std::vector<const float*>, kPlaneCount>;

Seen see(const Setup& setup, const RowTable& rows, std::size_t x) {
  const Filters& f = setup.filters;
  const auto along_y = [&](const Kernel& kernel, Plane plane) {
    return filter_along_y(kernel, rows[plane].data() + (f.radius - kernel.radius), x);
  };
  const auto y = along_y(f.achromatic, kY), cx = along_y(f.red_green, kCx);
  const auto wide = along_y(f.blue_yellow[0], kCzWide), narrow = along_y(f.blue_yellow[1], kCzNarrow);
  const auto dx = along_y(f.smooth, kEdge), dy = along_y(f.edge, kSmooth);
  const auto ddx = along_y(f.smooth, kPoint), ddy = along_y(f.point, kSmooth);
  const auto &in = setup.rgb_from_white, &out = setup.white_from_rgb;
  Seen seen;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const float u = y[i] + cx[i], v = y[i], w = y[i] - (wide[i] + narrow[i]);
    const float r = clamp01(in[0][0] * u + in[0][1] * v + in[0][2] * w);
    const float g = clamp01(in[1][0] * u + in[1][1] * v + in[1][2] * w);
    const float b = clamp01(in[2][0] * u + in[2][1] * v + in[2][2] * w);
    const float fx = lab_curve(out[0][0] * r + out[0][1] * g + out[0][2] * b);
    const float fy = lab_curve(out[1][0] * r + out[1][1] * g + out[1][2] * b);
    const float fz = lab_curve(out[2][0] * r + out[2][1] * g + out[2][2] * b);
    const float lightness = 116.0F * fy - 16.0F;
    seen.lightness[i] = lightness;
    seen.a[i] = 0.01F * lightness * 500.0F * (fx - fy);
    seen.b[i] = 0.01F * lightness * 200.0F * (fy - fz);
    seen.edge[i] = std::sqrt(dx[i] * dx[i] + dy[i] * dy[i]);
    seen.point[i] = std::sqrt(ddx[i] * ddx[i] + ddy[i] * ddy[i]);
  }
  return seen;
}

/// FLIP of a block.
std::array<float, kBlock> difference_of(const Setup& setup, const Seen& one, const Seen& other) {
  constexpr auto kExponent = static_cast<float>(kColorExponent), kTop = static_cast<float>(kKneeAt);
  const float below = kTop / setup.knee, above = (1.0F - kTop) / (setup.largest - setup.knee);
  std::array<float, kBlock> result{};
  for (std::size_t i = 0; i < kBlock; ++i) {
    const float da = one.a[i] - other.a[i], db = one.b[i] - other.b[i];
    // HyAB, equation (7), then (9) and (10).
    const float distance = std::abs(one.lightness[i] - other.lightness[i]) + std::sqrt(da * da + db * db);
    const float power = fast_pow(distance, kExponent);
    const float color = power < setup.knee ? power * below : kTop + (power - setup.knee) * above;
    // Equation (12): edges and points, whichever differ more; its exponent q_f is 1/2.
    const float feature = std::max(std::abs(one.edge[i] - other.edge[i]), std::abs(one.point[i] - other.point[i]));
    const float shown = std::sqrt(feature * static_cast<float>(std::numbers::sqrt2 / 2.0));
    result[i] = fast_pow(color, 1.0F - shown);  // equation (13)
  }
  return result;
}

/// map = max(map, FLIP of what the display shows of the two).
template <class Display>
void raise_to_flip(const Picture& a, const Picture& b, const Setup& setup, const Display& display,
                   std::uint32_t threads, std::vector<float>& map) {
  for_rows(a.height, threads, [&](std::uint32_t first, std::uint32_t last) {
    std::array<FilteredRows<Display>, 2> sources{{{a, setup, display}, {b, setup, display}}};
    const std::ptrdiff_t radius = setup.filters.radius, bottom = static_cast<std::ptrdiff_t>(a.height) - 1;
    std::ptrdiff_t next = std::max<std::ptrdiff_t>(0, static_cast<std::ptrdiff_t>(first) - radius);
    std::array<RowTable, 2> tables;
    for (RowTable& table : tables) {
      for (auto& rows : table) rows.resize(static_cast<std::size_t>(2 * radius + 1));
    }
    for (std::ptrdiff_t y = first; y < static_cast<std::ptrdiff_t>(last); ++y) {
      for (; next <= std::min(bottom, y + radius); ++next) {
        for (auto& source : sources) source.filter(static_cast<std::size_t>(next));
      }
      for (std::size_t which = 0; which < 2; ++which) {
        for (std::size_t plane = 0; plane < kPlaneCount; ++plane) {
          for (std::ptrdiff_t k = -radius; k <= radius; ++k) {
            tables[which][plane][static_cast<std::size_t>(k + radius)] =
                sources[which].row(std::clamp<std::ptrdiff_t>(y + k, 0, bottom), static_cast<Plane>(plane));
          }
        }
      }
      float* out = map.data() + static_cast<std::size_t>(y) * a.width;
      for (std::size_t x = 0; x < a.width; x += kBlock) {
        const auto found = difference_of(setup, see(setup, tables[0], x), see(setup, tables[1], x));
        const std::size_t count = std::min<std::size_t>(kBlock, a.width - x);
        for (std::size_t i = 0; i < count; ++i) out[x + i] = std::max(out[x + i], found[i]);
      }
    }
  });
}

}  // namespace

std::vector<float> flip(const Picture& a, const Picture& b, double pixels_per_degree, std::uint32_t threads) {
  check_colors(a, "flip");
  std::vector<float> map(std::size_t{a.width} * a.height, 0.0F);
  raise_to_flip(a, b, Setup(pixels_per_degree), Decode{}, threads, map);
  return map;
}

std::vector<float> hdr_flip(const Picture& a, const Picture& b, double pixels_per_degree, const Exposures& exposures,
                            ToneMapper tone_mapper, std::uint32_t threads) {
  check_colors(a, "hdr_flip");
  std::vector<float> map(std::size_t{a.width} * a.height, 0.0F);
  const Setup setup(pixels_per_degree);
  for (std::uint32_t i = 0; i < exposures.count; ++i) {
    const double share = exposures.count > 1 ? static_cast<double>(i) / (exposures.count - 1) : 0.0;
    const double exposure = exposures.start + share * (exposures.stop - exposures.start);
    raise_to_flip(a, b, setup, Expose(exposure, tone_mapper), threads, map);
  }
  return map;
}

Exposures exposures_of(const Picture& reference, ToneMapper tone_mapper) {
  // Where the curve reaches 0.85: the larger root of a x^2 + b x + c, or the only one.
  constexpr double kBrightEnough = 0.85;
  const Curve& p = curve_of(tone_mapper);
  const double a = p[0] - kBrightEnough * p[2], b = p[1] - kBrightEnough * p[3], c = -kBrightEnough * p[4];
  const double half = a != 0 ? -0.5 * b / a : 0;
  const double x = a != 0 ? half + std::sqrt(half * half - c / a) : -c / b;

  std::vector<double> luminances;
  luminances.reserve(std::size_t{reference.width} * reference.height);
  const std::size_t step = reference.colors() == 1 ? 0 : 1;
  for (std::size_t i = 0; i < reference.pixels.size(); i += reference.channels) {
    double luminance = 0;
    for (std::size_t k = 0; k < 3; ++k)
      luminance += double{kLuminance[k]} * std::max(reference.pixels[i + k * step], 0.0F);
    luminances.push_back(luminance);
  }
  const auto median_of = [](std::vector<double>& values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  const double brightest = *std::max_element(luminances.begin(), luminances.end());
  if (brightest <= 0) return {0, 0, 1};
  double median = median_of(luminances);
  if (median <= 0) {
    luminances.erase(std::remove(luminances.begin(), luminances.end(), 0.0), luminances.end());
    median = median_of(luminances);
  }
  Exposures exposures;
  exposures.start = std::log2(x / brightest);
  exposures.stop = std::log2(x / median);
  exposures.count = static_cast<std::uint32_t>(std::max(2.0, std::ceil(exposures.stop - exposures.start)));
  return exposures;
}

}  // namespace heddle::compare
