// SPDX-License-Identifier: Apache-2.0
// A surface point and directions -> BRDF, samples, densities and albedos in float64. Equations (1) to (10) of
// README.md.
#include "ggx.hpp"

#include <array>
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
Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vec3 vector_from(const double v[3]) {
  return {v[0], v[1], v[2]};
}

double texel(int column, int row, int channel) {
  return static_cast<double>(kAlbedoTexels[2 * (row * kTableWidth + column) + channel]);
}

/// (4)
Albedo directional_albedo(double cosine, double roughness) {
  const double x = column_from_cosine(cosine, alpha_from_roughness(roughness));
  const double y = row_from_roughness(roughness);
  const int column = std::clamp(static_cast<int>(x), 0, kTableSize - 2);
  const int row = std::clamp(static_cast<int>(y), 0, kTableSize - 2);
  const double s = x - column, t = y - row;
  const auto at = [&](int channel) {
    return (1 - t) * ((1 - s) * texel(column, row, channel) + s * texel(column + 1, row, channel)) +
           t * ((1 - s) * texel(column, row + 1, channel) + s * texel(column + 1, row + 1, channel));
  };
  const double loss = at(0);
  return {loss, schlick_from_stored(loss, at(1), cosine)};
}

/// (5)
Albedo average_albedo(double roughness) {
  const double y = row_from_roughness(roughness);
  const int row = std::clamp(static_cast<int>(y), 0, kTableSize - 2);
  const double t = y - row;
  const auto at = [&](int channel) {
    return (1 - t) * texel(kTableSize, row, channel) + t * texel(kTableSize, row + 1, channel);
  };
  return {at(0), at(1)};
}

/// (6)
double multiple_scattering_share(double f0, double average_loss) {
  const double F_average = (20.0 * f0 + 1.0) / 21.0;
  return F_average * F_average * (1.0 - average_loss) / (1.0 - F_average * average_loss);
}

/// (8)
double dielectric_albedo(const Albedo& albedo, double f0, double share) {
  return f0 * (1.0 - albedo.loss) + (1.0 - f0) * albedo.schlick + share * albedo.loss;
}

/// What depends on the point alone.
struct Material {
  explicit Material(const heddle_surface_point& point)
      : roughness(clamped_roughness(point.roughness)),
        alpha(alpha_from_roughness(point.roughness)),
        average(average_albedo(point.roughness)) {
    const double r = (point.ior - 1.0) / (point.ior + 1.0);
    f0_dielectric = r * r;
    share_dielectric = multiple_scattering_share(f0_dielectric, average.loss);
    left_average = std::max(1.0 - dielectric_albedo(average, f0_dielectric, share_dielectric), 1e-6);
    for (std::size_t c = 0; c < 3; ++c) {
      f0[c] = f0_dielectric + (point.base_color[c] - f0_dielectric) * point.metalness;
      const double share_metal = multiple_scattering_share(point.base_color[c], average.loss);
      share[c] = share_dielectric + (share_metal - share_dielectric) * point.metalness;
      diffuse[c] = point.base_color[c] * (1.0 - point.metalness);
    }
  }
  /// What the dielectric's specular lobe leaves for diffuse.
  [[nodiscard]] double left(const Albedo& albedo) const {
    return std::max(1.0 - dielectric_albedo(albedo, f0_dielectric, share_dielectric), 0.0);
  }
  /// Albedo of single scattering, of the bounces after it, and of diffuse, meaned over colour; `albedo` at NoV.
  [[nodiscard]] Vec3 mean_albedos(const Albedo& albedo) const {
    Vec3 sum{};
    for (std::size_t c = 0; c < 3; ++c) {
      sum[0] += (f0[c] * (1.0 - albedo.loss) + (1.0 - f0[c]) * albedo.schlick) / 3.0;
      sum[1] += share[c] * albedo.loss / 3.0;
      sum[2] += diffuse[c] * left(albedo) / 3.0;
    }
    return sum;
  }
  double roughness, alpha;
  Albedo average;
  double f0_dielectric = 0.0, share_dielectric = 0.0, left_average = 1.0;
  Vec3 f0{}, share{}, diffuse{};
};

/// (1)
double D_GGX(const Vec3& H, double alpha) {
  const double k = alpha / (H[0] * H[0] + H[1] * H[1] + H[2] * H[2] * alpha * alpha);
  return k * k * inv_pi;
}

/// sqrt(alpha^2 + cos^2 (1 - alpha^2)): Smith's Lambda times 2 cos, plus cos.
double smith_root(double cosine, double alpha) {
  return std::sqrt(alpha * alpha + cosine * cosine * (1.0 - alpha * alpha));
}

/// (2)
double V_SmithGGXCorrelated(double NoV, double NoL, double alpha) {
  return 0.5 / std::max(NoL * smith_root(NoV, alpha) + NoV * smith_root(NoL, alpha), 1e-12);
}

struct Parts {
  Vec3 diffuse{}, specular{};
};

/// Of a material that does not change from one direction of light to the next; `albedo_view` at NoV.
Parts evaluate_material(const Material& material, const Albedo& albedo_view, const Vec3& V, const Vec3& L,
                        bool is_compensated) {
  const double NoV = std::min(V[2], 1.0), NoL = std::min(L[2], 1.0);
  Parts parts;
  if (NoL <= 0.0 || NoV < 0.0) return parts;
  const Vec3 H = normalized({V[0] + L[0], V[1] + L[1], V[2] + L[2]});
  const double schlick = power5(1.0 - std::clamp(dot(V, H), 0.0, 1.0));
  const double DV = D_GGX(H, material.alpha) * V_SmithGGXCorrelated(NoV, NoL, material.alpha);
  const Albedo albedo_light = directional_albedo(NoL, material.roughness);
  const double bounces = albedo_view.loss * albedo_light.loss * inv_pi / std::max(material.average.loss, 1e-7);
  const double left = material.left(albedo_view) * material.left(albedo_light) / material.left_average;
  for (std::size_t c = 0; c < 3; ++c) {
    parts.specular[c] = (material.f0[c] + (1.0 - material.f0[c]) * schlick) * DV;
    if (is_compensated) parts.specular[c] += material.share[c] * bounces;  // (7)
    parts.diffuse[c] = material.diffuse[c] * inv_pi * left;                // (9)
  }
  return parts;
}

Albedo albedo_towards(const Material& material, const double view[3]) {
  return directional_albedo(std::clamp(view[2], 0.0, 1.0), material.roughness);
}

void evaluate(const heddle_surface_point* point, const double view[3], const double light[3], uint32_t lobe,
              uint32_t multiple_scattering, double out_rgb[3]) {
  const Material material(*point);
  const Parts parts = evaluate_material(material, albedo_towards(material, view), vector_from(view), vector_from(light),
                                        multiple_scattering != 0);
  for (std::size_t c = 0; c < 3; ++c)
    out_rgb[c] = (lobe != 1 ? parts.specular[c] : 0.0) + (lobe != 2 ? parts.diffuse[c] : 0.0);
}

/// Share of samples that go to the visible normals; the others follow the cosine.
double specular_share(const Material& material, const Albedo& albedo_view) {
  const Vec3 albedos = material.mean_albedos(albedo_view);
  const double sum = albedos[0] + albedos[1] + albedos[2];
  return sum > 0.0 ? albedos[0] / sum : 1.0;
}

/// (10) Density of the reflection of visible normals; finite at NoV = 0.
double pdf_visible_normals(const Vec3& V, const Vec3& L, double alpha) {
  const Vec3 H = normalized({V[0] + L[0], V[1] + L[1], V[2] + L[2]});
  return D_GGX(H, alpha) * 0.5 / (V[2] + smith_root(V[2], alpha));
}

double pdf_material(const Material& material, double share, const Vec3& V, const Vec3& L) {
  if (L[2] <= 0.0 || V[2] < 0.0) return 0.0;
  return share * pdf_visible_normals(V, L, material.alpha) + (1.0 - share) * L[2] * inv_pi;
}

double pdf(const heddle_surface_point* point, const double view[3], const double light[3]) {
  const Material material(*point);
  return pdf_material(material, specular_share(material, albedo_towards(material, view)), vector_from(view),
                      vector_from(light));
}

/// `share`: specular_share. False: reflected into the surface.
bool sample_material(const Material& material, double share, const double view[3], const double u[2], double u_lobe,
                     Vec3& L) {
  if (view[2] < 0.0) return false;
  const double radius = std::sqrt(u[0]), angle = 2.0 * pi * u[1];
  if (u_lobe < share) {
    // Heitz 2018, listing 1: the visible part of a hemisphere, stretched.
    const double alpha = material.alpha;
    const Vec3 stretched = normalized({alpha * view[0], alpha * view[1], view[2]});
    const double flat = stretched[0] * stretched[0] + stretched[1] * stretched[1];
    const Vec3 T1 =
        flat > 0.0 ? scaled({-stretched[1], stretched[0], 0.0}, 1.0 / std::sqrt(flat)) : Vec3{1.0, 0.0, 0.0};
    const Vec3 T2 = cross(stretched, T1);
    const double t1 = radius * std::cos(angle);
    const double part = 0.5 * (1.0 + stretched[2]);
    const double t2 = (1.0 - part) * std::sqrt(1.0 - t1 * t1) + part * radius * std::sin(angle);
    const double t3 = std::sqrt(std::max(0.0, 1.0 - t1 * t1 - t2 * t2));
    Vec3 H;
    for (std::size_t i = 0; i < 3; ++i) H[i] = t1 * T1[i] + t2 * T2[i] + t3 * stretched[i];
    H = normalized({alpha * H[0], alpha * H[1], std::max(0.0, H[2])});
    const double VoH = dot(vector_from(view), H);
    for (std::size_t i = 0; i < 3; ++i) L[i] = 2.0 * VoH * H[i] - view[i];
  } else {
    L = {radius * std::cos(angle), radius * std::sin(angle), std::sqrt(std::max(0.0, 1.0 - u[0]))};
  }
  if (L[2] <= 0.0) return false;
  L = normalized(L);
  return true;
}

void sample(const heddle_surface_point* point, const double view[3], const double u[2], double u_lobe,
            double out_light[3], double* out_pdf) {
  std::fill(out_light, out_light + 3, 0.0);
  *out_pdf = 0.0;
  const Material material(*point);
  const double share = specular_share(material, albedo_towards(material, view));
  Vec3 L;
  if (!sample_material(material, share, view, u, u_lobe, L)) return;
  std::copy(L.begin(), L.end(), out_light);
  *out_pdf = pdf_material(material, share, vector_from(view), L);
}

void put_parts(const Material& material, const Albedo& albedo_view, double share, const double view[3], const Vec3& L,
               bool is_compensated, double out_diffuse[3], double out_specular[3], double* out_pdf) {
  const Parts parts = evaluate_material(material, albedo_view, vector_from(view), L, is_compensated);
  std::copy(parts.diffuse.begin(), parts.diffuse.end(), out_diffuse);
  std::copy(parts.specular.begin(), parts.specular.end(), out_specular);
  *out_pdf = pdf_material(material, share, vector_from(view), L);
}

void evaluate_parts(const heddle_surface_point* point, const double view[3], const double light[3],
                    uint32_t multiple_scattering, double out_diffuse[3], double out_specular[3], double* out_pdf) {
  const Material material(*point);
  const Albedo albedo_view = albedo_towards(material, view);
  put_parts(material, albedo_view, specular_share(material, albedo_view), view, vector_from(light),
            multiple_scattering != 0, out_diffuse, out_specular, out_pdf);
}

void sample_parts(const heddle_surface_point* point, const double view[3], const double u[2], double u_lobe,
                  uint32_t multiple_scattering, double out_light[3], double out_diffuse[3], double out_specular[3],
                  double* out_pdf) {
  const Material material(*point);
  const Albedo albedo_view = albedo_towards(material, view);
  const double share = specular_share(material, albedo_view);
  Vec3 L;
  *out_pdf = 0.0;
  if (sample_material(material, share, view, u, u_lobe, L)) {
    std::copy(L.begin(), L.end(), out_light);
    put_parts(material, albedo_view, share, view, L, multiple_scattering != 0, out_diffuse, out_specular, out_pdf);
    return;
  }
  for (double* out : {out_light, out_diffuse, out_specular}) std::fill(out, out + 3, 0.0);
}

void albedo(const heddle_surface_point* point, double n_dot_v, uint32_t lobe, uint32_t multiple_scattering,
            double out_rgb[3]) {
  std::fill(out_rgb, out_rgb + 3, 0.0);
  if (n_dot_v < 0.0) return;
  const Material material(*point);
  const Albedo one = directional_albedo(std::min(n_dot_v, 1.0), material.roughness);
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
