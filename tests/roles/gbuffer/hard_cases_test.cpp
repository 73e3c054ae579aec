// SPDX-License-Identifier: Apache-2.0
// The hard cases of role gbuffer for gbuffer/raster, and its motion and background.
#include "roles/rendering.hpp"

namespace {

using namespace rendering;

constexpr std::uint32_t kSize = 128;

struct Frame {
  Image depth, normal, normal_geometric, base_color, motion;
};

class Gbuffer {
 public:
  explicit Gbuffer(const char* precision = "float32")
      : graph_(
            "extent = [128, 128]\noutput = \"gbuffer.depth\"\n[[pass]]\nname = \"gbuffer\"\nrole = "
            "\"gbuffer\"\ntechnique = \"raster\"\nparams.precision = \"" +
            std::string(precision) + "\"\n") {
    for (const char* port : {"gbuffer.normal", "gbuffer.normal_geometric", "gbuffer.base_color", "gbuffer.motion"})
      graph_.keep(port);
  }
  Frame render(Scene& scene) {
    graph_.render(scene);
    return {graph_.read("gbuffer.depth"), graph_.read("gbuffer.normal"), graph_.read("gbuffer.normal_geometric"),
            graph_.read("gbuffer.base_color"), graph_.read("gbuffer.motion")};
  }

 private:
  Graph graph_;
};

dvec3 normal_at(const Image& image, std::uint32_t x, std::uint32_t y) {
  dvec3 v(image.at(x, y, 0), image.at(x, y, 1), 0.0);
  v.z = 1.0 - std::abs(v.x) - std::abs(v.y);
  const double fold = std::max(-v.z, 0.0);
  v.x -= std::copysign(fold, v.x);
  v.y -= std::copysign(fold, v.y);
  return glm::normalize(v);
}

/// Image plane at distance 1 of a camera that looks along its -Z.
dvec3 view_ray(std::uint32_t x, std::uint32_t y, double vertical_angle) {
  const double half = std::tan(0.5 * vertical_angle);
  return {(2.0 * (x + 0.5) / kSize - 1.0) * half, (1.0 - 2.0 * (y + 0.5) / kSize) * half, -1.0};
}

/// Largest relative error of depth on a floor 1 m below the camera that fills the view.
double worst_depth_of_floor(double vertical_angle, double pitch) {
  Scene scene;
  scene.add_floor({0, -1, 0}, 200.0);
  scene.look({0, 0, 0}, {0, std::sin(pitch), -std::cos(pitch)}, vertical_angle);
  const Frame frame = Gbuffer().render(scene);
  double worst = 0.0;
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const dvec3 ray = view_ray(x, y, vertical_angle);
      const double expected = 1.0 / -(ray.y * std::cos(pitch) + std::sin(pitch));
      worst = std::max(worst, std::abs(static_cast<double>(frame.depth.at(x, y)) / expected - 1.0));
    }
  return worst;
}

TEST(Gbuffer, H1GrazingPlaneKeepsItsDepthWithinOneInAMillion) {
  // 3 to 9 degrees above the floor.
  EXPECT_LE(worst_depth_of_floor(0.1, -0.105), 1e-6);
  // From 1.2 to 40 m in one triangle, whose 1/w is interpolated: a ratio of 33 times 2^-24, as the README says.
  EXPECT_LE(worst_depth_of_floor(0.7, -0.375), 2.5e-6);
}

TEST(Gbuffer, H2AHundredKilometresAwayTheImageIsTheSame) {
  Frame frames[2];
  for (int i = 0; i < 2; ++i) {
    Scene scene(i == 0 ? dvec3(0) : dvec3(1e5, -1e5, 1e5));
    scene.add_sphere({0.3, 0.1, -3}, 1.0, 32);
    scene.add_floor({0, -1, 0}, 20.0);
    scene.look({0, 0, 0}, {0, -0.2, -1}, 0.8);
    frames[i] = Gbuffer().render(scene);
  }
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const double near_depth = static_cast<double>(frames[0].depth.at(x, y));
      const double far_depth = static_cast<double>(frames[1].depth.at(x, y));
      if (std::isinf(near_depth) || std::isinf(far_depth)) {
        EXPECT_EQ(near_depth, far_depth) << x << ", " << y;
        continue;
      }
      // float64 holds 1e5 m to 1.5e-11 m: what is left is float32's 6e-8, a few times over.
      EXPECT_NEAR(far_depth, near_depth, 1e-6 * near_depth) << x << ", " << y;
      EXPECT_LT(glm::length(normal_at(frames[0].normal, x, y) - normal_at(frames[1].normal, x, y)), 1e-5);
    }
}

void expect_outward_sphere(const Frame& frame, const dvec3& center, double radius, double angle) {
  int seen = 0;
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const double depth = static_cast<double>(frame.depth.at(x, y));
      if (std::isinf(depth)) continue;
      const dvec3 position = view_ray(x, y, angle) * depth;
      // 2e-3: facets of 128 rings lie below the sphere by (pi / 128)^2 / 2 and their normals are interpolated.
      EXPECT_NEAR(glm::length(position - center), radius, 2e-3 * radius);
      EXPECT_LT(glm::length(normal_at(frame.normal, x, y) - (position - center) / radius), 0.01);
      // Facets are tilted by up to half their diagonal: pi / 128, its half along each axis.
      EXPECT_LT(glm::length(normal_at(frame.normal_geometric, x, y) - (position - center) / radius), 0.026);
      EXPECT_LT(position.z, center.z + radius) << "the far side shows";
      EXPECT_GT(glm::dot(center - position, view_ray(x, y, angle)), -0.05) << "the far side shows";
      ++seen;
    }
  EXPECT_GT(seen, 1000);
}

TEST(Gbuffer, H3AMirroredInstanceShowsItsFrontAndOutwardNormals) {
  Scene scene;
  scene.add_sphere({0, 0, -3}, 1.0, 128);
  // The same mesh (id 0) once more, mirrored; the first goes out of view.
  const double mirrored[16] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.2, 0, -3, 1};
  const double away[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 100, 1};
  std::uint32_t id = 0;
  check(heddle_scene_add_instance(scene.handle, nullptr, 0, mirrored, &id));
  check(heddle_scene_set_instance(scene.handle, 0, away));
  scene.look({0, 0, 0}, {0, 0, -1}, 0.9);
  expect_outward_sphere(Gbuffer().render(scene), {0.2, 0, -3}, 1.0, 0.9);
}

TEST(Gbuffer, H4ADoubleSidedSurfaceSeenFromBehindFacesTheViewer) {
  for (const bool from_behind : {false, true}) {
    Scene scene;
    HeddleMaterial record = Scene::grey();
    record.flags = HEDDLE_MATERIAL_DOUBLE_SIDED;
    scene.use_material(record);
    scene.add_floor({0, 0, 0}, 5.0);
    scene.look({0, from_behind ? -2.0 : 2.0, 0}, {0, 0, 0}, 0.8);
    const Frame frame = Gbuffer().render(scene);
    const double side = from_behind ? -1.0 : 1.0;
    for (const Image* image : {&frame.normal, &frame.normal_geometric})
      EXPECT_LT(glm::length(normal_at(*image, 64, 64) - dvec3(0, side, 0)), 1e-6);
    EXPECT_NEAR(static_cast<double>(frame.depth.at(64, 64)), 2.0, 1e-6);
  }
  // A single-sided one is not there.
  Scene scene;
  scene.add_floor({0, 0, 0}, 5.0);
  scene.look({0, -2, 0}, {0, 0, 0}, 0.8);
  EXPECT_TRUE(std::isinf(Gbuffer().render(scene).depth.at(64, 64)));
}

TEST(Gbuffer, H5AMaskedSurfaceHasHolesWhereAlphaIsBelowTheCutoff) {
  // 8 x 8 texels over 128 x 128 pixels, alpha a checker of 40 and 220: bilinear filtering by hand in between.
  constexpr std::uint32_t kTexels = 8;
  std::vector<std::uint8_t> rgba;
  for (std::uint32_t i = 0; i < kTexels * kTexels; ++i)
    for (int c = 0; c < 4; ++c)
      rgba.push_back(static_cast<std::uint8_t>(c < 3 ? 255 : (i % kTexels + i / kTexels) % 2 == 0 ? 40 : 220));
  Scene scene;
  heddle_texture texture{};
  texture.struct_size = sizeof texture;
  texture.width = texture.height = kTexels;
  texture.is_srgb = 1;
  texture.wrap_u = texture.wrap_v = 0;
  texture.rgba = rgba.data();
  std::uint32_t texture_id = 0;
  check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &texture_id));
  HeddleMaterial record = Scene::grey();
  record.base_color[0] = record.base_color[1] = record.base_color[2] = 1.0F;
  record.alpha_mode = HEDDLE_ALPHA_MASK;
  record.alpha_cutoff = 0.4F;
  scene.use_material(record, texture_id);
  scene.add_mesh({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, {}, {0, 1, 2, 0, 2, 3},
                 glm::translate(dmat4(1.0), dvec3(0, 0, -1)), {0, 1, 1, 1, 1, 0, 0, 0});
  scene.look({0, 0, 0}, {0, 0, -1}, 0.5 * kPi);
  const Frame frame = Gbuffer().render(scene);
  const auto alpha = [&](int x, int y) {
    const int wrapped_x = (x + 8) % 8, wrapped_y = (y + 8) % 8;
    return rgba[static_cast<std::size_t>(wrapped_y * 8 + wrapped_x) * 4 + 3] / 255.0;
  };
  int holes = 0, solid = 0;
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      const double u = (x + 0.5) / 16.0 - 0.5, v = (y + 0.5) / 16.0 - 0.5;
      const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
      const double s = u - i, t = v - j;
      const double a = (1 - t) * ((1 - s) * alpha(i, j) + s * alpha(i + 1, j)) +
                       t * ((1 - s) * alpha(i, j + 1) + s * alpha(i + 1, j + 1));
      if (std::abs(a - 0.4) < 0.006) continue;  // filter weights have 8 bits: 2 x 0.7 / 256
      EXPECT_EQ(std::isinf(frame.depth.at(x, y)), a < 0.4) << x << ", " << y << " alpha " << a;
      (a < 0.4 ? holes : solid) += 1;
    }
  EXPECT_GT(holes, 2000);
  EXPECT_GT(solid, 2000);
}

TEST(GbufferRaster, BackgroundIsInfinitelyFarAndStill) {
  Scene scene;
  scene.add_sphere({0, 0, -3}, 0.5, 16);
  scene.look({0, 0, 0}, {0, 0, -1}, 0.9);
  for (const char* precision : {"packed", "float32"}) {
    const Frame frame = Gbuffer(precision).render(scene);
    EXPECT_TRUE(std::isinf(frame.depth.at(0, 0)) && frame.depth.at(0, 0) > 0.0F);
    EXPECT_EQ(frame.motion.at(0, 0, 0), 0.0F);
    EXPECT_EQ(frame.base_color.at(0, 0, 0), 0.0F);
    // Read back as stored: encoded, 0.5 is 187.5 of 255, either way.
    const double stored = std::string(precision) == "packed" ? 187.5 / 255.0 : 0.5;
    EXPECT_NEAR(static_cast<double>(frame.base_color.at(64, 64, 0)), stored, 0.6 / 255.0);
    EXPECT_EQ(frame.base_color.at(64, 64, 3), 1.0F);
  }
}

TEST(GbufferRaster, TrianglesSmallerThanAPixelTakeTheRightMip) {
  // Where helper invocations do not see the material, their texture coordinates are 0 and the last mip shows: grey.
  constexpr std::uint32_t kTexels = 8, kQuads = 150;
  std::vector<std::uint8_t> rgba;
  for (std::uint32_t i = 0; i < kTexels * kTexels; ++i) {
    const bool is_red = i % kTexels < kTexels / 2;
    for (const bool on : {is_red, false, !is_red, true}) rgba.push_back(on ? 255 : 0);
  }
  Scene scene;
  heddle_texture texture{};
  texture.struct_size = sizeof texture;
  texture.width = texture.height = kTexels;
  texture.is_srgb = 1;
  texture.wrap_u = texture.wrap_v = 2;
  texture.rgba = rgba.data();
  std::uint32_t texture_id = 0;
  check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &texture_id));
  HeddleMaterial record = Scene::grey();
  record.base_color[0] = record.base_color[1] = record.base_color[2] = 1.0F;
  scene.use_material(record, texture_id);
  std::vector<float> positions, uvs;
  std::vector<std::uint32_t> indices;
  for (std::uint32_t y = 0; y <= kQuads; ++y)
    for (std::uint32_t x = 0; x <= kQuads; ++x) {
      const float u = static_cast<float>(x) / kQuads, v = static_cast<float>(y) / kQuads;
      for (const float value : {2 * u - 1, 1 - 2 * v, 0.0F}) positions.push_back(value);
      uvs.push_back(u);
      uvs.push_back(v);
      if (x == kQuads || y == kQuads) continue;
      const std::uint32_t a = y * (kQuads + 1) + x, b = a + kQuads + 1;
      for (const std::uint32_t index : {a, b, b + 1, a, b + 1, a + 1}) indices.push_back(index);
    }
  scene.add_mesh(positions, {}, indices, glm::translate(dmat4(1.0), dvec3(0, 0, -1)), uvs);
  scene.look({0, 0, 0}, {0, 0, -1}, 0.5 * kPi);
  const Frame frame = Gbuffer().render(scene);
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      if (x >= 56 && x < 72) continue;  // between the two colours
      EXPECT_NEAR(static_cast<double>(frame.base_color.at(x, y, 0)), x < 64 ? 1.0 : 0.0, 1e-3) << x << ", " << y;
      EXPECT_NEAR(static_cast<double>(frame.base_color.at(x, y, 2)), x < 64 ? 0.0 : 1.0, 1e-3) << x << ", " << y;
    }
}

TEST(GbufferRaster, EveryTextureHasItsOwnTransformAndFilter) {
  // Two texels, black and white, over a quad that fills the view; the base colour's image is shown twice, the
  // emission's upside down and once, with square texels.
  const std::vector<std::uint8_t> rgba = {0, 0, 0, 255, 255, 255, 255, 255};
  Scene scene;
  std::uint32_t ids[2] = {0, 0};
  for (std::uint32_t i = 0; i < 2; ++i) {
    heddle_texture texture{};
    texture.struct_size = sizeof texture;
    texture.width = 2;
    texture.height = 1;
    texture.filter = HEDDLE_FILTER_NEAREST_MAGNIFIED | HEDDLE_FILTER_NEAREST_MINIFIED | HEDDLE_FILTER_FINEST_LEVEL;
    texture.rgba = rgba.data();
    check(heddle_scene_add_texture(scene.handle, nullptr, &texture, &ids[i]));
  }
  heddle_material material{};
  material.struct_size = sizeof material;
  std::fill(std::begin(material.textures), std::end(material.textures), HEDDLE_NONE);
  material.textures[HEDDLE_TEXTURE_BASE_COLOR] = ids[0];
  material.textures[HEDDLE_TEXTURE_EMISSIVE] = ids[1];
  material.record = Scene::grey();
  for (int i = 0; i < 3; ++i) material.record.base_color[i] = material.record.emissive[i] = 1.0F;
  material.record.uv_rotation_scale[0] = 2.0F;
  material.record.uv_rotation_scale_4[1] = -1.0F;  // u' = v, v' = -u
  material.record.uv_rotation_scale_4[2] = 1.0F;
  std::uint32_t id = 0;
  check(heddle_scene_add_material(scene.handle, nullptr, &material, &id));
  const std::vector<float> positions = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, uvs = {0, 1, 1, 1, 1, 0, 0, 0};
  const std::vector<std::uint32_t> indices = {0, 1, 2, 0, 2, 3};
  heddle_mesh mesh{};
  mesh.struct_size = sizeof mesh;
  mesh.vertex_count = 4;
  mesh.index_count = 6;
  mesh.positions = positions.data();
  mesh.uv0 = uvs.data();
  mesh.indices = indices.data();
  std::uint32_t mesh_id = 0;
  check(heddle_scene_add_mesh(scene.handle, nullptr, &mesh, id, &mesh_id));
  const dmat4 place = glm::translate(dmat4(1.0), dvec3(0, 0, -1));
  check(heddle_scene_add_instance(scene.handle, nullptr, mesh_id, &place[0][0], &id));
  scene.look({0, 0, 0}, {0, 0, -1}, 0.5 * kPi);
  Graph graph(
      "extent = [128, 128]\noutput = \"gbuffer.base_color\"\n[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\n"
      "technique = \"raster\"\nparams.precision = \"float32\"\n");
  graph.keep("gbuffer.emissive");
  const Image base_color = graph.image(scene), emissive = graph.read("gbuffer.emissive");
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      ASSERT_EQ(base_color.at(x, y, 0), x / 32 % 2 == 0 ? 0.0F : 1.0F) << x << ", " << y;
      ASSERT_EQ(emissive.at(x, y, 0), y < 64 ? 0.0F : 1.0F) << x << ", " << y;
    }
}

TEST(GbufferRaster, MotionIsPreviousMinusCurrentPixels) {
  Scene scene;
  scene.add_mesh({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, {}, {0, 1, 2, 0, 2, 3},
                 glm::translate(dmat4(1.0), dvec3(0, 0, -2)));
  scene.look({0, 0, 0}, {0, 0, -1}, 0.5 * kPi);
  Gbuffer gbuffer;
  Frame frame = gbuffer.render(scene);
  EXPECT_NEAR(static_cast<double>(frame.motion.at(64, 64, 0)), 0.0, 1e-4);
  // 0.25 m to the right and 0.125 m up at a distance of 2 m, where 4 m are 128 pixels.
  const double moved[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.25, 0.125, -2, 1};
  check(heddle_scene_set_instance(scene.handle, 0, moved));
  frame = gbuffer.render(scene);
  EXPECT_NEAR(static_cast<double>(frame.motion.at(64, 64, 0)), -8.0, 1e-3);
  EXPECT_NEAR(static_cast<double>(frame.motion.at(64, 64, 1)), 4.0, 1e-3);
}

TEST(Gbuffer, H6TheGeometricNormalOfACoarseRoundMeshIsTheFacets) {
  constexpr std::uint32_t kRings = 6;
  constexpr double kAngle = 0.9;
  const dvec3 center(0.1, -0.2, -3);
  // As Scene::add_sphere makes it, in float32.
  const auto corner = [&](std::uint32_t i, std::uint32_t j) {
    const double theta = kPi * i / kRings, phi = kPi * j / kRings;
    const dvec3 p(std::sin(theta) * std::sin(phi), std::cos(theta), std::sin(theta) * std::cos(phi));
    return dvec3(glm::vec3(p)) + center;
  };
  std::vector<std::array<dvec3, 3>> facets;
  for (std::uint32_t i = 0; i < kRings; ++i)
    for (std::uint32_t j = 0; j < 2 * kRings; ++j) {
      facets.push_back({corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)});
      facets.push_back({corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)});
    }
  for (const bool is_parallel : {false, true}) {
    Scene scene;
    scene.add_sphere(center, 1.0, kRings);
    heddle_camera camera{};
    camera.struct_size = sizeof camera;
    camera.rotation[3] = 1;
    camera.vertical_angle = kAngle;
    constexpr double kHalf = 1.3;  // metres
    if (is_parallel) {
      camera.is_orthographic = 1;
      camera.vertical_angle = kHalf;
    }
    std::uint32_t id = 0;
    check(heddle_scene_add_camera(scene.handle, nullptr, &camera, &id));
    check(heddle_scene_use_camera(scene.handle, id));
    const Frame frame = Gbuffer().render(scene);
    int seen = 0;
    double worst = 0;
    for (std::uint32_t y = 0; y < kSize; ++y)
      for (std::uint32_t x = 0; x < kSize; ++x) {
        if (std::isinf(frame.depth.at(x, y))) continue;
        const dvec3 ray = view_ray(x, y, kAngle) / std::tan(0.5 * kAngle);
        const dvec3 origin = is_parallel ? dvec3(ray.x * kHalf, ray.y * kHalf, 0) : dvec3(0.0);
        const dvec3 direction = is_parallel ? dvec3(0, 0, -1) : view_ray(x, y, kAngle);
        double nearest = 1e30;  // metres between the pixel's facet, by its normal and depth, and one that is there
        const dvec3 normal = normal_at(frame.normal_geometric, x, y);
        double off = 2;
        for (const auto& [a, b, c] : facets) {
          const dvec3 n = glm::cross(b - a, c - a);
          if (glm::length(n) < 1e-9 || glm::dot(n, direction) >= 0) continue;
          const dvec3 p = origin + direction * (glm::dot(n, a - origin) / glm::dot(n, direction));
          // Rasterizers round vertices to 1/256 pixel: 3e-4 here, where a pixel is 20 mm.
          const double slack = 3e-4;
          const auto inside = [&](const dvec3& from, const dvec3& to) {
            return glm::dot(glm::cross(to - from, p - from), n) / glm::length(n) / glm::length(to - from) > -slack;
          };
          const bool is_there = (a == b || inside(a, b)) && (b == c || inside(b, c)) && (c == a || inside(c, a));
          if (!is_there) continue;
          nearest = std::min(nearest, std::abs(-p.z - static_cast<double>(frame.depth.at(x, y))));
          off = std::min(off, glm::length(normal - glm::normalize(n)));
        }
        if (nearest > 1) continue;  // an outline pixel that rounding let in
        ++seen;
        worst = std::max(worst, off);
      }
    // 2^-24 of 1/w over a pixel of 0.0075 per metre, twice.
    EXPECT_LT(worst, 1e-4) << (is_parallel ? "parallel" : "perspective");
    EXPECT_GT(seen, 2000);
  }
}

}  // namespace
