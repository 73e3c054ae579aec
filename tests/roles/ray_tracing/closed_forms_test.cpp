// SPDX-License-Identifier: Apache-2.0
// ray_tracing/path_tracer against what is known without it: furnaces, lights of every shape over a plane, by float64
// quadrature of the BRDF's service over the light, albedo tables, layers. Every answer is compared by its z-score; the
// limit holds for all of them together, and a planted bias of 2 % breaks every one.
#include "roles/ray_tracing/measuring.hpp"

#include <functional>

namespace {

using namespace ray_tracing;

// |z| that the most extreme of 60 answers exceeds with a chance of 1e-3, two-sided.
constexpr double kLimit = 4.31;

struct Answer {
  std::string name;
  double truth;
  double model_error;  // relative, of the truth itself: tables, quadrature
  Measured measured;
};

/// A camera that looks at `target` of the floor y = 0 so narrowly that all pixels see one point, at a cosine NoV.
void look_at_floor(Scene& scene, double NoV, const dvec3& target = dvec3(0.0)) {
  const double sine = std::sqrt(1.0 - NoV * NoV);
  scene.look(target + 2.0 * dvec3(sine * 0.6, NoV, sine * 0.8), target, 1e-3);
}

dvec3 view_of(double NoV) {
  const double sine = std::sqrt(1.0 - NoV * NoV);
  return {sine * 0.6, NoV, sine * 0.8};
}

/// The service's frame has the normal along +Z.
dvec3 to_local(const dvec3& world) {
  return {world.x, -world.z, world.y};
}

double brdf(const HeddleMaterial& record, const dvec3& view, const dvec3& light) {
  const heddle_surface_point point = point_of(record);
  const dvec3 v = to_local(view), l = to_local(light);
  double rgb[3];
  material_service().evaluate(&point, &v.x, &l.x, 0, 1, rgb);
  return rgb[0];
}

/// Radiance from the floor at 0 under a parametrized emitter of radiance 1: midpoints of n x n cells. place(u, v) gives
/// a point, and the area vector of a cell is `normal` times its size.
double reflected(const HeddleMaterial& record, double NoV, int n,
                 const std::function<void(double, double, dvec3&, dvec3&)>& place) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      dvec3 p, area;
      place((i + 0.5) / n, (j + 0.5) / n, p, area);
      const double squared = glm::dot(p, p);
      const dvec3 L = p / std::sqrt(squared);
      const double cosine = -glm::dot(area, L);
      if (L.y <= 0.0 || cosine <= 0.0) continue;
      sum += brdf(record, view_of(NoV), L) * L.y * cosine / squared / (n * n);
    }
  return sum;
}

std::string tracer(std::uint32_t samples, const std::string& more = "") {
  return "params.samples = " + std::to_string(samples) + "\n" + more;
}

void add_rectangle_answers(std::vector<Answer>& answers) {
  struct Case {
    const char* name;
    dvec3 center, direction;
    double x, y, roughness, metalness, NoV;
  };
  for (const Case& one : {Case{"rectangle, diffuse", {0.3, 1.0, -0.2}, {0, -1, 0}, 0.5, 0.3, 1.0, 0.0, 0.7},
                          Case{"rectangle, near", {0.0, 0.1, 0.0}, {0, -1, 0}, 0.5, 0.5, 1.0, 0.0, 0.5},
                          Case{"rectangle, mirrored", {-0.6, 0.7, -0.8}, {0.6, -0.7, 0.8}, 0.2, 0.4, 0.3, 1.0, 0.7},
                          Case{"rectangle, cut by the floor", {-0.5, 0.1, 0}, {1, 0, 0}, 0.4, 0.5, 0.6, 0.0, 0.6},
                          Case{"rectangle, far", {3, 20, 4}, {-0.1, -1, 0}, 0.2, 0.2, 0.8, 0.5, 0.4}}) {
    Scene scene;
    const HeddleMaterial record = surface(0.6, one.roughness, one.metalness);
    scene.use_material(record);
    scene.add_floor({0, 0, 0}, 5.0);
    HeddleLight lamp = light(HEDDLE_LIGHT_RECTANGLE, one.direction, 1.0);
    lamp.half_extent[0] = static_cast<float>(one.x);
    lamp.half_extent[1] = static_cast<float>(one.y);
    const dvec3 d(lamp.direction[0], lamp.direction[1], lamp.direction[2]);
    const dvec3 t(lamp.tangent[0], lamp.tangent[1], lamp.tangent[2]);
    scene.add_light(lamp, one.center);
    look_at_floor(scene, one.NoV);
    const double truth = reflected(record, one.NoV, 600, [&](double u, double v, dvec3& p, dvec3& area) {
      p = one.center + t * ((2 * u - 1) * one.x) + glm::cross(d, t) * ((2 * v - 1) * one.y);
      area = d * (4.0 * one.x * one.y);
    });
    answers.push_back({one.name, truth, 1e-3, measure(scene, graph_text(tracer(256)))});
  }
}

void add_ball_answers(std::vector<Answer>& answers) {
  struct Case {
    const char* name;
    dvec3 center;
    double radius, roughness, metalness, NoV;
  };
  for (const Case& one : {Case{"sphere, diffuse", {0.2, 1.0, 0.1}, 0.4, 1.0, 0.0, 0.7},
                          Case{"sphere, mirrored", {-0.6, 0.7, -0.8}, 0.2, 0.25, 1.0, 0.7},
                          Case{"sphere, below the horizon in part", {0.8, 0.1, 0.0}, 0.4, 0.7, 0.0, 0.6}}) {
    Scene scene;
    const HeddleMaterial record = surface(0.6, one.roughness, one.metalness);
    scene.use_material(record);
    scene.add_floor({0, 0, 0}, 5.0);
    HeddleLight lamp = light(HEDDLE_LIGHT_SPHERE, {0, -1, 0}, 1.0);
    lamp.radius = static_cast<float>(one.radius);
    scene.add_light(lamp, one.center);
    look_at_floor(scene, one.NoV);
    const double truth = reflected(record, one.NoV, 900, [&](double u, double v, dvec3& p, dvec3& area) {
      const double z = 2 * u - 1, s = std::sqrt(1 - z * z), phi = 2 * kPi * v;
      const dvec3 n(s * std::cos(phi), z, s * std::sin(phi));
      p = one.center + one.radius * n;
      area = n * (4 * kPi * one.radius * one.radius);
    });
    answers.push_back({one.name, truth, 2e-3, measure(scene, graph_text(tracer(256)))});
  }
  // The analogue of a sun: a disc that lights planes facing it by 3 lx.
  Scene scene;
  const HeddleMaterial record = surface(0.5, 0.5, 0.0);
  scene.use_material(record);
  scene.add_floor({0, 0, 0}, 5.0);
  HeddleLight sun = light(HEDDLE_LIGHT_DIRECTIONAL, {0.3, -1, 0.5}, 3.0);
  sun.radius = 0.2F;
  scene.add_light(sun);
  look_at_floor(scene, 0.6);
  const dvec3 axis = -glm::normalize(dvec3(0.3, -1, 0.5)), x = glm::normalize(glm::cross(axis, dvec3(0, 0, 1)));
  const double truth = reflected(record, 0.6, 600, [&](double u, double v, dvec3& p, dvec3& area) {
    const double lost = u * (1 - std::cos(0.2)), s = std::sqrt(lost * (2 - lost)), phi = 2 * kPi * v;
    p = axis * (1 - lost) + s * (std::cos(phi) * x + std::sin(phi) * glm::cross(axis, x));
    area = -p * (2 * kPi * (1 - std::cos(0.2)) * 3.0 / (kPi * std::pow(std::sin(0.2), 2)));
  });
  answers.push_back({"disc of a sun", truth, 1e-3, measure(scene, graph_text(tracer(256)))});
}

void add_glow_answers(std::vector<Answer>& answers) {
  // A glowing quad with a hole's worth of shade: the same form factors, by surfaces instead of lights.
  for (const double metalness : {0.0, 1.0}) {
    Scene scene;
    HeddleMaterial glow = surface(0.0, 1.0, 0.0, 1.0);
    for (float& channel : glow.emissive) channel = 2.0F;
    scene.use_material(glow);
    scene.add_mesh({-0.5F, 0, -0.3F, 0.5F, 0, -0.3F, 0.5F, 0, 0.3F, -0.5F, 0, 0.3F}, {}, {0, 1, 2, 0, 2, 3},
                   glm::translate(dmat4(1.0), dvec3(-0.4, 1.0, -0.5)));
    const HeddleMaterial record = surface(0.6, 0.4, metalness);
    scene.use_material(record);
    scene.add_floor({0, 0, 0}, 5.0);
    look_at_floor(scene, 0.7);
    const double truth = reflected(record, 0.7, 600, [&](double u, double v, dvec3& p, dvec3& area) {
      p = dvec3(-0.4 + (u - 0.5), 1.0, -0.5 + 0.6 * (v - 0.5));
      area = dvec3(0, -0.6 * 2.0, 0);
    });
    // Light that goes to the lamp and back is lost in it, but for its own Fresnel reflection: one bounce is asked for.
    answers.push_back({"glowing quad, metalness " + std::to_string(metalness), truth, 1e-3,
                       measure(scene, graph_text(tracer(256, "params.bounces = 1\n")))});
  }
}

void add_furnace_answers(std::vector<Answer>& answers) {
  for (const double roughness : {0.0, 0.1, 0.3, 0.6, 1.0})
    for (const double metalness : {0.0, 0.5, 1.0}) {
      Scene scene;
      scene.use_material(surface(1.0, roughness, metalness));
      scene.add_floor({0, 0, 0}, 5.0);
      look_at_floor(scene, 0.4);
      answers.push_back({"white furnace " + std::to_string(roughness) + " " + std::to_string(metalness), 1.0, 6e-4,
                         measure(scene, graph_text(tracer(256), kEvenSky))});
    }
  // A white room with a window: after any number of bounces, light 1 is light 1.
  Scene room;
  room.use_material(surface(1.0, 0.8, 0.0));
  for (int side = 0; side < 5; ++side) {
    const double a = 0.5 * kPi * side;
    const dmat4 turn =
        side < 4 ? glm::rotate(dmat4(1.0), a, dvec3(1, 0, 0)) : glm::rotate(dmat4(1.0), 0.5 * kPi, dvec3(0, 0, 1));
    const float h = 1.0F;
    room.add_mesh({-h, -1, -h, -h, -1, h, h, -1, h, h, -1, -h}, {}, {0, 1, 2, 0, 2, 3}, turn);
  }
  room.look({-0.9, 0.3, 0.2}, {0.2, -1.0, 0.0}, 0.5);
  answers.push_back({"white room with a window", 1.0, 4e-3, measure(room, graph_text(tracer(1024), kEvenSky))});
}

void add_albedo_answers(std::vector<Answer>& answers) {
  for (const bool is_compensated : {true, false})
    for (const double roughness : {0.1, 0.5, 1.0})
      for (const double metalness : {0.0, 1.0}) {
        Scene scene;
        const HeddleMaterial record = surface(0.7, roughness, metalness);
        scene.use_material(record);
        scene.add_floor({0, 0, 0}, 5.0);
        look_at_floor(scene, 0.5);
        const heddle_surface_point point = point_of(record);
        double rgb[3];
        material_service().albedo(&point, 0.5, 0, is_compensated ? 1 : 0, rgb);
        const std::string more =
            std::string("params.multiple_scattering = ") + (is_compensated ? "true" : "false") + "\n";
        answers.push_back({std::string(is_compensated ? "albedo " : "albedo of single scattering ") +
                               std::to_string(roughness) + " " + std::to_string(metalness),
                           rgb[0], 6e-4, measure(scene, graph_text(tracer(512, more), kEvenSky))});
      }
}

void add_layer_answers(std::vector<Answer>& answers) {
  // The role transparency's H1 over an even sky of 1, and its H7.
  for (const int layers : {1, 4}) {
    const double a = 0.3, c = 0.25;
    Scene scene;
    HeddleMaterial record = surface(c, 1.0, 0.0);
    record.base_color[3] = static_cast<float>(a);
    record.alpha_mode = HEDDLE_ALPHA_BLEND;
    record.flags = HEDDLE_MATERIAL_UNLIT;
    scene.use_material(record);
    for (int i = 0; i < layers; ++i) scene.add_floor({0, -0.1 * i, 0}, 5.0);
    look_at_floor(scene, 0.8);
    const double open = std::pow(1 - a, layers);
    answers.push_back({std::to_string(layers) + " unlit layers", c * (1 - open) + open, 1e-6,
                       measure(scene, graph_text(tracer(256), kEvenSky))});
  }
  Scene scene;
  HeddleMaterial clear = surface(1.0, 0.3, 0.0);
  clear.transmission = 1.0F;
  scene.use_material(clear);
  for (const double height : {0.0, -0.2}) scene.add_floor({0, height, 0}, 5.0);
  look_at_floor(scene, 0.5);
  answers.push_back({"two clear layers in a furnace", 1.0, 1e-3, measure(scene, graph_text(tracer(256), kEvenSky))});

  // Light through a clear layer is what the layer leaves: a sun straight above a floor below it.
  Scene below;
  below.use_material(clear);
  below.add_floor({0, 0.5, 0}, 0.2);
  const HeddleMaterial record = surface(0.5, 1.0, 0.0);
  below.use_material(record);
  below.add_floor({0, 0, 0}, 5.0);
  below.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0, -1, 0}, 1.0));
  look_at_floor(below, 0.6);
  heddle_surface_point black = point_of(clear);
  std::fill(std::begin(black.base_color), std::end(black.base_color), 0.0);
  double specular[3];
  material_service().albedo(&black, 1.0, 2, 1, specular);
  answers.push_back({"a sun through a clear layer", brdf(record, view_of(0.6), {0, 1, 0}) * (1 - specular[0]), 1e-5,
                     measure(below, graph_text(tracer(64, "params.bounces = 1\n")))});
}

const std::vector<Answer>& answers() {
  static const std::vector<Answer> all = [] {
    std::vector<Answer> made;
    add_rectangle_answers(made);
    add_ball_answers(made);
    add_glow_answers(made);
    add_furnace_answers(made);
    add_albedo_answers(made);
    add_layer_answers(made);
    return made;
  }();
  return all;
}

double z_of(const Answer& answer, double truth) {
  const double off = std::max(std::abs(answer.measured.mean.x - truth) - answer.model_error * truth, 0.0);
  // Float32 images round at 2^-24 of the value.
  return off / std::max(answer.measured.standard_error.x, 1e-7 * truth);
}

TEST(PathTracerClosedForms, AreMetWithinTheirErrors) {
  ASSERT_LE(answers().size(), 60U);
  double sum = 0.0;
  for (const Answer& answer : answers()) {
    const double z = z_of(answer, answer.truth);
    sum += z * z;
    EXPECT_LE(z, kLimit) << answer.name << ": " << answer.measured.mean.x << " +- " << answer.measured.standard_error.x
                         << ", should be " << answer.truth;
  }
  // Together too: a sum of as many squares has this mean at most, and the model errors only lessen it.
  const double count = static_cast<double>(answers().size());
  EXPECT_LE(sum, count + 4.0 * std::sqrt(2.0 * count));
}

TEST(PathTracerClosedForms, ABiasOfTwoPercentIsFoundInEveryOne) {
  for (const Answer& answer : answers()) {
    EXPECT_GT(z_of(answer, answer.truth * 1.02), kLimit)
        << answer.name << ": " << answer.measured.mean.x << " +- " << answer.measured.standard_error.x;
  }
}

TEST(PathTracerClosedForms, LightsWithoutSizeGiveTheServicesBrdfTimesTheirIrradiance) {
  const double h = 1.5;
  struct Case {
    const char* name;
    std::uint32_t type;
    dvec3 position;
    dvec3 to;           // whence the light comes, not normalized
    double irradiance;  // facing it
  };
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double slant = h / std::hypot(h, 0.9), t = std::clamp((slant - 0.6) / 0.3, 0.0, 1.0);
  const double squared = h * h + 0.81, window = 1 - squared * squared / 1e4;
  for (const Case& one :
       {Case{"point", HEDDLE_LIGHT_POINT, {0.9, h, 0}, {0.9, h, 0}, window / squared},
        Case{"spot", HEDDLE_LIGHT_SPOT, {0.9, h, 0}, {0.9, h, 0}, window / squared * t * t},
        Case{"cone", HEDDLE_LIGHT_CONE, {0.9, h, 0}, {0.9, h, 0}, window / squared * smooth(t)},
        Case{"wedge beside its segment", HEDDLE_LIGHT_WEDGE, {1.9, h, 0}, {0.9, h, 0}, window / squared * smooth(t)},
        Case{"capsule", HEDDLE_LIGHT_CAPSULE, {0.4, h, 0}, {0, h, 0}, (1 - h * h * h * h / 1e4) / (h * h)},
        Case{"box", HEDDLE_LIGHT_BOX, {0, 0.5, 0}, {0, 1, 0}, 1 - 0.0625 / 1e4},
        Case{"directional", HEDDLE_LIGHT_DIRECTIONAL, {0, 0, 0}, {0, 1, 0}, 1.0}}) {
    Scene scene;
    const HeddleMaterial record = surface(0.6, 0.6, 0.3);
    scene.use_material(record);
    scene.add_floor({0, 0, 0}, 5.0);
    HeddleLight lamp = light(one.type, {0, -1, 0}, 1.0);
    lamp.range = one.type == HEDDLE_LIGHT_DIRECTIONAL ? 0.0F : 10.0F;
    lamp.tangent[0] = 1.0F;
    lamp.tangent[1] = lamp.tangent[2] = 0.0F;
    lamp.segment_length = 2.0F;
    for (float& side : lamp.half_extent) side = 2.0F;
    scene.add_light(lamp, one.position);
    look_at_floor(scene, 0.7);
    const dvec3 L = glm::normalize(one.to);
    const double truth = brdf(record, view_of(0.7), L) * L.y * one.irradiance;
    const Measured measured = measure(scene, graph_text(tracer(8, "params.filter = \"point\"\n")));
    EXPECT_NEAR(measured.mean.x, truth, 2e-3 * truth) << one.name;
    EXPECT_LT(measured.standard_error.x, 1e-6 * truth) << one.name;
  }
}

}  // namespace
