// SPDX-License-Identifier: Apache-2.0
// Motion of skinned and morphed meshes against the difference of two poses in float64. The poses are worked out here,
// from the same numbers as the file's, not by the host.
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "roles/rendering.hpp"
#include "unit/scene/gltf_file.hpp"

namespace {

using namespace rendering;
using heddle::scene::GltfFile;
using Json = nlohmann::json;

constexpr std::uint32_t kSize = 96;
constexpr int kCells = 12;  // of the sheet, along each side
constexpr double kAngle = 1.0;

/// A sheet of 2 m x 2 m that bends about two joints and bulges by a morph target.
struct Sheet {
  std::vector<float> positions, normals, bulge, weights;
  std::vector<std::uint8_t> joints;
  std::vector<std::uint16_t> indices;

  Sheet() {
    for (int j = 0; j <= kCells; ++j)
      for (int i = 0; i <= kCells; ++i) {
        const double x = 2.0 * i / kCells - 1.0, y = 2.0 * j / kCells - 1.0;
        for (const double value : {x, y, 0.0}) positions.push_back(static_cast<float>(value));
        for (const float value : {0.0F, 0.0F, 1.0F}) normals.push_back(value);
        for (const double value : {0.1 * y, 0.0, std::cos(1.3 * x) * std::cos(1.1 * y)})
          bulge.push_back(static_cast<float>(value));
        const auto upper = static_cast<float>(0.5 + 0.5 * x);
        for (const float value : {1.0F - upper, upper, 0.0F, 0.0F}) weights.push_back(value);
        for (const int value : {0, 1, 0, 0}) joints.push_back(static_cast<std::uint8_t>(value));
        if (i == kCells || j == kCells) continue;
        const auto a = static_cast<std::uint16_t>(j * (kCells + 1) + i);
        const auto b = static_cast<std::uint16_t>(a + kCells + 1);
        for (const int index : {a + 0, a + 1, b + 1, a + 0, b + 1, b + 0})
          indices.push_back(static_cast<std::uint16_t>(index));
      }
  }

  /// At time t the target's weight is t, joint 0 stands, joint 1 is turned by t about y and raised by 0.3 t; the whole
  /// node moves by (0.2 t, 0, 0) if there are no joints.
  [[nodiscard]] std::vector<dvec3> at(double t, bool is_skinned) const {
    std::vector<dvec3> posed;
    for (std::size_t i = 0; i < positions.size(); i += 3) {
      const dvec3 rest(positions[i], positions[i + 1], positions[i + 2]);
      const dvec3 p = rest + t * dvec3(bulge[i], bulge[i + 1], bulge[i + 2]);
      const double c = std::cos(kAngle * t), s = std::sin(kAngle * t);
      const dvec3 turned(c * p.x + s * p.z, p.y + 0.3 * t, -s * p.x + c * p.z);
      const double w0 = static_cast<double>(weights[i / 3 * 4]), w1 = static_cast<double>(weights[i / 3 * 4 + 1]);
      posed.push_back(is_skinned ? (w0 * p + w1 * turned) / (w0 + w1) : p + dvec3(0.2 * t, 0, 0));
    }
    return posed;
  }

  [[nodiscard]] std::string glb(bool is_skinned) const {
    using namespace heddle::scene;
    GltfFile file;
    Json primitive = {{"attributes", {{"POSITION", file.vec3(positions)}, {"NORMAL", file.vec3(normals)}}},
                      {"indices", file.indices(indices)},
                      {"targets", Json::array({{{"POSITION", file.vec3(bulge)}}})}};
    if (is_skinned) {
      primitive["attributes"]["JOINTS_0"] = file.accessor(kUnsignedByte, "VEC4", 4, joints);
      primitive["attributes"]["WEIGHTS_0"] = file.floats("VEC4", 4, weights);
      file.json["skins"] = Json::array({{{"joints", {1, 2}}}});
    }
    Json node = {{"mesh", file.mesh(primitive)}};
    if (is_skinned) node["skin"] = 0;
    file.node(node);
    file.node(Json::object());
    file.node(Json::object());
    const int times = file.floats("SCALAR", 1, {0, 1});
    const auto half = static_cast<float>(0.5 * kAngle);
    const std::vector<int> outputs = {file.floats("SCALAR", 1, {0, 1}),
                                      file.floats("VEC4", 4, {0, 0, 0, 1, 0, std::sin(half), 0, std::cos(half)}),
                                      file.vec3({0, 0, 0, 0, 0.3F, 0}), file.vec3({0, 0, 0, 0.2F, 0, 0})};
    const std::vector<std::pair<int, const char*>> targets = {
        {0, "weights"}, {2, "rotation"}, {2, "translation"}, {0, "translation"}};
    Json animation = {{"samplers", Json::array()}, {"channels", Json::array()}};
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      animation["samplers"].push_back({{"input", times}, {"output", outputs[i]}});
      animation["channels"].push_back(
          {{"sampler", i}, {"target", {{"node", targets[i].first}, {"path", targets[i].second}}}});
    }
    file.json["animations"] = Json::array({animation});
    return file.glb();
  }
};

/// The nearest triangle on a ray from the origin: weights of its corners; false if there is none, or if the ray passes
/// so near an edge that the rasterizer may see its neighbour.
bool hit(const std::vector<dvec3>& p, const std::vector<std::uint16_t>& indices, const dvec3& ray,
         std::size_t& triangle, dvec3& barycentric) {
  double nearest = 1e30;
  double margin = 0;
  for (std::size_t i = 0; i < indices.size(); i += 3) {
    const dvec3 &a = p[indices[i]], &b = p[indices[i + 1]], &c = p[indices[i + 2]];
    const dvec3 weights(glm::dot(ray, glm::cross(b, c)), glm::dot(ray, glm::cross(c, a)),
                        glm::dot(ray, glm::cross(a, b)));
    const double sum = weights.x + weights.y + weights.z;
    const double smallest = std::min({weights.x / sum, weights.y / sum, weights.z / sum});
    if (smallest < 0) continue;
    const dvec3 shares = weights / sum;
    const double distance = glm::length(shares.x * a + shares.y * b + shares.z * c);
    if (distance < nearest) {
      nearest = distance;
      triangle = i;
      barycentric = shares;
      margin = smallest;
    }
  }
  return nearest < 1e30 && margin > 0.02;
}

void expect_right_motion(bool is_skinned) {
  const Sheet sheet;
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("heddle_motion_" + std::to_string(getpid()) + ".glb");
  std::ofstream(path, std::ios::binary) << sheet.glb(is_skinned);
  Scene scene;
  check(heddle_scene_load(scene.handle, path.c_str()));
  std::filesystem::remove(path);
  constexpr double kFieldOfView = 0.9;
  const dvec3 eye(0.3, 0.2, 4);
  scene.look(eye, eye - dvec3(0, 0, 1), kFieldOfView);
  Graph graph(
      "extent = [96, 96]\noutput = \"gbuffer.motion\"\n[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\n"
      "technique = \"raster\"\nparams.precision = \"float32\"\n");
  const auto frame = [&](double time) {
    heddle_render_options options{};
    options.struct_size = sizeof options;
    options.time = time;
    check(heddle_render(graph.handle, scene.handle, &options));
    return graph.read();
  };
  frame(0.2);
  double before = 0.2;
  for (const double now : {0.3, 0.9, 0.4}) {
    const Image motion = frame(now);
    std::vector<dvec3> posed = sheet.at(now, is_skinned), earlier = sheet.at(before, is_skinned);
    for (std::vector<dvec3>* positions : {&posed, &earlier})
      for (dvec3& position : *positions) position -= eye;
    const double half = std::tan(0.5 * kFieldOfView);
    double fastest = 0, worst = 0;
    int seen = 0;
    for (std::uint32_t y = 0; y < kSize; ++y)
      for (std::uint32_t x = 0; x < kSize; ++x) {
        const dvec3 ray((2.0 * (x + 0.5) / kSize - 1.0) * half, (1.0 - 2.0 * (y + 0.5) / kSize) * half, -1.0);
        std::size_t triangle = 0;
        dvec3 shares(0.0);
        if (!hit(posed, sheet.indices, ray, triangle, shares)) continue;
        dvec3 point(0.0);
        for (int k = 0; k < 3; ++k) point += shares[k] * earlier[sheet.indices[triangle + static_cast<std::size_t>(k)]];
        const double px = (point.x / (-point.z * half) * 0.5 + 0.5) * kSize - (x + 0.5);
        const double py = (-point.y / (-point.z * half) * 0.5 + 0.5) * kSize - (y + 0.5);
        worst = std::max({worst, std::abs(static_cast<double>(motion.at(x, y, 0)) - px),
                          std::abs(static_cast<double>(motion.at(x, y, 1)) - py)});
        fastest = std::max(fastest, std::hypot(px, py));
        ++seen;
      }
    EXPECT_GT(seen, 1500);
    EXPECT_GT(fastest, 0.5);
    // Corners are snapped to 1/256 px, so what is interpolated at a pixel belongs to a point up to 1/512 px away: times
    // the gradient of motion, below 1 here.
    EXPECT_LT(worst, 2e-3) << "from " << before << " to " << now << ", " << fastest << " px";
    testing::Test::RecordProperty("worst_px", std::to_string(worst));
    before = now;
  }
  // A frame at the same time again: what moved has arrived. Each of the two projections of a point rounds six times
  // (four products in a sum, a division, a scale), by half a unit in the last place of half the width.
  const Image still = frame(before);
  for (const float value : still.pixels) ASSERT_LE(std::abs(value), 2 * 6 * 0.5F * kSize * 0x1p-24F);
}

TEST(GbufferMotion, OfASkinnedAndMorphedMeshIsTheDifferenceOfItsPoses) {
  expect_right_motion(true);
}

TEST(GbufferMotion, OfAMorphedMeshOnAMovingNodeIsTheDifferenceOfItsPoses) {
  expect_right_motion(false);
}

TEST(GbufferMotion, AfterACutNothingHasMoved) {
  const Sheet sheet;
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("heddle_cut_" + std::to_string(getpid()) + ".glb");
  std::ofstream(path, std::ios::binary) << sheet.glb(true);
  Scene scene;
  check(heddle_scene_load(scene.handle, path.c_str()));
  std::filesystem::remove(path);
  scene.look({0, 0, 4}, {0, 0, 0}, 0.9);
  Graph graph(
      "extent = [96, 96]\noutput = \"gbuffer.motion\"\n[[pass]]\nname = \"gbuffer\"\nrole = \"gbuffer\"\n"
      "technique = \"raster\"\nparams.precision = \"float32\"\n");
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.time = 0.1;
  check(heddle_render(graph.handle, scene.handle, &options));
  options.time = 0.9;
  options.cut = 1;
  check(heddle_render(graph.handle, scene.handle, &options));
  for (const float value : graph.read().pixels) ASSERT_NEAR(value, 0.0F, 1e-4F);  // float32 of pixels to 96
}

}  // namespace
