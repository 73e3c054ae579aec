// SPDX-License-Identifier: Apache-2.0
// What the techniques draw: places and normals against float64, holes counted, hard cases, and that nothing is done
// where nothing is subdivided.
#include "cages.hpp"
#include "parsed.hpp"
#include "roles/readme.hpp"
#include "roles/rendering.hpp"

#include "shared/subdivision_cages.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include <map>

namespace {

using namespace rendering;
using cages::Mesh;
using cages::Point;
using heddle::subdivision::Object;
using testing::HasSubstr;

// Every frame below is proven: barriers, and numbers that passes make.
const bool kIsChecked = [] {
  Host::flags = HEDDLE_HOST_CHECK;
  return true;
}();

/// The cage as an application gives it: faces of any number of corners.
struct Given {
  std::vector<float> positions, uvs;
  std::vector<std::uint32_t> corners, sizes, creases;
  std::vector<float> sharpness;

  explicit Given(const Mesh& mesh) : corners(mesh.cage.corners), sizes(mesh.cage.face_sizes) {
    for (const Point& point : mesh.points)
      for (const double x : point) positions.push_back(static_cast<float>(x));
    for (const auto& [points, sharp] : mesh.cage.sharp_edges) {
      creases.insert(creases.end(), points.begin(), points.end());
      sharpness.push_back(static_cast<float>(sharp));
    }
  }
  /// Every face has texture coordinates of its own: all its vertices are seams.
  void split_seams() {
    std::vector<float> split;
    std::vector<std::uint32_t> made;
    for (const std::uint32_t corner : corners) {
      made.push_back(static_cast<std::uint32_t>(split.size() / 3));
      split.insert(split.end(), positions.begin() + 3 * corner, positions.begin() + 3 * corner + 3);
      uvs.push_back(static_cast<float>(made.size() % 4 / 2));
      uvs.push_back(static_cast<float>(made.size() / 4));
    }
    positions = std::move(split);
    corners = std::move(made);
  }
};

std::uint32_t add(Scene& scene, const Given& given, const std::string& properties, const dmat4& place = dmat4(1.0)) {
  heddle_mesh mesh{};
  mesh.struct_size = sizeof mesh;
  mesh.vertex_count = static_cast<std::uint32_t>(given.positions.size() / 3);
  mesh.positions = given.positions.data();
  mesh.uv0 = given.uvs.empty() ? nullptr : given.uvs.data();
  mesh.indices = given.corners.data();
  mesh.index_count = static_cast<std::uint32_t>(given.corners.size());
  mesh.face_sizes = given.sizes.data();
  mesh.face_count = static_cast<std::uint32_t>(given.sizes.size());
  mesh.creases = given.creases.data();
  mesh.sharpness = given.sharpness.data();
  mesh.crease_count = static_cast<std::uint32_t>(given.sharpness.size());
  std::uint32_t id = 0;
  check(heddle_scene_add_mesh(scene.handle, nullptr, &mesh, 0, &id));
  check(heddle_scene_add_instance(scene.handle, nullptr, id, &place[0][0], &id));
  if (!properties.empty())
    check(
        heddle_scene_set_component(scene.handle, HEDDLE_OWNER_INSTANCE, id, "subdivision.surface", properties.c_str()));
  return id;
}

/// What the technique makes, as a snapshot has it.
struct Triangles {
  std::vector<std::array<float, 3>> positions, normals;
  std::vector<std::array<std::uint32_t, 3>> corners;
};

Triangles look(Scene& scene, const std::string& technique, const std::string& parameters = {}) {
  Graph graph("extent = [8, 8]\noutput = \"look.color\"\n[[pass]]\nrole = \"subdivision\"\ntechnique = \"" + technique +
              "\"\n" + parameters + "[[pass]]\nname = \"look\"\nrole = \"made\"\ntechnique = \"look\"\n" +
              "inputs.triangles = \"subdivision.surfaces\"\n");
  graph.keep("look.points");
  graph.render(scene);
  const Image counts = graph.read();
  Triangles seen;
  const Image positions = graph.read("look.points", 0), normals = graph.read("look.points", 1),
              corners = graph.read("look.points", 2);
  for (std::size_t i = 0; i < static_cast<std::size_t>(counts.pixels[1]); ++i) {
    seen.positions.push_back({positions.pixels[4 * i], positions.pixels[4 * i + 1], positions.pixels[4 * i + 2]});
    seen.normals.push_back({normals.pixels[4 * i], normals.pixels[4 * i + 1], normals.pixels[4 * i + 2]});
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(counts.pixels[0]); ++i) {
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t k = 0; k < 3; ++k) triangle[k] = static_cast<std::uint32_t>(corners.pixels[4 * i + k]);
    seen.corners.push_back(triangle);
  }
  return seen;
}

/// Edges of triangles, by the bits of their ends, that no other triangle has the other way round.
std::size_t count_holes(const Triangles& seen) {
  using Ends = std::array<std::array<float, 3>, 2>;
  std::map<Ends, int> edges;
  for (const auto& triangle : seen.corners)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& a = seen.positions[triangle[k]];
      const auto& b = seen.positions[triangle[(k + 1) % 3]];
      if (a == b) continue;
      ++edges[{a, b}];
      --edges[{b, a}];
    }
  std::size_t holes = 0;
  for (const auto& [ends, count] : edges) holes += count != 0 ? 1 : 0;
  return holes / 2;
}

/// The object as the technique builds it, for its order of vertices.
struct Twin {
  explicit Twin(const Given& given, std::int32_t levels) {
    std::uint32_t next = 0;
    // Flat normals: every triangle has vertices of its own.
    for (std::size_t f = 0; f < given.sizes.size(); ++f) {
      for (std::uint32_t k = 1; k + 1 < given.sizes[f]; ++k)
        for (const std::uint32_t c : {0U, k, k + 1}) {
          HeddleVertex vertex{};
          std::copy_n(given.positions.begin() + 3 * given.corners[next + c], 3, vertex.position);
          if (!given.uvs.empty()) {
            vertex.u0 = given.uvs[2 * given.corners[next + c]];
            vertex.v0 = given.uvs[2 * given.corners[next + c] + 1];
          }
          vertex.color = 0xffffffffU;
          indices.push_back(static_cast<std::uint32_t>(vertices.size()));
          vertices.push_back(vertex);
          vertex_of[given.corners[next + c]] = indices.back();
        }
      next += given.sizes[f];
    }
    for (const std::uint32_t point : given.creases) creases.push_back(vertex_of[point]);
    heddle_scene_mesh mesh{};
    mesh.vertex_count = static_cast<std::uint32_t>(vertices.size());
    mesh.index_count = static_cast<std::uint32_t>(indices.size());
    mesh.vertices = mesh.previous_vertices = vertices.data();
    mesh.indices = indices.data();
    mesh.face_sizes = given.sizes.data();
    mesh.face_count = static_cast<std::uint32_t>(given.sizes.size());
    mesh.creases = creases.data();
    mesh.sharpness = given.sharpness.data();
    mesh.crease_count = static_cast<std::uint32_t>(given.sharpness.size());
    object.settings = {levels, true, 4, 10};
    heddle::subdivision::build(mesh, object);
  }
  [[nodiscard]] Point place(std::size_t corner, bool at_limit) const {
    const std::uint32_t row = object.corners[corner].row & ~heddle::subdivision::kMirrored;
    return heddle::subdivision::weigh(at_limit ? object.refined.limits : object.refined.positions,
                                      object.refined.vertices[row], object.sources, vertices.data());
  }
  [[nodiscard]] Point normal(std::size_t corner) const {
    const std::uint32_t row = object.corners[corner].row & ~heddle::subdivision::kMirrored;
    return cages::unit(
        cages::cross(heddle::subdivision::weigh(object.refined.t1, row, object.sources, vertices.data()),
                     heddle::subdivision::weigh(object.refined.t2, row, object.sources, vertices.data())));
  }
  std::vector<HeddleVertex> vertices;
  std::vector<std::uint32_t> indices, creases;
  std::map<std::uint32_t, std::uint32_t> vertex_of;
  Object object;
};

Mesh creased_cube() {
  Mesh mesh = cages::cube();
  mesh.cage.sharp_edges = {{{0, 1}, 10.0}, {{1, 3}, 10.0}, {{3, 2}, 10.0},
                           {{2, 0}, 10.0}, {{4, 5}, 2.5},  {{0, 4}, 0.5}};
  return mesh;
}

TEST(Subdivision, AgreesWithFloat64WithinItsRounding) {
  Mesh far = cages::cube();
  for (Point& point : far.points) point[0] += 1000;
  for (const Mesh& mesh : {cages::cube(), far, creased_cube(), cages::torus(8, 6), cages::fan(12), cages::fan(128)}) {
    const Given given(mesh);
    for (const std::int32_t level : {1, 2, 3}) {
      if (level > 1 && mesh.points.size() > 1000) continue;
      for (const bool at_limit : {true, false}) {
        Scene scene;
        add(scene, given, "{\"levels\": " + std::to_string(level) + "}");
        const Triangles seen =
            look(scene, "catmull_clark", std::string("params.limit = ") + (at_limit ? "true\n" : "false\n"));
        const Twin twin(given, level);
        ASSERT_EQ(seen.positions.size(), twin.object.corners.size());
        double largest = 0, off = 0, turned = 0;
        for (const Point& point : mesh.points)
          for (const double x : point) largest = std::max(largest, std::abs(x));
        std::size_t longest = 0;
        for (std::size_t row = 0; row < twin.object.refined.limits.count(); ++row)
          longest = std::max(longest, twin.object.refined.limits.points_of(row).size());
        for (std::size_t i = 0; i < seen.positions.size(); ++i) {
          const Point place = twin.place(i, at_limit), normal = twin.normal(i);
          for (std::size_t k = 0; k < 3; ++k)
            off = std::max(off, std::abs(place[k] - static_cast<double>(seen.positions[i][k])));
          const Point other{static_cast<double>(seen.normals[i][0]), static_cast<double>(seen.normals[i][1]),
                            static_cast<double>(seen.normals[i][2])};
          turned = std::max(turned, cages::distance(normal, other));
        }
        // Each of up to `longest` products and sums is rounded once, weights too, and the snapshot moves what it has
        // (README, Measured): (n + 3) u of the largest coordinate, u = 2^-24.
        EXPECT_LT(off, static_cast<double>(longest + 3) * std::ldexp(1.0, -24) * largest) << level;
        EXPECT_LT(turned, 1.8e-4) << "0.01 degrees";
      }
    }
  }
}

TEST(Subdivision, OfTheCubeHasItsExactLimits) {
  Scene scene;
  add(scene, Given(cages::cube()), "{\"levels\": 1}");
  for (const char* technique : {"catmull_clark", "limit"}) {
    const Triangles seen = look(scene, technique, "params.levels = 1\n");
    EXPECT_EQ(seen.corners.size(), 48U);
    std::map<int, int> kinds;
    for (const auto& at : seen.positions) {
      int zeros = 0;
      for (const float x : at) zeros += std::abs(x) < 1e-6F ? 1 : 0;
      ++kinds[zeros];
      const double expected = zeros == 0 ? 0.5 : zeros == 1 ? 395.0 / 648 : 68.0 / 81;
      for (const float x : at) EXPECT_NEAR(std::abs(x), std::abs(x) < 1e-6F ? 0 : expected, 1e-6) << technique;
    }
    EXPECT_EQ(kinds, (std::map<int, int>{{0, 8}, {1, 12}, {2, 6}}));
  }
}

TEST(Subdivision, HasNoHoles) {  // H2
  Mesh noisy = cages::box(3);
  std::mt19937 random(5);
  for (Point& point : noisy.points)
    for (double& x : point) x += 0.2 * (static_cast<double>(random() % 1000) / 1000 - 0.5);
  for (const Mesh& mesh : {cages::cube(), creased_cube(), cages::torus(8, 6), noisy}) {
    for (const bool has_seams : {false, true}) {
      Given given(mesh);
      if (has_seams && !given.creases.empty()) continue;  // creases name vertices that the seams split
      if (has_seams) given.split_seams();
      for (const char* technique : {"catmull_clark", "vertex_program", "limit"}) {
        Scene scene;
        add(scene, given, "{\"levels\": 3}");
        const Triangles seen = look(scene, technique, "params.levels = 3\n");
        EXPECT_EQ(seen.corners.size(), given.sizes.size() * 4 * 16 * 2);
        EXPECT_EQ(count_holes(seen), 0U) << technique << (has_seams ? ", seams" : "");
      }
    }
  }
}

TEST(Subdivision, RefinesEveryObject) {
  Scene scene;
  const Given cube(cages::cube()), torus(cages::torus(6, 5));
  add(scene, cube, "{\"levels\": 1}");
  add(scene, torus, "{\"levels\": 2}", glm::translate(dmat4(1.0), dvec3(8, 0, 0)));
  add(scene, cube, "{\"levels\": 2}", glm::translate(dmat4(1.0), dvec3(0, 8, 0)));
  add(scene, cube, "{\"levels\": 2}", glm::scale(glm::translate(dmat4(1.0), dvec3(0, 0, 8)), dvec3(-1, 1, 1)));
  add(scene, cube, {}, glm::translate(dmat4(1.0), dvec3(0, 0, -8)));
  const Triangles seen = look(scene, "catmull_clark");
  EXPECT_EQ(seen.corners.size(), 48U + 30 * 16 * 2 + 2 * 6 * 16 * 2 + 12);
  EXPECT_EQ(count_holes(seen), 0U);
  for (const char* technique : {"catmull_clark", "vertex_program"}) {
    const Triangles coarse = look(scene, technique, "params.levels_at_most = 1\n");
    EXPECT_EQ(coarse.corners.size(), 48U + 30 * 4 * 2 + 2 * 6 * 4 * 2 + 12) << technique;
  }
}

TEST(Subdivision, LeavesWhatIsNoManifoldAsItIs) {  // H3
  Mesh three = cages::cube();
  three.points.push_back({0, 3, 0});
  three.add_face({2, 3, 8});  // a third face at an edge
  three.finish();
  Scene scene;
  add(scene, Given(three), "{\"levels\": 2}");
  add(scene, Given(cages::cube()), "{\"levels\": 2}", glm::translate(dmat4(1.0), dvec3(4, 0, 0)));
  Host::get().log.clear();
  const Triangles seen = look(scene, "catmull_clark");
  EXPECT_EQ(seen.corners.size(), 13U + 6 * 16 * 2);
  std::string log;
  for (const std::string& line : Host::get().log) log += line + "\n";
  EXPECT_THAT(log, HasSubstr("mesh 0 is not subdivided but drawn as it is: an edge of 3 faces between points"));
}

TEST(Subdivision, MakesUnitNormalsOfWhatIsCollapsed) {  // H4
  Mesh flat = cages::box(2);
  for (Point& point : flat.points) point = {point[0], 0, 0};  // everything on a line: no area anywhere
  Mesh pole = cages::box(2);
  for (Point& point : pole.points)
    if (point[1] > 0.5) point = {0, 1, 0};  // nine points in one place
  for (const Mesh& mesh : {flat, pole}) {
    Scene scene;
    add(scene, Given(mesh), "{\"levels\": 2}");
    for (const char* technique : {"catmull_clark", "vertex_program", "limit"}) {
      const Triangles seen = look(scene, technique, "params.levels = 2\n");
      ASSERT_FALSE(seen.positions.empty());
      for (std::size_t i = 0; i < seen.positions.size(); ++i) {
        double length = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          ASSERT_TRUE(std::isfinite(seen.positions[i][k])) << technique;
          length += std::pow(static_cast<double>(seen.normals[i][k]), 2);
        }
        ASSERT_NEAR(length, 1, 1e-5) << technique;
      }
    }
  }
}

TEST(Subdivision, KeepsAllSharpEdgesOfACube) {
  Mesh mesh = cages::cube();
  Scene scene, plain;
  add(scene, Given(mesh), R"({"levels": 2, "crease_angle": 0.5})");
  add(plain, Given(mesh), {});
  const std::string text = "extends = \"studio\"\nextent = [48, 32]\n";
  for (Scene* one : {&scene, &plain}) one->look(dvec3(2, 3, 4), dvec3(0, 0, 0));
  Graph smooth(text), cube(text);
  smooth.keep("gbuffer.depth");
  cube.keep("gbuffer.depth");
  smooth.render(scene);
  cube.render(plain);
  const Image a = smooth.read("gbuffer.depth"), b = cube.read("gbuffer.depth");
  std::size_t covered = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    ASSERT_EQ(std::isfinite(a.pixels[i]), std::isfinite(b.pixels[i]));
    if (!std::isfinite(a.pixels[i])) continue;
    ++covered;
    ASSERT_NEAR(a.pixels[i], b.pixels[i], 1e-5);
  }
  EXPECT_GT(covered, 150U);
}

nlohmann::json stats(Graph& graph) {
  const char* text = nullptr;
  check(heddle_stats(graph.handle, &text));
  return parsed::json(text);
}

TEST(Subdivision, CostsNothingWhereNoObjectAsksForIt) {
  Scene scene;
  add(scene, Given(cages::cube()), {});
  scene.look(dvec3(2, 3, 4), dvec3(0, 0, 0));
  Graph with("extends = \"studio\"\nextent = [32, 24]\n"),
      without("extends = \"studio\"\nextent = [32, 24]\n[[pass]]\nname = \"subdivision\"\ntechnique = \"none\"\n");
  for (int k = 0; k < 2; ++k) EXPECT_EQ(with.image(scene).pixels, without.image(scene).pixels);
  const nlohmann::json a = stats(with), b = stats(without);
  EXPECT_EQ(a["counters"], b["counters"]);
  EXPECT_EQ(a["memory"], b["memory"]);
  EXPECT_EQ(a["libraries"], b["libraries"]);
}

TEST(Subdivision, DoesNothingInFramesInWhichNothingBends) {
  Scene scene;
  const std::uint32_t id = add(scene, Given(cages::cube()), "{\"levels\": 2}");
  scene.look(dvec3(2, 3, 4), dvec3(0, 0, 0));
  Graph graph("extends = \"studio\"\nextent = [32, 24]\n"),
      without("extends = \"studio\"\nextent = [32, 24]\n[[pass]]\nname = \"subdivision\"\ntechnique = \"none\"\n");
  const auto dispatches = [&](Graph& of) { return stats(of)["counters"]["dispatches"].get<int>(); };
  graph.render(scene);
  without.render(scene);
  EXPECT_EQ(dispatches(graph), dispatches(without) + 1);
  for (int k = 0; k < 3; ++k) {
    // Moving an instance is none of its business.
    const dmat4 place = glm::translate(dmat4(1.0), dvec3(0.1 * k, 0, 0));
    check(heddle_scene_set_instance(scene.handle, id, &place[0][0]));
    graph.render(scene);
    without.render(scene);
    EXPECT_EQ(dispatches(graph), dispatches(without));
  }
  check(heddle_scene_set_component(scene.handle, HEDDLE_OWNER_INSTANCE, id, "subdivision.surface", "{\"levels\": 3}"));
  graph.render(scene);
  EXPECT_EQ(dispatches(graph), dispatches(without) + 1);
}

TEST(Subdivision, MovesWithItsInstance) {
  Scene scene;
  const std::uint32_t id = add(scene, Given(cages::cube()), "{\"levels\": 3}");
  scene.look(dvec3(0, 0, 4), dvec3(0, 0, 0));
  Graph graph("extends = \"studio\"\nextent = [64, 64]\n");
  graph.keep("gbuffer.motion");
  graph.keep("gbuffer.depth");
  graph.render(scene);
  const dmat4 place = glm::translate(dmat4(1.0), dvec3(0.1, 0.05, 0));
  check(heddle_scene_set_instance(scene.handle, id, &place[0][0]));
  graph.render(scene);
  const Image motion = graph.read("gbuffer.motion"), depth = graph.read("gbuffer.depth");
  std::size_t covered = 0;
  for (std::uint32_t y = 0; y < 64; ++y)
    for (std::uint32_t x = 0; x < 64; ++x) {
      const double d = static_cast<double>(depth.at(x, y));
      if (!std::isfinite(d)) continue;
      ++covered;
      // Previous minus current, pixels, y down; a metre at distance d is 32 / (tan(0.5) d) pixels.
      const double pixels = 32 / (std::tan(0.5) * d);
      EXPECT_NEAR(motion.at(x, y, 0), -0.1 * pixels, 0.01);
      EXPECT_NEAR(motion.at(x, y, 1), 0.05 * pixels, 0.01);
    }
  EXPECT_GT(covered, 500U);
}

// ---- vertex_program: the same sums in vertex stages, hard cases H1 to H3 of role surface_program

std::string variant(const std::string& graph, const std::string& technique, const char* more = "") {
  return "extends = \"" + graph + "\"\nextent = [48, 40]\n[[pass]]\nname = \"subdivision\"\ntechnique = \"" +
         technique + "\"\n" + more;
}

/// Two smooth objects, one of them mirrored, moved too; a third with sharp edges, and a cage as it is.
struct SomeObjects : Scene {
  SomeObjects() {
    const Given torus(cages::torus(8, 6)), creased(creased_cube());
    add(*this, torus, "{\"levels\": 2}");
    add(*this, creased, "{\"levels\": 3}", glm::translate(dmat4(1.0), dvec3(0, 2, 0)));
    moved = add(*this, torus, "{\"levels\": 2}", mirrored(0));
    add(*this, creased, {}, glm::translate(dmat4(1.0), dvec3(-3, 0, 0)));
    look(dvec3(2, 5, 7), dvec3(0, 0, 0));
  }
  static dmat4 mirrored(double x) { return glm::scale(glm::translate(dmat4(1.0), dvec3(x, 0, -2)), dvec3(-1, 1, 1)); }
  void move(double x) {
    const dmat4 place = mirrored(x);
    check(heddle_scene_set_instance(handle, moved, &place[0][0]));
  }
  std::uint32_t moved = 0;
};

TEST(VertexProgram, HasTheBytesOfStoredVerticesInPicturesAndSnapshots) {
  SomeObjects first, second;
  const Triangles stored = look(first, "catmull_clark"), asked = look(second, "vertex_program");
  ASSERT_GT(stored.positions.size(), 1000U);
  EXPECT_EQ(stored.positions, asked.positions);
  EXPECT_EQ(stored.normals, asked.normals);
  EXPECT_EQ(stored.corners, asked.corners);

  // gbuffer, depth maps, and rays through snapshots.
  const char* const rays = "[[pass]]\nname = \"ao\"\ntechnique = \"ray_traced\"\nparams.samples = 4\n";
  Graph a(variant("deferred", "catmull_clark", rays)), b(variant("deferred", "vertex_program", rays));
  const std::array ports{"gbuffer.depth", "gbuffer.motion", "gbuffer.normal"};
  for (Graph* one : {&a, &b})
    for (const char* port : ports) one->keep(port);
  for (const double x : {0.0, 0.2}) {
    first.move(x);
    second.move(x);
    EXPECT_EQ(a.image(first).pixels, b.image(second).pixels);
    for (const char* port : ports) EXPECT_EQ(a.read(port).pixels, b.read(port).pixels) << port;
  }
  float fastest = 0;
  for (const float pixels : b.read("gbuffer.motion").pixels) fastest = std::max(fastest, std::abs(pixels));
  EXPECT_GT(fastest, 0.5F) << "of the one that has moved";
}

TEST(VertexProgram, StoresNoVerticesAndDispatchesNothing) {
  const Given cube(cages::cube());
  Scene scene;
  add(scene, cube, "{\"levels\": 3}");
  scene.look(dvec3(2, 3, 4), dvec3(0, 0, 0));
  Graph stored(variant("studio", "catmull_clark")), asked(variant("studio", "vertex_program"));
  EXPECT_EQ(stored.image(scene).pixels, asked.image(scene).pixels);
  const nlohmann::json a = stats(stored), b = stats(asked);
  EXPECT_EQ(a["counters"]["dispatches"].get<int>(), b["counters"]["dispatches"].get<int>() + 1);
  EXPECT_EQ(a["counters"]["draws"], b["counters"]["draws"]);
  // 386 places, but vertices for each direction of a tangent: as many as the snapshot has.
  const std::size_t vertices = look(scene, "vertex_program", "params.levels = 3\n").positions.size();
  EXPECT_GE(vertices, 386U);
  EXPECT_GE(a["memory"]["kept_bytes"].get<std::uint64_t>(),
            b["memory"]["kept_bytes"].get<std::uint64_t>() + vertices * sizeof(HeddleVertex));
}

TEST(VertexProgram, KeepsPipelinesWhereNothingOfThemChanges) {
  Scene scene;
  add(scene, Given(cages::cube()), "{\"levels\": 2}");
  scene.look(dvec3(2, 3, 4), dvec3(0, 0, 0));
  Graph graph(variant("studio", "vertex_program"));
  const Image before = graph.image(scene);
  // Other tests of this process may have had the same ones made.
  const auto not_kept = [&] {
    const nlohmann::json plan = stats(graph)["plan"];
    return plan["pipelines_made"].get<int>() + plan["pipelines_shared"].get<int>();
  };
  const int made = not_kept();
  check(heddle_graph_set(graph.handle, "gbuffer.technique=raster"));
  EXPECT_EQ(graph.image(scene).pixels, before.pixels);
  check(heddle_graph_set(graph.handle, "ao.params.radius=0.25"));
  check(heddle_graph_set(graph.handle, "subdivision.technique=catmull_clark"));
  EXPECT_EQ(graph.image(scene).pixels.size(), before.pixels.size());
  check(heddle_graph_set(graph.handle, "subdivision.technique=vertex_program"));
  graph.render(scene);
  // gbuffer's alone, and depth maps': all other pipelines went on.
  EXPECT_LT(not_kept(), made / 2);
}

TEST(Subdivision, HasItsParametersInItsReadme) {
  const char* text = nullptr;
  check(heddle_list(Host::get().handle, &text));
  for (const char* id : {"subdivision/catmull_clark", "subdivision/vertex_program", "subdivision/limit"}) {
    const std::string table = parameter_table(parsed::json(text), id);
    EXPECT_FALSE(table.empty());
    EXPECT_THAT(readme_of(id), HasSubstr(table));
  }
}

TEST(Subdivision, RefusesMoreThanItHasRoomFor) {
  Scene scene;
  add(scene, Given(cages::torus(64, 48)), "{\"levels\": 6}");
  Graph graph("extends = \"studio\"\nextent = [32, 24]\n");
  EXPECT_EQ(heddle_render(graph.handle, scene.handle, nullptr), HEDDLE_UNSUPPORTED);
  EXPECT_THAT(heddle_error(Host::get().handle),
              HasSubstr("mesh 0 would have 12582912 quads at level 6: expected at most 2097152; choose fewer levels"));
}

}  // namespace
