// SPDX-License-Identifier: Apache-2.0
// A surface point and directions -> BRDF, samples, densities and albedos in float64. Equations (1) to (11) of
// README.md.
#include "ggx.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "albedo_map.hpp"
#include "albedo_texels.hpp"

namespace heddle::ggx {
namespace {

using std::numbers::inv_pi;
using std::numbers::pi;
using Vec3 = std::array<double, 3>;

static_assert(std::size(kAlbedoTexels) == std::size_t{2} * kTableWidth * kTableSize);

double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vec3 scaled(const Vec3& v, double factor) {
  return {v[0] * factor, v[1] * factor, v[2] * factor};
}
Vec3 normalized(const Vec3& v) {
  return scaled(v, 1.0 / std::max(std::sqrt(dot(v, v)), 1e-300));
}
Vec3 vector_from(const double v[3]) {
  return {v[0], v[1], v[2]};
}

/// Cube root of a / b, for 0 <= a < 1e30 and 1e-4 < b < 1e30, to 1e-9 of itself; below a = 1e-30 it is 0. As a times
/// the inverse cube root of a^2 b it takes no division: a third of the exponent is the first guess, to 3.4 % (Kahan
/// 1991, "Computing a Real Cube Root"), and each of Newton's steps squares its error, twice.
double cube_root_of_ratio(double a, double b) {
  if (a < 1e-30) return 0.0;
  const double x = a * a * b, third = x * (1.0 / 3.0);
  double inverse = std::bit_cast<double>(0x553ef0ff289dd796ULL - std::bit_cast<std::uint64_t>(x) / 3);
  for (int i = 0; i < 3; ++i) inverse *= 4.0 / 3.0 - third * inverse * (inverse * inverse);
  return a * inverse;
}

/// Where a table is read: between two texels.
struct Place {
  int low;
  double share;  // of the next
};
Place place_of(double position) {
  const int low = std::clamp(static_cast<int>(position), 0, kTableSize - 2);
  return {low, position - low};
}

Albedo texel(int column, int row) {
  const float* values = kAlbedoTexels + 2 * (row * kTableWidth + column);
  return {static_cast<double>(values[0]), static_cast<double>(values[1])};
}
Albedo mixed(const Albedo& a, const Albedo& b, double share) {
  return {a.loss + share * (b.loss - a.loss), a.schlick + share * (b.schlick - a.schlick)};
}

/// (4)
Albedo directional_albedo(double cosine, double alpha, const Place& row) {
  const double k = kAngleScale * alpha;
  const Place column = place_of(cube_root_of_ratio(cosine * (1.0 + k), cosine + k) * (kTableSize - 1));
  const auto across = [&](int y) { return mixed(texel(column.low, y), texel(column.low + 1, y), column.share); };
  const Albedo stored = mixed(across(row.low), across(row.low + 1), row.share);
  return {stored.loss, schlick_from_stored(stored.loss, stored.schlick, cosine)};
}

/// (5)
Albedo average_albedo(const Place& row) {
  return mixed(texel(kTableSize, row.low), texel(kTableSize, row.low + 1), row.share);
}

/// (6)
double multiple_scattering_share(double f0, double average_loss) {
  const double F_average = (20.0 * f0 + 1.0) * (1.0 / 21.0);
  return F_average * F_average * (1.0 - average_loss) / (1.0 - F_average * average_loss);
}

/// (8)
double dielectric_albedo(const Albedo& albedo, double f0, double share) {
  return f0 * (1.0 - albedo.loss) + (1.0 - f0) * albedo.schlick + share * albedo.loss;
}

/// What depends on the point alone.
struct Material {
  Material() = default;
  explicit Material(const heddle_surface_point& point)
      : alpha(alpha_from_roughness(point.roughness)),
        row(place_of(row_from_roughness(point.roughness))),
        average(average_albedo(row)) {
    const double r = (point.ior - 1.0) / (point.ior + 1.0);
    f0_dielectric = r * r;
    share_dielectric = multiple_scattering_share(f0_dielectric, average.loss);
    per_left = 1.0 / std::max(1.0 - dielectric_albedo(average, f0_dielectric, share_dielectric), 1e-6);
    per_loss = 1.0 / std::max(average.loss, 1e-7);
    for (std::size_t c = 0; c < 3; ++c) {
      f0[c] = f0_dielectric + (point.base_color[c] - f0_dielectric) * point.metalness;
      const double share_metal = multiple_scattering_share(point.base_color[c], average.loss);
      share[c] = share_dielectric + (share_metal - share_dielectric) * point.metalness;
      diffuse[c] = point.base_color[c] * (1.0 - point.metalness);
    }
    is_diffuse = diffuse[0] > 0.0 || diffuse[1] > 0.0 || diffuse[2] > 0.0;
  }
  /// What the dielectric's specular lobe leaves for diffuse.
  [[nodiscard]] double left(const Albedo& albedo) const {
    return std::max(1.0 - dielectric_albedo(albedo, f0_dielectric, share_dielectric), 0.0);
  }
  /// Albedo of single scattering, of the bounces after it, and of diffuse, summed over colour; `albedo` at NoV.
  [[nodiscard]] Vec3 mean_albedos(const Albedo& albedo) const {
    Vec3 sum{};
    for (std::size_t c = 0; c < 3; ++c) {
      sum[0] += f0[c] * (1.0 - albedo.loss) + (1.0 - f0[c]) * albedo.schlick;
      sum[1] += share[c] * albedo.loss;
      sum[2] += diffuse[c] * left(albedo);
    }
    return sum;
  }
  double alpha = 1.0;
  Place row{};  // of the table
  Albedo average;
  bool is_diffuse = false;
  double f0_dielectric = 0.0, share_dielectric = 0.0;
  double per_left = 1.0, per_loss = 1.0;  // 1 over what diffuse keeps, and single scattering loses, on average
  Vec3 f0{}, share{}, diffuse{};
};

/// sqrt(alpha^2 + cos^2 (1 - alpha^2)): Smith's Lambda times 2 cos, plus cos.
double smith_root(double cosine, double alpha) {
  return std::sqrt(alpha * alpha + cosine * cosine * (1.0 - alpha * alpha));
}

/// A material and one direction of the viewer.
struct View {
  View() = default;
  View(const Material& material, double cosine)
      : albedo(directional_albedo(std::clamp(cosine, 0.0, 1.0), material.alpha, material.row)),
        root(smith_root(std::min(cosine, 1.0), material.alpha)),
        left(material.left(albedo)) {
    const double a2 = material.alpha * material.alpha, c2 = std::min(cosine * cosine, 1.0);
    const double s = 1.0 + std::sqrt(1.0 - c2), s2 = s * s;
    cap = (1.0 - a2) * s2 / (s2 + a2 * c2);
    per_visible = 0.5 / (cap * cosine + root);
    const Vec3 albedos = material.mean_albedos(albedo);
    const double sum = albedos[0] + albedos[1] + albedos[2];
    specular_share = sum > 0.0 ? albedos[0] / sum : 1.0;
  }
  Albedo albedo;
  double root = 1.0;
  double cap = 1.0;          // (11): how far below the stretched equator there are normals that reflect upwards
  double per_visible = 1.0;  // density of a visible normal's reflection over D: finite at NoV = 0
  double left = 0.0;
  double specular_share = 1.0;  // of samples, that go to the visible normals; the others follow the cosine
};

/// What was asked for before, in each thread: a path asks for the same point and viewer with one direction after
/// another, and in scenes of few materials without textures most points are met again.
struct Kept {
  struct Entry {
    heddle_surface_point point{};  // struct_size 0: none yet
    double cosine = -1.0;          // of the viewer; < 0: of none
    Material material;
    View view;
  };
  static constexpr std::uint32_t kEntriesLog2 = 4;
  std::array<Entry, std::size_t{1} << kEntriesLog2> entries;

  /// With the view of this cosine, >= 0; valid until the next call.
  const Entry& at(const heddle_surface_point& point, double cosine) {
    if (!is_same(entries[last].point, point)) {
      last = hash(point) >> (64U - kEntriesLog2);
      Entry& other = entries[last];
      if (!is_same(other.point, point)) {
        other.point = point;
        other.point.struct_size = sizeof point;
        other.cosine = -1.0;
        other.material = Material(point);
      }
    }
    Entry& entry = entries[last];
    if (entry.cosine != cosine) {
      entry.view = View(entry.material, cosine);
      entry.cosine = cosine;
    }
    return entry;
  }

 private:
  std::uint64_t last = 0;  // asked for

  static bool is_same(const heddle_surface_point& kept, const heddle_surface_point& point) {
    return kept.struct_size != 0 && kept.base_color[0] == point.base_color[0] &&
           kept.base_color[1] == point.base_color[1] && kept.base_color[2] == point.base_color[2] &&
           kept.metalness == point.metalness && kept.roughness == point.roughness && kept.ior == point.ior;
  }
  static std::uint64_t hash(const heddle_surface_point& point) {
    std::uint64_t sum = 0;
    for (const double value :
         {point.base_color[0], point.base_color[1], point.base_color[2], point.metalness, point.roughness, point.ior})
      sum = sum * 0x9e3779b97f4a7c15ULL + std::bit_cast<std::uint64_t>(value);
    return (sum ^ (sum >> 32U)) * 0x9e3779b97f4a7c15ULL;
  }
};

const Kept::Entry& kept_of(const heddle_surface_point& point, double cosine) {
  thread_local constinit Kept kept{};
  return kept.at(point, cosine);
}

struct Parts {
  Vec3 diffuse{}, specular{};
  double pdf = 0.0;
};

Parts evaluate_material(const Material& material, const View& view, const Vec3& V, const Vec3& L, bool is_compensated) {
  const double NoV = std::min(V[2], 1.0), NoL = std::min(L[2], 1.0);
  Parts parts;
  if (NoL <= 0.0 || NoV < 0.0) return parts;
  // (1) of the half vector h before it is made a unit vector: V and L are, so V . h = |h|^2 / 2.
  const Vec3 h{V[0] + L[0], V[1] + L[1], V[2] + L[2]};
  const double flat = h[0] * h[0] + h[1] * h[1], up = h[2] * h[2];
  const double k = material.alpha * (flat + up) / (flat + up * (material.alpha * material.alpha));
  const double D = k * k * inv_pi;
  const double schlick = power5(1.0 - std::min(0.5 * std::sqrt(flat + up), 1.0));
  const double share = view.specular_share;
  parts.pdf = share * D * view.per_visible + (1.0 - share) * L[2] * inv_pi;  // (10)
  // (2) V_SmithGGXCorrelated
  const double DV = D * 0.5 / std::max(NoL * view.root + NoV * smith_root(NoL, material.alpha), 1e-12);
  for (std::size_t c = 0; c < 3; ++c) parts.specular[c] = (material.f0[c] + (1.0 - material.f0[c]) * schlick) * DV;
  if (!is_compensated && !material.is_diffuse) return parts;
  const Albedo albedo_light = directional_albedo(NoL, material.alpha, material.row);
  const double bounces = view.albedo.loss * albedo_light.loss * inv_pi * material.per_loss;
  const double left = view.left * material.left(albedo_light) * material.per_left * inv_pi;
  for (std::size_t c = 0; c < 3; ++c) {
    if (is_compensated) parts.specular[c] += material.share[c] * bounces;  // (7)
    parts.diffuse[c] = material.diffuse[c] * left;                         // (9)
  }
  return parts;
}

Parts evaluate_point(const heddle_surface_point& point, const double view[3], const double light[3],
                     bool is_compensated) {
  if (!(view[2] >= 0.0 && light[2] > 0.0)) return {};
  const Kept::Entry& kept = kept_of(point, view[2]);
  return evaluate_material(kept.material, kept.view, vector_from(view), vector_from(light), is_compensated);
}

void evaluate(const heddle_surface_point* point, const double view[3], const double light[3], uint32_t lobe,
              uint32_t multiple_scattering, double out_rgb[3]) {
  const Parts parts = evaluate_point(*point, view, light, multiple_scattering != 0);
  for (std::size_t c = 0; c < 3; ++c)
    out_rgb[c] = (lobe != 1 ? parts.specular[c] : 0.0) + (lobe != 2 ? parts.diffuse[c] : 0.0);
}

double pdf(const heddle_surface_point* point, const double view[3], const double light[3]) {
  return evaluate_point(*point, view, light, false).pdf;
}

/// False: reflected into the surface.
bool sample_material(const Material& material, const View& seen, const double view[3], const double u[2], double u_lobe,
                     Vec3& L) {
  const double angle = 2.0 * pi * u[1], cosine = std::cos(angle), sine = std::sin(angle);
  if (u_lobe < seen.specular_share) {
    // Normals as halves between the stretched view and a direction of the cap that it sees.
    const double alpha = material.alpha;
    const Vec3 stretched = scaled({alpha * view[0], alpha * view[1], view[2]}, 1.0 / seen.root);
    const double lowest = seen.cap * stretched[2];
    const double z = (1.0 - u[0]) * (1.0 + lowest) - lowest, radius = std::sqrt(std::max(0.0, 1.0 - z * z));
    const Vec3 H = normalized(
        {alpha * (stretched[0] + radius * cosine), alpha * (stretched[1] + radius * sine), stretched[2] + z});
    const double VoH = dot(vector_from(view), H);
    for (std::size_t i = 0; i < 3; ++i) L[i] = 2.0 * VoH * H[i] - view[i];
  } else {
    const double radius = std::sqrt(u[0]);
    L = {radius * cosine, radius * sine, std::sqrt(std::max(0.0, 1.0 - u[0]))};
  }
  return L[2] > 0.0;
}

/// The direction, with what the material does with it; false: none.
bool sample_point(const heddle_surface_point& point, const double view[3], const double u[2], double u_lobe,
                  bool is_compensated, Vec3& L, Parts& parts) {
  if (!(view[2] >= 0.0)) return false;
  const Kept::Entry& kept = kept_of(point, view[2]);
  if (!sample_material(kept.material, kept.view, view, u, u_lobe, L)) return false;
  parts = evaluate_material(kept.material, kept.view, vector_from(view), L, is_compensated);
  return true;
}

void sample(const heddle_surface_point* point, const double view[3], const double u[2], double u_lobe,
            double out_light[3], double* out_pdf) {
  std::fill(out_light, out_light + 3, 0.0);
  *out_pdf = 0.0;
  Vec3 L;
  Parts parts;
  if (!sample_point(*point, view, u, u_lobe, false, L, parts)) return;
  std::copy(L.begin(), L.end(), out_light);
  *out_pdf = parts.pdf;
}

void evaluate_parts(const heddle_surface_point* point, const double view[3], const double light[3],
                    uint32_t multiple_scattering, double out_diffuse[3], double out_specular[3], double* out_pdf) {
  const Parts parts = evaluate_point(*point, view, light, multiple_scattering != 0);
  std::copy(parts.diffuse.begin(), parts.diffuse.end(), out_diffuse);
  std::copy(parts.specular.begin(), parts.specular.end(), out_specular);
  *out_pdf = parts.pdf;
}

void sample_parts(const heddle_surface_point* point, const double view[3], const double u[2], double u_lobe,
                  uint32_t multiple_scattering, double out_light[3], double out_diffuse[3], double out_specular[3],
                  double* out_pdf) {
  Vec3 L{};
  Parts parts;
  if (!sample_point(*point, view, u, u_lobe, multiple_scattering != 0, L, parts)) L = {};
  std::copy(L.begin(), L.end(), out_light);
  std::copy(parts.diffuse.begin(), parts.diffuse.end(), out_diffuse);
  std::copy(parts.specular.begin(), parts.specular.end(), out_specular);
  *out_pdf = parts.pdf;
}

void albedo(const heddle_surface_point* point, double n_dot_v, uint32_t lobe, uint32_t multiple_scattering,
            double out_rgb[3]) {
  std::fill(out_rgb, out_rgb + 3, 0.0);
  if (n_dot_v < 0.0) return;
  const Kept::Entry& kept = kept_of(*point, n_dot_v);
  const Material& material = kept.material;
  const Albedo& one = kept.view.albedo;
  for (std::size_t c = 0; c < 3; ++c) {
    if (lobe != 1) {
      out_rgb[c] += material.f0[c] * (1.0 - one.loss) + (1.0 - material.f0[c]) * one.schlick;
      if (multiple_scattering != 0) out_rgb[c] += material.share[c] * one.loss;
    }
    if (lobe != 2) out_rgb[c] += material.diffuse[c] * material.left(one);
  }
}

constexpr heddle_surface_material_service kService{
    sizeof(heddle_surface_material_service), 0, &evaluate, &sample, &pdf, &albedo, &evaluate_parts, &sample_parts};

}  // namespace

const heddle_surface_material_service* service() {
  return &kService;
}
const float* albedo_texels() {
  return kAlbedoTexels;
}

}  // namespace heddle::ggx
