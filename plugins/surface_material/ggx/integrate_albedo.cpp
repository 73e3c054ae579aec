// SPDX-License-Identifier: Apache-2.0
// Directional albedos of the single-scattering GGX lobe, by quadrature in float64 -> albedo_texels.hpp.
// E(NoV, alpha) is the mean of G2/G1 over the visible normals (Heitz 2018, "Sampling the GGX Distribution of Visible
// Normals", equation 19), so the integrand is smooth but where the reflected direction leaves the hemisphere: the
// square of sample coordinates is cut there, and every piece gets Gauss-Legendre points that crowd at its ends.
#include "albedo_map.hpp"

#include <array>
#include <cstdio>
#include <numbers>
#include <vector>

namespace {

using heddle::ggx::Albedo;

struct Rule {
  std::vector<double> position, weight;  // on [0, 1]
};

/// Gauss-Legendre points by Newton's method, moved by 3t^2 - 2t^3 so that square roots at the ends do no harm.
Rule crowded_rule(int count) {
  Rule rule;
  for (int i = 0; i < count; ++i) {
    double z = std::cos(std::numbers::pi * (i + 0.75) / (count + 0.5));
    double slope = 0.0;
    for (int step = 0; step < 50; ++step) {
      double p = 1.0, previous = 0.0;
      for (int j = 0; j < count; ++j) {
        const double next = ((2 * j + 1) * z * p - j * previous) / (j + 1);
        previous = p;
        p = next;
      }
      slope = count * (z * p - previous) / (z * z - 1.0);
      z -= p / slope;
    }
    const double t = 0.5 * (1.0 - z);
    const double weight = 1.0 / ((1.0 - z * z) * slope * slope);
    rule.position.push_back(t * t * (3.0 - 2.0 * t));
    rule.weight.push_back(weight * 6.0 * t * (1.0 - t));
  }
  return rule;
}

/// The lobe of one view direction, over Heitz's disc of sample coordinates (r, phi); phi = 0 is normal to the plane of
/// incidence, in which the lobe is symmetric.
class Lobe {
 public:
  Lobe(double NoV, double alpha) : NoV_(NoV), sine_(std::sqrt(std::max(0.0, 1.0 - NoV * NoV))), alpha_(alpha) {
    const double length = std::hypot(alpha * sine_, NoV);
    stretched_x_ = alpha * sine_ / length;
    stretched_z_ = NoV / length;
    lambda_ = smith_lambda(NoV);
  }
  struct Reflection {
    double NoL, VoH;
  };
  [[nodiscard]] Reflection at(double r, double phi) const {
    const double p1 = r * std::cos(phi);
    const double share = 0.5 * (1.0 + stretched_z_);
    const double p2 = (1.0 - share) * std::sqrt(std::max(0.0, 1.0 - p1 * p1)) + share * r * std::sin(phi);
    const double p3 = std::sqrt(std::max(0.0, 1.0 - p1 * p1 - p2 * p2));
    const double x = alpha_ * (p3 * stretched_x_ - p2 * stretched_z_);
    const double y = alpha_ * p1;
    const double z = std::max(0.0, p2 * stretched_x_ + p3 * stretched_z_);
    const double length = std::sqrt(x * x + y * y + z * z);
    const double VoH = (x * sine_ + z * NoV_) / length;
    return {2.0 * VoH * z / length - NoV_, VoH};
  }
  [[nodiscard]] double shadowing(double NoL) const { return (1.0 + lambda_) / (1.0 + lambda_ + smith_lambda(NoL)); }

 private:
  [[nodiscard]] double smith_lambda(double cosine) const {
    const double c2 = cosine * cosine;
    return 0.5 * (std::sqrt(1.0 + alpha_ * alpha_ * std::max(0.0, 1.0 - c2) / c2) - 1.0);
  }
  double NoV_, sine_, alpha_, stretched_x_ = 0.0, stretched_z_ = 1.0, lambda_ = 0.0;
};

/// Ends of the pieces of [0, 1] on which `f` keeps its sign.
template <typename F>
void find_pieces(const F& f, std::vector<double>& ends) {
  constexpr int kScan = 16;  // coarser than any two crossings seen, finer than needed
  ends.assign(1, 0.0);
  double from = 0.0;
  bool was_positive = f(0.0) > 0.0;
  for (int i = 1; i <= kScan; ++i) {
    const double to = static_cast<double>(i) / kScan;
    const bool is_positive = f(to) > 0.0;
    if (is_positive != was_positive) {
      double low = from, high = to;
      for (int step = 0; step < 44; ++step) {
        const double middle = 0.5 * (low + high);
        ((f(middle) > 0.0) == was_positive ? low : high) = middle;
      }
      ends.push_back(0.5 * (low + high));
    }
    from = to;
    was_positive = is_positive;
  }
  ends.push_back(1.0);
}

Albedo integrate(double NoV, double alpha, const Rule& radial, const Rule& angular) {
  // NoV = 0 is a limit: Lambda is infinite there. The table's second column is at 1e-6 or more.
  const Lobe lobe(std::max(NoV, 1e-9), alpha);
  const auto angle = [](double t) { return (t - 0.5) * std::numbers::pi; };
  double E = 0.0, E_schlick = 0.0;
  std::vector<double> arcs, pieces;
  find_pieces([&](double t) { return lobe.at(1.0, angle(t)).NoL; }, arcs);
  for (std::size_t a = 0; a + 1 < arcs.size(); ++a) {
    for (std::size_t j = 0; j < angular.position.size(); ++j) {
      const double phi = angle(arcs[a] + (arcs[a + 1] - arcs[a]) * angular.position[j]);
      const double phi_weight = (arcs[a + 1] - arcs[a]) * angular.weight[j];
      find_pieces([&](double r) { return lobe.at(r, phi).NoL; }, pieces);
      for (std::size_t p = 0; p + 1 < pieces.size(); ++p) {
        const double width = pieces[p + 1] - pieces[p];
        if (lobe.at(pieces[p] + 0.5 * width, phi).NoL <= 0.0) continue;
        for (std::size_t i = 0; i < radial.position.size(); ++i) {
          const double r = pieces[p] + width * radial.position[i];
          const Lobe::Reflection reflection = lobe.at(r, phi);
          if (reflection.NoL <= 0.0) continue;
          const double term = phi_weight * width * radial.weight[i] * 2.0 * r * lobe.shadowing(reflection.NoL);
          E += term;
          E_schlick += term * heddle::ggx::power5(1.0 - reflection.VoH);
        }
      }
    }
  }
  return {std::max(1.0 - E, 0.0), E_schlick};
}

/// 2 int E NoV dNoV of what the texels interpolate to: columns are far apart in NoV where alpha is small, so each is
/// cut into parts, and on each part what is linear in NoV is integrated exactly.
Albedo average_over_hemisphere(const std::array<Albedo, heddle::ggx::kTableSize>& texels, double alpha) {
  using namespace heddle::ggx;
  constexpr int kParts = 32;
  const auto at = [&](int part) -> Albedo {
    const std::size_t column = static_cast<std::size_t>(std::min(part / kParts, kTableSize - 2));
    const double t = static_cast<double>(part) / kParts - static_cast<double>(column);
    const double loss = texels[column].loss * (1.0 - t) + texels[column + 1].loss * t;
    const double stored = texels[column].schlick * (1.0 - t) + texels[column + 1].schlick * t;
    const double cosine = cosine_from_column(static_cast<double>(part) / kParts, alpha);
    return {loss, schlick_from_stored(loss, stored, cosine)};
  };
  Albedo average;
  Albedo last = at(0);
  double last_cosine = 0.0;
  for (int part = 1; part <= (kTableSize - 1) * kParts; ++part) {
    const Albedo albedo = at(part);
    const double cosine = cosine_from_column(static_cast<double>(part) / kParts, alpha);
    const double h = cosine - last_cosine;
    const double from = h * (last_cosine + h / 3.0), to = h * (last_cosine + 2.0 * h / 3.0);
    average.loss += last.loss * from + albedo.loss * to;
    average.schlick += last.schlick * from + albedo.schlick * to;
    last = albedo;
    last_cosine = cosine;
  }
  return average;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace heddle::ggx;
  std::FILE* file = argc == 2 ? std::fopen(argv[1], "w") : nullptr;
  if (file == nullptr) {
    std::fprintf(stderr, "usage: surface_material_ggx_table FILE\n");
    return 2;
  }
  const Rule radial = crowded_rule(24);
  const Rule angular = crowded_rule(48);
  std::fprintf(file,
               "// Written by integrate_albedo.cpp: rows of roughness, columns of NoV; averages last.\n"
               "#pragma once\ninline constexpr float kAlbedoTexels[] = {\n");
  for (int row = 0; row < kTableSize; ++row) {
    const double alpha = alpha_from_roughness(roughness_from_row(row));
    std::array<Albedo, kTableSize> texels;  // as stored
    for (int column = 0; column < kTableSize; ++column) {
      const double cosine = cosine_from_column(column, alpha);
      const Albedo albedo = integrate(cosine, alpha, radial, angular);
      texels[static_cast<std::size_t>(column)] = {albedo.loss, stored_schlick(albedo, cosine)};
      std::fprintf(file, "%af,%af,\n", albedo.loss, stored_schlick(albedo, cosine));
    }
    const Albedo average = average_over_hemisphere(texels, alpha);
    std::fprintf(file, "%af,%af,\n", average.loss, average.schlick);
  }
  std::fprintf(file, "};\n");
  return std::fclose(file) == 0 ? 0 : 4;
}
