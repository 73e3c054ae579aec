// SPDX-License-Identifier: Apache-2.0
// What tests of bakes need: a scene's artifact, its report, and where its values lie.
#pragma once

#include "parsed.hpp"
#include "roles/rendering.hpp"

#include "baked_visibility.hpp"

#include <nlohmann/json.hpp>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>

#include <unistd.h>

namespace baking {

using namespace baked_visibility;
using rendering::check;
using rendering::dmat4;
using rendering::dvec3;
using rendering::Graph;
using rendering::Scene;
using Json = nlohmann::json;

/// A cache of the executable's own, empty at first.
inline const bool kHasCache = [] {
  const auto folder = std::filesystem::path(testing::TempDir()) / ("heddle_baking_" + std::to_string(getpid()));
  std::filesystem::remove_all(folder);
  setenv("HEDDLE_CACHE", folder.c_str(), 1);
  struct End : testing::Environment {
    explicit End(std::filesystem::path path) : folder(std::move(path)) {}
    void TearDown() override { std::filesystem::remove_all(folder); }
    std::filesystem::path folder;
  };
  testing::AddGlobalTestEnvironment(new End(folder));
  return true;
}();

/// The next bake knows no artifact and no part of one.
inline void forget_all() {
  std::filesystem::remove_all(std::filesystem::path(std::getenv("HEDDLE_CACHE")) / "artifacts");
}

struct Result {
  Baked baked;
  std::vector<std::byte> bytes;
  Json report;          // the values of the last row
  std::string remarks;  // the messages of those before it that are warnings, a line each
  std::string origin;
};

/// `above`: passes before the one that bakes.
inline std::string job(const std::string& technique, const std::string& above = {}) {
  return "kind = \"job\"\n" + above + "[[pass]]\nname = \"bake\"\nrole = \"bake_visibility\"\ntechnique = \"" +
         technique + "\"\n";
}

/// `settings`: parameters, "spacing=1".
inline Result bake(Scene& scene, const std::string& technique, std::vector<std::string> settings,
                   const std::string& above = {}) {
  for (std::string& setting : settings) setting.insert(0, "bake.params.");
  const Graph graph(job(technique, above), settings);
  const char* text = nullptr;
  check(heddle_job_run(graph.handle, scene.handle, nullptr, &text));
  Result result;
  if (text == nullptr) return result;
  const Json told = parsed::json(text);
  result.origin = told["artifacts"][0]["origin"];
  result.report = told["reports"][0]["rows"].back()["values"];
  for (const Json& row : told["reports"][0]["rows"])
    if (row["level"] == "warning") result.remarks += row["message"].get<std::string>() + "\n";
  const void* data = nullptr;
  std::uint64_t size = 0;
  check(heddle_job_artifact(graph.handle, "bake.occlusion", &data, &size));
  result.bytes.assign(static_cast<const std::byte*>(data), static_cast<const std::byte*>(data) + size);
  std::string problem;
  const auto read = from_bytes(result.bytes, problem);
  EXPECT_TRUE(read) << problem;
  if (read) result.baked = *read;
  return result;
}

struct Point {
  dvec3 position;  // object space
  double visibility = 0;
  dvec3 bent;
};
/// Every lattice point of an instance once.
inline std::vector<Point> points(const Baked& baked, std::uint32_t instance) {
  const BakedInstance& record = baked.instances.at(instance);
  EXPECT_EQ(record.kind, kLattice);
  std::map<std::uint32_t, Point> found;
  for (std::uint32_t t = 0; t < record.triangle_count; ++t) {
    const BakedTriangle& triangle = baked.triangles[record.first_triangle + t];
    const auto corner = [&](std::size_t k) {
      return dvec3(triangle.corners[3 * k], triangle.corners[3 * k + 1], triangle.corners[3 * k + 2]);
    };
    const std::uint32_t r = triangle.resolution;
    for (std::uint32_t j = 0; j <= r; ++j)
      for (std::uint32_t i = 0; i + j <= r; ++i) {
        const std::uint32_t value = record.first_value + baked.lattice[triangle.first_lattice + lattice_row(r, j) + i];
        const auto bent = unpack_direction(baked.values[value].bent);
        found[value] = {(corner(0) * static_cast<double>(r - i - j) + corner(1) * static_cast<double>(i) +
                         corner(2) * static_cast<double>(j)) /
                            static_cast<double>(r),
                        static_cast<double>(baked.values[value].visibility), dvec3(bent[0], bent[1], bent[2])};
      }
  }
  std::vector<Point> all;
  for (const auto& [value, point] : found) all.push_back(point);
  return all;
}

/// Part of a sphere about the origin, its inside out: from the pole -Y up to `polar` radians from it.
inline void add_bowl(Scene& scene, double radius, double polar, std::uint32_t rings) {
  std::vector<float> positions, normals;
  std::vector<std::uint32_t> indices;
  const std::uint32_t sectors = 4 * rings;
  for (std::uint32_t i = 0; i <= rings; ++i) {
    for (std::uint32_t j = 0; j <= sectors; ++j) {
      const double theta = rendering::kPi - polar * i / rings, phi = 2 * rendering::kPi * j / sectors;
      const dvec3 out(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
      for (int c = 0; c < 3; ++c) {
        positions.push_back(static_cast<float>(radius * out[c]));
        normals.push_back(static_cast<float>(-out[c]));
      }
      if (i == rings || j == sectors) continue;
      const std::uint32_t a = i * (sectors + 1) + j, b = a + sectors + 1;
      for (const std::uint32_t index : {a, a + 1, b, b, a + 1, b + 1}) indices.push_back(index);
    }
  }
  scene.add_mesh(positions, normals, indices, dmat4(1.0));
}

/// A box of side 2 about the origin that faces inwards.
inline void add_room(Scene& scene) {
  std::vector<float> positions, normals;
  std::vector<std::uint32_t> indices;
  for (int axis = 0; axis < 3; ++axis)
    for (const int side : {-1, 1}) {
      const auto first = static_cast<std::uint32_t>(positions.size() / 3);
      for (int corner = 0; corner < 4; ++corner) {
        std::array<float, 3> p{}, n{};
        p[static_cast<std::size_t>(axis)] = static_cast<float>(side);
        p[static_cast<std::size_t>((axis + 1) % 3)] = corner == 1 || corner == 2 ? 1.0F : -1.0F;
        p[static_cast<std::size_t>((axis + 2) % 3)] = corner >= 2 ? 1.0F : -1.0F;
        n[static_cast<std::size_t>(axis)] = static_cast<float>(-side);
        positions.insert(positions.end(), p.begin(), p.end());
        normals.insert(normals.end(), n.begin(), n.end());
      }
      for (const std::uint32_t i : {0U, 1U, 2U, 0U, 2U, 3U}) indices.push_back(first + (side == -1 ? i : 3U - i));
    }
  scene.add_mesh(positions, normals, indices, dmat4(1.0));
}

}  // namespace baking
