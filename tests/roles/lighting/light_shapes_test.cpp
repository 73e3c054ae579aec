// SPDX-License-Identifier: Apache-2.0
// plugins/shared/light.glsl on the device: every light shape against its definition in float64, its edges, and itself.
#include "roles/rendering.hpp"

namespace {

using namespace rendering;

constexpr std::uint32_t kGrid = 32;

/// A parallelogram of points around the camera at 0.
struct Points {
  dvec3 corner{-2, 0, -2}, edge_u{4, 0, 0}, edge_v{0, 0, 4}, normal{0, 1, 0};
  [[nodiscard]] dvec3 at(std::uint32_t x, std::uint32_t y) const {
    return corner + (x + 0.5) / kGrid * edge_u + (y + 0.5) / kGrid * edge_v;
  }
};

Image ask(const HeddleLight& record, const dvec3& position, const Points& points, const char* answer) {
  Scene scene;
  scene.look({0, 0, 0}, {0, 0, -1});
  scene.add_light(record, position);
  Graph graph(
      "extent = [32, 32]\noutput = \"probe.values\"\n[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = "
      "\"light\"\nparams.answer = \"" +
      std::string(answer) + "\"\nparams.corner = " + text_of(points.corner) +
      "\nparams.edge_u = " + text_of(points.edge_u) + "\nparams.edge_v = " + text_of(points.edge_v) +
      "\nparams.normal = " + text_of(points.normal) + "\n");
  return graph.image(scene);
}

double window(double range, double distance) {
  return range == 0.0 ? 1.0 : std::max(1.0 - std::pow(distance / range, 4), 0.0);
}

template <typename F>
void expect_each(const Image& image, const Points& points, double relative, double absolute, const F& expected) {
  ASSERT_EQ(image.width, kGrid);
  for (std::uint32_t y = 0; y < kGrid; ++y)
    for (std::uint32_t x = 0; x < kGrid; ++x) {
      const double value = static_cast<double>(image.at(x, y));
      const double right = expected(points.at(x, y));
      ASSERT_TRUE(std::isfinite(value));
      if (right == 0.0) {
        ASSERT_EQ(value, 0.0) << text_of(points.at(x, y));
      } else {
        ASSERT_NEAR(value, right, relative * right + absolute) << text_of(points.at(x, y));
      }
    }
}

TEST(LightShapes, PointFollowsTheWindowedInverseSquareAndIsZeroAtItsRange) {
  HeddleLight record = light(HEDDLE_LIGHT_POINT, {0, -1, 0}, 100.0);
  record.range = 2.0F;
  const dvec3 position(0, 1, 0);
  const Points points;
  const Image facing = ask(record, position, points, "facing");
  // 1 - (d / range)^4 cancels near the range: 1e-5 of what the light would be without a window.
  expect_each(facing, points, 1e-5, 100.0 / 4.0 * 1e-5, [&](const dvec3& p) {
    const double d = glm::length(position - p);
    return 100.0 * window(2.0, d) / (d * d);
  });
  // Exactly at the range: 2 m below a light at height 2.
  Points below;
  below.edge_u = below.edge_v = dvec3(0);
  below.corner = {0, 0, 0};
  EXPECT_EQ(ask(record, {0, 2, 0}, below, "irradiance").at(3, 3), 0.0F);
  EXPECT_EQ(ask(record, {0, 2.5, 0}, below, "irradiance").at(3, 3), 0.0F);
  EXPECT_GT(ask(record, {0, 1.99, 0}, below, "irradiance").at(3, 3), 0.0F);
}

TEST(LightShapes, SpotAndConeAreZeroOutsideTheirAngleAndFullInside) {
  const Points points;
  const dvec3 position(0, 1, 0);
  for (const std::uint32_t type : {HEDDLE_LIGHT_SPOT, HEDDLE_LIGHT_CONE}) {
    const HeddleLight record = light(type, {0, -1, 0}, 50.0);
    const Image facing = ask(record, position, points, "facing");
    expect_each(facing, points, 1e-5, 1e-4, [&](const dvec3& p) {
      const double d = glm::length(position - p), cosine = 1.0 / d;
      const double inner = static_cast<double>(record.cos_inner), outer = static_cast<double>(record.cos_outer);
      const double t = std::clamp((cosine - outer) / (inner - outer), 0.0, 1.0);
      return 50.0 / (d * d) * (type == HEDDLE_LIGHT_SPOT ? t * t : t * t * (3 - 2 * t));
    });
  }
}

TEST(LightShapes, WedgeIsAConeSweptAlongItsSegment) {
  HeddleLight record = light(HEDDLE_LIGHT_WEDGE, {0, -1, 0}, 50.0);
  record.segment_length = 1.5F;
  const dvec3 tangent(static_cast<double>(record.tangent[0]), static_cast<double>(record.tangent[1]),
                      static_cast<double>(record.tangent[2]));
  const dvec3 position(0.2, 1, 0);
  const Points points;
  expect_each(ask(record, position, points, "facing"), points, 1e-5, 1e-4, [&](const dvec3& p) {
    const dvec3 apex = position + tangent * std::clamp(glm::dot(p - position, tangent), -0.75, 0.75);
    const double d = glm::length(apex - p), cosine = (apex - p).y / d;
    const double t = std::clamp(
        (cosine - static_cast<double>(record.cos_outer)) / static_cast<double>(record.cos_inner - record.cos_outer),
        0.0, 1.0);
    return 50.0 / (d * d) * t * t * (3 - 2 * t);
  });
}

TEST(LightShapes, BoxIsParallelAndZeroOutside) {
  HeddleLight record = light(HEDDLE_LIGHT_BOX, {0, -1, 0}, 7.0);
  record.half_extent[0] = 1.0F;
  record.half_extent[1] = 0.5F;
  record.half_extent[2] = 2.0F;
  record.radius = 0.25F;
  const auto vector = [](const float v[3]) { return dvec3(v[0], v[1], v[2]); };
  const dvec3 d = vector(record.direction), t = vector(record.tangent), b = glm::cross(d, t);
  const dvec3 position(0.1, 1, 0.2);
  const Points points;
  const auto expected = [&](const dvec3& p) {
    const dvec3 q = p - position;
    double fade = 1.0;
    const dvec3 local(glm::dot(q, t), glm::dot(q, b), glm::dot(q, d)), half = vector(record.half_extent);
    for (int i = 0; i < 3; ++i) fade *= std::clamp((half[i] - std::abs(local[i])) / 0.25, 0.0, 1.0);
    return 7.0 * fade;
  };
  const Image facing = ask(record, position, points, "facing");
  expect_each(facing, points, 1e-5, 1e-5, expected);
  EXPECT_GT(facing.at(kGrid / 2, kGrid / 2), 0.0F);
  const Image direction = ask(record, position, points, "direction");
  EXPECT_FLOAT_EQ(direction.at(5, 5, 1), 1.0F);
}

/// Cosine-weighted integral of radiance 1 over a sphere's directions that are above the plane, by midpoints.
double sphere_by_quadrature(const dvec3& to_center, double radius, const dvec3& normal) {
  const double distance = glm::length(to_center);
  const dvec3 axis = to_center / distance;
  const dvec3 side = glm::normalize(glm::cross(axis, std::abs(axis.x) < 0.9 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
  const dvec3 other = glm::cross(axis, side);
  const double cos_edge = std::sqrt(1.0 - radius * radius / (distance * distance));
  double sum = 0.0;
  constexpr int kRings = 200, kSectors = 400;
  for (int i = 0; i < kRings; ++i) {
    const double cosine = 1.0 - (1.0 - cos_edge) * (i + 0.5) / kRings, sine = std::sqrt(1.0 - cosine * cosine);
    for (int j = 0; j < kSectors; ++j) {
      const double phi = 2.0 * kPi * (j + 0.5) / kSectors;
      sum += std::max(glm::dot(axis * cosine + (side * std::cos(phi) + other * std::sin(phi)) * sine, normal), 0.0);
    }
  }
  return sum * 2.0 * kPi * (1.0 - cos_edge) / (kRings * kSectors);
}

TEST(LightShapes, SphereEqualsItsSolidAngleAlsoWhereTheHorizonCutsIt) {
  HeddleLight record = light(HEDDLE_LIGHT_SPHERE, {0, -1, 0}, 3.0);
  record.radius = 0.6F;
  Points points;
  points.normal = glm::normalize(dvec3(0.9, 0.2, 0.1));  // cuts the sphere over much of the grid, hides it elsewhere
  const dvec3 position(0, 0.7, 0);
  const Image image = ask(record, position, points, "irradiance");
  int cut = 0, hidden = 0;
  for (std::uint32_t y = 0; y < kGrid; y += 3)
    for (std::uint32_t x = 0; x < kGrid; x += 3) {
      const dvec3 to_center = position - points.at(x, y);
      const double height = glm::dot(to_center, points.normal);
      const double right = 3.0 * sphere_by_quadrature(to_center, static_cast<double>(record.radius), points.normal);
      // 1e-3: the quadrature's border; 2e-4: atan is off by 3e-6 on some drivers, times pi L and the other term's size.
      EXPECT_NEAR(static_cast<double>(image.at(x, y)), right, 1e-3 * right + 2e-4) << text_of(points.at(x, y));
      cut += std::abs(height) < static_cast<double>(record.radius) ? 1 : 0;
      hidden += height < -static_cast<double>(record.radius) ? 1 : 0;
    }
  EXPECT_GT(cut, 20);
  EXPECT_GT(hidden, 20);
}

TEST(LightShapes, RectangleEqualsItsAreaIntegralAlsoWhereTheHorizonCutsIt) {
  HeddleLight record = light(HEDDLE_LIGHT_RECTANGLE, {0.2, -1, 0.1}, 2.0);
  record.half_extent[0] = 0.8F;
  record.half_extent[1] = 0.5F;
  const auto vector = [](const float v[3]) { return dvec3(v[0], v[1], v[2]); };
  const dvec3 d = vector(record.direction), t = vector(record.tangent), b = glm::cross(d, t);
  const dvec3 position(0, 0.8, 0);
  for (const dvec3& normal : {dvec3(0, 1, 0), glm::normalize(dvec3(0.9, 0.3, -0.2)), dvec3(0, 0, 1)}) {
    Points points;
    points.normal = normal;
    const Image image = ask(record, position, points, "irradiance");
    for (std::uint32_t y = 0; y < kGrid; y += 3)
      for (std::uint32_t x = 0; x < kGrid; x += 3) {
        const dvec3 p = points.at(x, y);
        double sum = 0.0;
        constexpr int kSide = 200;
        for (int i = 0; i < kSide * kSide; ++i) {
          const dvec3 q = position + t * (0.8 * ((i % kSide + 0.5) / kSide * 2 - 1)) +
                          b * (0.5 * ((i / kSide + 0.5) / kSide * 2 - 1)) - p;
          const double r2 = glm::dot(q, q);
          sum += std::max(glm::dot(q, normal), 0.0) * std::max(-glm::dot(q, d), 0.0) / (r2 * r2);
        }
        const double right = 2.0 * sum * 4.0 * 0.8 * 0.5 / (kSide * kSide);
        // 1e-3 + 1e-4: half cells of the quadrature on the horizon.
        EXPECT_NEAR(static_cast<double>(image.at(x, y)), right, 1e-3 * right + 2e-4) << text_of(p);
      }
  }
}

TEST(LightShapes, FarRectangleAndSphereGoOverIntoPointLights) {
  Points points;
  points.corner = {-0.01, 0, -0.01};
  points.edge_u = {0.02, 0, 0};
  points.edge_v = {0, 0, 0.02};
  for (const double distance : {50.0, 120.0, 128.0, 140.0, 1e4}) {  // on both sides of where the formula changes
    HeddleLight record = light(HEDDLE_LIGHT_RECTANGLE, {0, -1, 0}, 1000.0);
    record.half_extent[0] = 0.3F;
    record.half_extent[1] = 0.4F;
    const double rectangle = 1000.0 * 4 * 0.3 * 0.4 / (distance * distance);
    EXPECT_NEAR(static_cast<double>(ask(record, {0, distance, 0}, points, "irradiance").at(16, 16)), rectangle,
                3e-4 * rectangle)  // edges cancel to 2^-24 / 2^-8 in float32; a patch to its angle's square
        << distance;
    record.type = HEDDLE_LIGHT_SPHERE;
    record.radius = 0.5F;
    const double sphere = 1000.0 * kPi * 0.25 / (distance * distance);
    EXPECT_NEAR(static_cast<double>(ask(record, {0, distance, 0}, points, "irradiance").at(16, 16)), sphere,
                1e-5 * sphere)
        << distance;
  }
}

TEST(LightShapes, ALightAtThePointItselfIsFinite) {
  Points points;
  points.corner = points.edge_u = points.edge_v = dvec3(0);
  for (std::uint32_t type = HEDDLE_LIGHT_DIRECTIONAL; type <= HEDDLE_LIGHT_ENVIRONMENT; ++type)
    for (const char* answer : {"irradiance", "facing", "direction"}) {
      HeddleLight record = light(type, {0, -1, 0}, 1000.0);
      record.half_extent[0] = record.half_extent[1] = record.half_extent[2] = 0.5F;
      record.segment_length = 1.0F;
      for (const float radius : {0.0F, 0.1F}) {
        record.radius = radius;
        const Image image = ask(record, {0, 0, 0}, points, answer);
        for (std::uint32_t channel = 0; channel < 4; ++channel)
          EXPECT_TRUE(std::isfinite(image.at(0, 0, channel))) << "type " << type << " " << answer;
      }
    }
}

}  // namespace
