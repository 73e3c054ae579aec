// SPDX-License-Identifier: Apache-2.0
// ambient_occlusion/baked: the hard cases of its role, with bakes of their own; where values are looked up; what a
// frame costs that finds its artifact.
#include "parsed.hpp"
#include "roles/bake_visibility/baking.hpp"

#include <fmt/format.h>

#include <fstream>

namespace {

using namespace baking;
using rendering::Image;

/// A job of its own beside the cache, and the frame that shows it.
std::string frame(const std::vector<std::string>& parameters, const std::string& technique = "depth_maps") {
  const auto folder = std::filesystem::path(std::getenv("HEDDLE_CACHE"));
  std::filesystem::create_directories(folder);
  static int count = 0;
  const std::string file = (folder / ("bake" + std::to_string(count++) + ".toml")).string();
  std::ofstream job_file(file);
  job_file << job(technique);
  for (const std::string& parameter : parameters) job_file << "params." << parameter << '\n';
  return "extent = [96, 64]\noutput = \"ao.visibility\"\n[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\n"
         "params.precision = \"float32\"\n[[pass]]\nname = \"ao\"\nrole = \"ambient_occlusion\"\ntechnique = "
         "\"baked\"\n"
         "inputs.occlusion = \"" +
         file + "#occlusion\"\n";
}

/// Position of each pixel, at the origin where there is no surface.
struct Shown {
  Image visibility, depth;
};
Shown show(Scene& scene, const Graph& graph) {
  check(heddle_graph_keep(graph.handle, "gbuffer.depth"));
  check(heddle_render(graph.handle, scene.handle, nullptr));
  Shown out;
  for (auto [image, port] : {std::pair(&out.visibility, "ao.visibility"), std::pair(&out.depth, "gbuffer.depth")}) {
    heddle_image read{};
    read.struct_size = sizeof read;
    check(heddle_read(graph.handle, port, 0, 0, &read));
    *image = {read.width, read.height, read.channels, {}};
    if (read.pixels != nullptr)
      image->pixels.assign(read.pixels, read.pixels + std::size_t{read.width} * read.height * read.channels);
  }
  return out;
}

TEST(BakedOcclusion, H1APlaneIsOpenAndH3SoIsWhatHasNoSurface) {
  Scene scene;
  scene.add_floor(dvec3(0), 1);
  scene.look(dvec3(0, 0.6, 3), dvec3(0));
  const Graph graph(frame({"directions = 64", "resolution = 128"}));
  const Shown shown = show(scene, graph);
  std::size_t floor = 0;
  for (std::size_t i = 0; i < shown.visibility.pixels.size(); ++i) {
    EXPECT_EQ(shown.visibility.pixels[i], 1);
    floor += std::isfinite(shown.depth.pixels[i]) ? 1 : 0;
  }
  EXPECT_GT(floor, 300U);
  EXPECT_LT(floor, shown.depth.pixels.size());
}

TEST(BakedOcclusion, H2AClosedRoomIsClosed) {
  Scene scene;
  add_room(scene);
  scene.look(dvec3(0, 0, 0.5), dvec3(0.3, -0.2, -1), 1.5);
  // The bias reaches 8 texels of 2 sqrt(3) m / 1020, 28 mm: elements that lie 50 mm inside of the rims see no other
  // side but along the wall: (texel / d)^2 and one direction (role bake_visibility, H2). Of those 10 mm inside, grazing
  // directions reach over the edge.
  const float grazing = 2 * std::sqrt(3.0F) / 1020 / 0.05F;
  for (const auto& [inset, most] :
       {std::pair("inset = 0.2", grazing * grazing + grazing * 4 / 128), std::pair("inset = 0.04", 0.1F)}) {
    const Graph graph(frame({"directions = 128", "resolution = 1024", "spacing = 0.25", inset}));
    float largest = 0;
    for (const float v : show(scene, graph).visibility.pixels) largest = std::max(largest, v);
    EXPECT_LE(largest, most) << inset;
  }
}

/// The ball over a plane of role bake_visibility's H3, at every pixel of the plane; all lengths times `scale`.
void expect_ball(double scale, const std::vector<std::string>& parameters, const std::string& technique) {
  Scene scene;
  constexpr double kRadius = 0.4, kHeight = 0.7;
  scene.add_floor(dvec3(0), 2 * scale);
  scene.add_sphere(dvec3(0, kHeight * scale, 0), kRadius * scale, 48);
  const dvec3 eye = dvec3(0, 2.5, 2.5) * scale;
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  camera.vertical_angle = 1;
  camera.near_distance = 0.01 * scale;
  const rendering::dquat rotation = glm::quatLookAt(glm::normalize(-eye), dvec3(0, 1, 0));
  for (int i = 0; i < 3; ++i) camera.position[i] = eye[i];
  camera.rotation[0] = rotation.x;
  camera.rotation[1] = rotation.y;
  camera.rotation[2] = rotation.z;
  camera.rotation[3] = rotation.w;
  std::uint32_t id = 0;
  check(heddle_scene_add_camera(scene.handle, nullptr, &camera, &id));
  check(heddle_scene_use_camera(scene.handle, id));
  const Graph graph(frame(parameters, technique));
  const Shown shown = show(scene, graph);
  double squares = 0, most = 0;
  std::size_t count = 0;
  const double tangent = std::tan(0.5);
  for (std::uint32_t y = 0; y < 64; ++y)
    for (std::uint32_t x = 0; x < 96; ++x) {
      const double d = static_cast<double>(shown.depth.at(x, y));
      if (!std::isfinite(d)) continue;
      const dvec3 forward = glm::normalize(-eye), right(1, 0, 0), up = glm::cross(right, forward);
      const dvec3 p = (eye + d * (forward + right * (tangent * 1.5 * ((x + 0.5) / 48 - 1)) -
                                  up * (tangent * ((y + 0.5) / 32 - 1)))) /
                      scale;
      if (std::abs(p.y) > 1e-3 || std::max(std::abs(p.x), std::abs(p.z)) > 1.8) continue;
      const double d2 = glm::dot(p, p) - p.y * p.y + kHeight * kHeight;
      const double expected = 1 - kRadius * kRadius / d2 * kHeight / std::sqrt(d2);
      const double error = static_cast<double>(shown.visibility.at(x, y)) - expected;
      squares += error * error;
      most = std::max(most, std::abs(error));
      ++count;
    }
  EXPECT_GT(count, 1000U);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(count)), 0.008) << technique << ", scale " << scale;
  EXPECT_LT(most, 0.03) << technique << ", scale " << scale;
}

TEST(BakedOcclusion, H4AndH5LookupsFollowClosedFormsAtEveryScale) {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    const std::string spacing = "spacing = " + fmt::format("{}", 0.13 * scale);
    expect_ball(scale, {"directions = 512", "resolution = 256", spacing}, "depth_maps");
  }
  expect_ball(1, {"directions = 1024", "spacing = 0.13"}, "ray_traced");
}

TEST(BakedOcclusion, GoesWithWhatMovesAndIsNotBakedAgain) {
  Scene scene;
  scene.add_floor(dvec3(0), 1);
  scene.add_box(dvec3(-0.3, 0, -0.3), dvec3(0.3, 0.5, 0.3));
  scene.look(dvec3(0, 2, 2), dvec3(0));
  const Graph graph(frame({"directions = 128", "resolution = 256", "spacing = 0.25"}));
  const Shown before = show(scene, graph);
  // Both move away under the camera's eyes, and the camera with them: the same picture.
  const dmat4 moved = glm::translate(dmat4(1.0), dvec3(0.5, 0, 0));
  for (const std::uint32_t id : {0U, 1U}) {
    const dmat4 place =
        id == 0 ? moved : moved * glm::scale(glm::translate(dmat4(1.0), dvec3(0, 0.25, 0)), dvec3(0.6, 0.5, 0.6));
    check(heddle_scene_set_instance(scene.handle, id, &place[0][0]));
  }
  scene.look(dvec3(0.5, 2, 2), dvec3(0.5, 0, 0));
  const Shown after = show(scene, graph);
  double most = 0;
  for (std::size_t i = 0; i < before.visibility.pixels.size(); ++i)
    most = std::max(most, std::abs(static_cast<double>(before.visibility.pixels[i] - after.visibility.pixels[i])));
  EXPECT_LT(most, 1e-4);
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  const Json stats = parsed::json(text);
  // The values were uploaded in the first frame, and the job did not run again: what is left are places and views.
  EXPECT_EQ(stats["counters"]["dispatches"], 0);
  EXPECT_LT(stats["counters"]["uploaded_bytes"], 4096);
  EXPECT_EQ(stats["artifacts"][0]["port"], "occlusion");
}

TEST(BakedOcclusion, TexelsAreLookedUpWithTheirCoordinates) {
  Scene scene;
  // A floor whose texture coordinates are its own, and a wall on its far side.
  std::vector<float> positions{-1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, -1},
      uvs{0.1F, 0.1F, 0.1F, 0.9F, 0.9F, 0.9F, 0.9F, 0.1F};
  scene.add_mesh(positions, {}, {0, 1, 2, 0, 2, 3}, dmat4(1.0), uvs);
  scene.add_box(dvec3(-4, 0, -1.2), dvec3(4, 2, -1));
  scene.look(dvec3(0, 2, 1), dvec3(0, 0, 0));
  const Shown texels =
      show(scene, Graph(frame({"elements = \"texels\"", "spacing = 0.05", "directions = 128", "resolution = 512"})));
  const Shown lattice = show(scene, Graph(frame({"spacing = 0.05", "directions = 128", "resolution = 512"})));
  double most = 0;
  for (std::size_t i = 0; i < texels.visibility.pixels.size(); ++i)
    most = std::max(most, std::abs(static_cast<double>(texels.visibility.pixels[i] - lattice.visibility.pixels[i])));
  EXPECT_LT(most, 0.05);
}

}  // namespace
