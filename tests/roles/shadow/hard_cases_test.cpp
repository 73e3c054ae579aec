// SPDX-License-Identifier: Apache-2.0
// The hard cases of role shadow, for every technique that answers by the scene: closed forms, asked at points through
// the C API.
#include "patch.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>

namespace {

using namespace rendering;
using shadow_patch::ask;
using shadow_patch::cascaded;
using shadow_patch::contact;
using shadow_patch::Patch;
using shadow_patch::ray_traced;
using shadow_patch::shadow_map;
using shadow_patch::techniques_of;

/// Each value against what `expected` says of its point: 0, 1, or negative where both are right (within the filter).
void expect_everywhere(const Image& image, const Patch& patch, const std::function<double(const dvec3&)>& expected,
                       double tolerance = 1e-6) {
  ASSERT_EQ(image.width, patch.grid);
  int wrong = 0;
  int decided = 0;
  for (std::uint32_t y = 0; y < patch.grid; ++y) {
    for (std::uint32_t x = 0; x < patch.grid; ++x) {
      const double value = image.at(x, y);
      EXPECT_TRUE(value >= 0.0 && value <= 1.0) << value;  // also fails for NaN
      const double wanted = expected(patch.point(x, y));
      if (wanted < 0.0) continue;
      ++decided;
      if (std::abs(value - wanted) <= tolerance) continue;
      const dvec3 p = patch.point(x, y);
      if (++wrong <= 3) ADD_FAILURE() << "at " << text_of(p) << ": " << value << ", expected " << wanted;
    }
  }
  EXPECT_EQ(wrong, 0) << "of " << decided;
  EXPECT_GT(decided, static_cast<int>(patch.grid * patch.grid / 10)) << "the test decides next to nothing";
}

HeddleLight spot_at(const dvec3& direction) {
  HeddleLight record = light(HEDDLE_LIGHT_SPOT, direction);
  record.cos_outer = 0.75F;  // half angle 41 degrees
  return record;
}

// ---- H1 -------------------------------------------------------------------------------------------------------------

struct Acne {
  const char* name;
  HeddleLight record;
  dvec3 position;  // of the light
};

TEST(ShadowHardCases, H1NoAcneOnAPlaneUpToGrazingLight) {
  for (const double NoL : {0.05, 0.1, 0.4, 1.0}) {
    const dvec3 to_light(0.6 * std::sqrt(1 - NoL * NoL), NoL, 0.8 * std::sqrt(1 - NoL * NoL));
    // 6 m away: the patch, 2 m wide, sees positional lights at about this cosine.
    for (const Acne& acne :
         {Acne{"directional", light(HEDDLE_LIGHT_DIRECTIONAL, -to_light), {}},
          Acne{"spot", spot_at(-to_light), 6.0 * to_light}, Acne{"point", light(HEDDLE_LIGHT_POINT), 6.0 * to_light}}) {
      for (const char* parameters :
           {"params.filter_taps = 1\nparams.filter_radius = 0.0\n", "",
            "params.filter_taps = 25\nparams.filter_radius = 4.0\nparams.resolution = 512\n"}) {
        SCOPED_TRACE(std::string(acne.name) + " NoL " + std::to_string(NoL) + " " + parameters);
        Scene scene;
        scene.add_floor({0, 0, 0}, 30.0);
        scene.add_light(acne.record, acne.position);
        scene.look({0, 3, 4}, {0, 0, 0});
        Patch patch{{-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, {0, 1, 0}};
        patch.camera = {0, 3, 4};
        for (const std::string& pass : techniques_of(acne.record.type, parameters))
          expect_everywhere(ask(scene, patch, pass), patch, [](const dvec3&) { return 1.0; });
      }
    }
  }
}

TEST(ShadowHardCases, H1NoAcneOnASphereUpToGrazingLight) {
  const dvec3 centre(0, 1, 0);
  const dvec3 to_light = glm::normalize(dvec3(0.5, 0.7, 0.3));
  for (const Acne& acne : {Acne{"directional", light(HEDDLE_LIGHT_DIRECTIONAL, -to_light), {}},
                           Acne{"spot", spot_at(-to_light), centre + 5.0 * to_light},
                           Acne{"point", light(HEDDLE_LIGHT_POINT), centre + 5.0 * to_light}}) {
    SCOPED_TRACE(acne.name);
    Scene scene;
    scene.add_sphere(centre, 1.0, 256);
    scene.add_light(acne.record, acne.position);
    scene.look({0, 3, 6}, {0, 0, 0});
    Patch patch{centre, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}};
    patch.camera = {0, 3, 6};
    patch.is_sphere = true;
    for (const std::string& pass : techniques_of(acne.record.type)) {
      expect_everywhere(ask(scene, patch, pass), patch, [&](const dvec3& p) {
        const dvec3 L = acne.record.type == HEDDLE_LIGHT_DIRECTIONAL ? to_light : glm::normalize(acne.position - p);
        const double NoL = glm::dot(glm::normalize(p - centre), L);
        // The mesh's facets are tilted by up to 0.006 to the sphere; between 0 and 0.05 both answers may be right.
        return NoL >= 0.05 ? 1.0 : NoL <= 0.0 ? 0.0 : -1.0;
      });
    }
  }
}

// ---- H2 -------------------------------------------------------------------------------------------------------------

/// A closed box of 5 cm walls, 2 m wide inside, and what stands around it.
void add_closed_room(Scene& scene) {
  constexpr double kWall = 0.05;
  scene.add_box({-1 - kWall, 0, -1 - kWall}, {1 + kWall, kWall, 1 + kWall});
  scene.add_box({-1 - kWall, 2, -1 - kWall}, {1 + kWall, 2 + kWall, 1 + kWall});
  for (const double side : {-1.0, 1.0}) {
    const double near_face = side;
    const double far_face = side * (1 + kWall);
    scene.add_box({std::min(near_face, far_face), kWall, -1 - kWall}, {std::max(near_face, far_face), 2, 1 + kWall});
    scene.add_box({-1, kWall, std::min(near_face, far_face)}, {1, 2, std::max(near_face, far_face)});
  }
  scene.add_floor({0, 0, 0}, 20.0);
}

TEST(ShadowHardCases, H2ClosedRoomOfFiveCentimetreWallsIsDark) {
  const dvec3 to_light = glm::normalize(dvec3(0.5, 0.7, 0.3));
  const dvec3 level = glm::normalize(dvec3(0.9, 0.12, 0.3));
  // Near enough that the filter is narrower than a wall: README, "Known limits".
  for (const Acne& acne :
       {Acne{"directional", light(HEDDLE_LIGHT_DIRECTIONAL, -to_light), {}},
        Acne{"low directional", light(HEDDLE_LIGHT_DIRECTIONAL, -level), {}},
        Acne{"spot", spot_at(-to_light), 5.0 * to_light}, Acne{"point", light(HEDDLE_LIGHT_POINT), 5.0 * to_light},
        Acne{"near point", light(HEDDLE_LIGHT_POINT), {1.2, 1.0, 0.9}}}) {
    for (const Patch& patch : {Patch{{-1, 0.05, -1}, {2, 0, 0}, {0, 0, 2}, {0, 1, 0}},
                               Patch{{-1, 0.05, -1}, {0, 1.95, 0}, {0, 0, 2}, {1, 0, 0}},
                               Patch{{-1, 0.05, -1}, {0, 1.95, 0}, {2, 0, 0}, {0, 0, 1}},
                               Patch{{-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, {0, -1, 0}}}) {
      SCOPED_TRACE(std::string(acne.name) + " on " + text_of(patch.normal));
      Scene scene;
      add_closed_room(scene);
      scene.add_light(acne.record, acne.position);
      scene.look({0, 1, 0.9}, {0, 0.8, 0});
      Patch placed = patch;
      placed.camera = {0, 1, 0.9};
      for (const std::string& pass : techniques_of(acne.record.type, "params.distance = 20.0\n"))
        expect_everywhere(ask(scene, placed, pass), placed, [](const dvec3&) { return 0.0; });
    }
  }
}

TEST(ShadowHardCases, H2NoLightCreepsUnderAThinWallOnTheFloor) {
  // A wall 2 m high, its shadow 2 m long: all of the first 1.5 m behind it is dark, from the wall's foot on.
  const dvec3 to_light = glm::normalize(dvec3(1, 1, 0));
  for (const Acne& acne :
       {Acne{"directional", light(HEDDLE_LIGHT_DIRECTIONAL, -to_light), {}},
        Acne{"spot", spot_at(-to_light), 5.0 * to_light}, Acne{"point", light(HEDDLE_LIGHT_POINT), 5.0 * to_light}}) {
    SCOPED_TRACE(acne.name);
    Scene scene;
    scene.add_floor({0, 0, 0}, 20.0);
    scene.add_box({0, 0, -4}, {0.05, 2, 4});
    scene.add_light(acne.record, acne.position);
    scene.look({-1, 3, 4}, {0, 0, 0});
    Patch patch{{-1.5, 0, -1}, {1.5, 0, 0}, {0, 0, 2}, {0, 1, 0}};
    patch.camera = {-1, 3, 4};
    for (const std::string& pass : techniques_of(acne.record.type, "params.distance = 20.0\n"))
      expect_everywhere(ask(scene, patch, pass), patch, [](const dvec3&) { return 0.0; });
  }
}

// ---- closed forms, H3, H5 -------------------------------------------------------------------------------------------

/// The shadow of a sphere, radius 0.5, 1 m over the floor, under a light straight above: a disk round the origin.
void expect_disk(const dvec3& offset, bool is_directional, const std::string& pass, double filter_metres) {
  Scene scene(offset);
  scene.add_floor({0, 0, 0}, 10.0);
  scene.add_sphere({0, 1, 0}, 0.5, 128);
  constexpr double kLightHeight = 4.0;
  scene.add_light(light(is_directional ? HEDDLE_LIGHT_DIRECTIONAL : HEDDLE_LIGHT_POINT), {0, kLightHeight, 0});
  const dvec3 camera(0, 2, 4);
  scene.look(camera, {0, 0, 0});
  Patch patch{{-1.5, 0, -1.5}, {3, 0, 0}, {0, 0, 3}, {0, 1, 0}};
  patch.camera = camera;
  const Image image = ask(scene, patch, pass);
  const double to_centre = kLightHeight - 1.0;
  const double radius = is_directional ? 0.5 : kLightHeight * 0.5 / std::sqrt(to_centre * to_centre - 0.25);
  expect_everywhere(image, patch, [&](const dvec3& p) {
    const double r = std::hypot(p.x, p.z);
    return r > radius + filter_metres ? 1.0 : r < radius - filter_metres ? 0.0 : -1.0;
  });
  // The filter is even: area in shadow is that of the disk, within a tenth of the filter's own width.
  double area = 0;
  for (std::uint32_t y = 0; y < patch.grid; ++y) {
    for (std::uint32_t x = 0; x < patch.grid; ++x) area += (1.0 - image.at(x, y)) * 9.0 / (patch.grid * patch.grid);
  }
  // Where nothing is filtered it is a number of grid points: of a disk of r grid steps it is off by 0.7 sqrt(r) (rms).
  const double step = 3.0 / patch.grid;
  const double counted = filter_metres < step ? 3.0 * 0.7 * step * step * std::sqrt(radius / step) : 0.0;
  EXPECT_NEAR(area, kPi * radius * radius, 2.0 * kPi * radius * 0.1 * filter_metres + 0.002 + counted);
}

TEST(ShadowHardCases, ShadowOfASphereIsTheDiskThatGeometrySays) {
  // First cascade: 6.7 m of view, sphere of 4.5 m and less: texels of at most 9 mm, filter 3 texels.
  expect_disk({0, 0, 0}, true, shadow_map(), 0.04);
  // The second cascade of 30 m, into which the first one fades: 9.4 m of view, 16 mm.
  expect_disk({0, 0, 0}, true, cascaded("params.distance = 30.0\n"), 0.07);
  // A face of the cube, 4 m away: 8 mm, 3 texels.
  expect_disk({0, 0, 0}, false, shadow_map(), 0.04);
  // Rays: the ball's facets, 128 rings of them, cut 0.3 mm off its outline, 1.1 times as far away on the floor.
  expect_disk({0, 0, 0}, true, ray_traced(), 0.001);
  expect_disk({0, 0, 0}, false, ray_traced(), 0.001);
}

TEST(ShadowHardCases, H5SameShadowAHundredKilometresAway) {
  const dvec3 far_away(1e5, 0.0, -1e5);
  expect_disk(far_away, true, shadow_map(), 0.04);
  expect_disk(far_away, true, cascaded("params.distance = 30.0\n"), 0.07);
  expect_disk(far_away, false, shadow_map(), 0.04);
  expect_disk(far_away, true, ray_traced(), 0.001);
  expect_disk(far_away, false, ray_traced(), 0.001);
}

TEST(ShadowHardCases, H6SameShadowInMillimetresAndKilometres) {
  for (const bool is_directional : {true, false}) {
    for (const char* technique : {"shadow_map", "cascaded", "ray_traced"}) {
      std::vector<Image> images;
      for (const double unit : {1.0, 1e-3, 1e3}) {
        Scene scene;
        scene.add_floor({0, 0, 0}, 10.0 * unit);
        scene.add_sphere(dvec3(0, 1, 0) * unit, 0.5 * unit, 64);
        HeddleLight lamp = light(is_directional ? HEDDLE_LIGHT_DIRECTIONAL : HEDDLE_LIGHT_POINT, {0.3, -1, 0.2});
        lamp.range = is_directional ? 0.0F : static_cast<float>(20.0 * unit);
        scene.add_light(lamp, dvec3(0.3, 4, 0.2) * unit);
        scene.look(dvec3(0, 2, 4) * unit, {0, 0, 0});
        Patch patch{dvec3(-1.5, 0, -1.5) * unit, dvec3(3, 0, 0) * unit, dvec3(0, 0, 3) * unit, {0, 1, 0}};
        patch.camera = dvec3(0, 2, 4) * unit;
        std::string lengths;
        if (technique == std::string("ray_traced")) {
          images.push_back(ask(scene, patch, ray_traced(fmt::format("params.near_distance = {:.9e}\n", 0.02 * unit))));
          continue;
        }
        for (const auto& [name, metres] : {std::pair("distance", 30.0), std::pair("caster_distance", 20.0)})
          lengths += fmt::format("params.{} = {:.9e}\n", name, metres * unit);
        const bool is_cascaded = technique == std::string("cascaded");
        lengths += fmt::format("params.{} = {:.9e}\n", is_cascaded ? "nearest" : "near_distance", 0.05 * unit);
        images.push_back(ask(scene, patch, is_cascaded ? cascaded(lengths) : shadow_map(lengths)));
      }
      // Texels on the edge may fall to either side when a length's last bit is another: of 128 x 128 points few, and no
      // point by more than what one texel of the filter's 12 (9 taps of 4 texels, overlapping) is worth.
      for (const std::size_t other : {1U, 2U}) {
        double sum = 0;
        float worst = 0;
        for (std::size_t i = 0; i < images[0].pixels.size(); ++i) {
          const float difference = std::abs(images[0].pixels[i] - images[other].pixels[i]);
          sum += static_cast<double>(difference);
          worst = std::max(worst, difference);
        }
        EXPECT_LE(sum / static_cast<double>(images[0].pixels.size()), 1e-4) << technique << is_directional << other;
        EXPECT_LE(worst, 0.25F) << technique << is_directional << other;
      }
    }
  }
}

TEST(ShadowHardCases, H3ShadowsAlikeOnBothSidesOfEverySeam) {
  // A ball on the seam between two faces, and on the corner of three, throws a disk on a wall behind it that faces the
  // light: the values at equal distances from the centre are alike, whichever face they come from.
  for (const dvec3& towards : {dvec3(1, 1, 0), dvec3(0, -1, 1), dvec3(-1, 0, 1), dvec3(1, 1, 1), dvec3(-1, 1, -1)}) {
    SCOPED_TRACE(text_of(towards));
    const dvec3 d = glm::normalize(towards);
    const dvec3 u = glm::normalize(glm::cross(d, dvec3(0.3, 0.9, -0.2)));
    const dvec3 v = glm::cross(u, d);
    Scene scene;
    scene.add_sphere(2.0 * d, 0.5, 128);
    scene.add_light(light(HEDDLE_LIGHT_POINT), {0, 0, 0});
    const dvec3 camera = -3.0 * d;
    scene.look(camera, {0, 0, 0});
    Patch patch{4.0 * d - 2.0 * u - 2.0 * v, 4.0 * u, 4.0 * v, -d};
    patch.camera = camera;
    const double radius = 4.0 * 0.5 / std::sqrt(4.0 - 0.25);
    // Texels there are 2 tan / 1024 times the distance along the axis, at most 4 m: 8 mm, wider across a corner. The
    // ball's facets cut 0.3 mm off its outline, twice as far away on the wall.
    for (const auto& [pass, width] : {std::pair(shadow_map(), 0.05), std::pair(ray_traced(), 0.001)}) {
      expect_everywhere(ask(scene, patch, pass), patch, [&, width = width](const dvec3& p) {
        const double r = glm::length(p - 4.0 * d);
        return r > radius + width ? 1.0 : r < radius - width ? 0.0 : -1.0;
      });
    }
  }
}

TEST(ShadowHardCases, H3NoLineOfShadowAlongTheSeamsOfARoom) {
  // The light stands in a corner of a room: all walls are lit, across every seam of the cube.
  Scene scene;
  scene.add_floor({0, 0, 0}, 10.0);
  scene.add_box({-10, 0, -3.05}, {10, 6, -3});
  scene.add_box({-3.05, 0, -10}, {-3, 6, 10});
  scene.add_light(light(HEDDLE_LIGHT_POINT), {-1.5, 1.5, -1.5});
  const dvec3 camera(3, 3, 3);
  scene.look(camera, {-3, 0, -3});
  for (const Patch& patch :
       {Patch{{-3, 0, -3}, {6, 0, 0}, {0, 0, 6}, {0, 1, 0}}, Patch{{-3, 0, -3}, {6, 0, 0}, {0, 6, 0}, {0, 0, 1}},
        Patch{{-3, 0, -3}, {0, 6, 0}, {0, 0, 6}, {1, 0, 0}}}) {
    SCOPED_TRACE(text_of(patch.normal));
    Patch placed = patch;
    placed.camera = camera;
    for (const std::string& pass : {shadow_map(), ray_traced()})
      expect_everywhere(ask(scene, placed, pass), placed, [](const dvec3&) { return 1.0; });
  }
}

// ---- H4 -------------------------------------------------------------------------------------------------------------

TEST(ShadowHardCases, H4LightBelowTheSurfaceOrAtThePointIsZeroOrOne) {
  for (const dvec3& position : {dvec3(0, -1, 0), dvec3(0, 0, 0), dvec3(0, 1e-7, 0), dvec3(0, 0.01, 0)}) {
    for (const std::uint32_t type : {HEDDLE_LIGHT_POINT, HEDDLE_LIGHT_SPOT, HEDDLE_LIGHT_SPHERE, HEDDLE_LIGHT_BOX}) {
      SCOPED_TRACE(text_of(position) + " type " + std::to_string(type));
      Scene scene;
      scene.add_floor({0, 0, 0}, 5.0);
      HeddleLight record = light(type);
      record.half_extent[0] = record.half_extent[1] = record.half_extent[2] = 0.5F;
      scene.add_light(record, position);
      scene.look({0, 3, 4}, {0, 0, 0});
      // Every point of the grid is the origin.
      Patch patch{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 1, 0}};
      patch.camera = {0, 3, 4};
      for (const std::string& passes : {shadow_map(), cascaded(), ray_traced(), contact()}) {
        const Image image = ask(scene, patch, passes);
        EXPECT_TRUE(image.at(0, 0) == 0.0F || image.at(0, 0) == 1.0F) << passes << image.at(0, 0);
        if (position.y < -0.5 && type == HEDDLE_LIGHT_POINT && passes != cascaded()) {
          EXPECT_EQ(image.at(0, 0), 0.0F) << passes;
        }
      }
    }
  }
}

// ---- capacity -------------------------------------------------------------------------------------------------------

TEST(ShadowMap, LightsWithoutRoomAreLitAndNamedOnce) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 5.0);
  scene.add_box({-0.5, 1, -0.5}, {0.5, 1.1, 0.5});
  for (int i = 0; i < 3; ++i) scene.add_light(light(HEDDLE_LIGHT_POINT), {0, 3, 0});
  scene.look({0, 3, 4}, {0, 0, 0});
  Patch patch{{-0.1, 0, -0.1}, {0.2, 0, 0}, {0, 0, 0.2}, {0, 1, 0}};
  patch.camera = {0, 3, 4};
  for (const std::uint32_t index : {0U, 1U, 2U}) {
    Host::get().log.clear();
    patch.light = index;
    Graph graph("extent = [128, 128]\noutput = \"probe.values\"\n" +
                shadow_map("params.views = 8\nparams.smallest = 1024\n") +
                "[[pass]]\nname = \"probe\"\nrole = \"probe\"\ntechnique = \"shadow\"\n" + patch.text());
    EXPECT_EQ(graph.image(scene).at(64, 64), index == 0 ? 0.0F : 1.0F);
    graph.render(scene);
    std::vector<std::string> told;
    for (const std::string& line : Host::get().log) {
      if (line.find("no room") != std::string::npos) told.push_back(line);
    }
    ASSERT_EQ(told.size(), 1U);
    EXPECT_THAT(told[0],
                testing::HasSubstr("2 lights find no room in the atlas and cast no shadow; raise the parameter "
                                   "'views', or lower 'smallest'"));
  }
}

TEST(ShadowMap, LightsShareTheRoomThereIs) {
  // Room for eight of the largest maps and 18 wanted: the first light's are large, the others' smaller, and all cast.
  Scene scene;
  scene.add_floor({0, 0, 0}, 5.0);
  scene.add_box({-0.5, 1, -0.5}, {0.5, 1.1, 0.5});
  for (int i = 0; i < 3; ++i) scene.add_light(light(HEDDLE_LIGHT_POINT), {0, 3, 0});
  scene.look({0, 3, 4}, {0, 0, 0});
  Host::get().log.clear();
  for (const std::uint32_t index : {0U, 1U, 2U}) {
    Patch patch{{-2, 0, -2}, {4, 0, 0}, {0, 0, 4}, {0, 1, 0}};
    patch.camera = {0, 3, 4};
    patch.light = index;
    // The box's shadow on the floor: 3 / 1.9 of its upper face; texels of the smaller maps are up to 50 mm there.
    expect_everywhere(ask(scene, patch, shadow_map("params.views = 8\n")), patch, [](const dvec3& p) {
      const double reach = std::max(std::abs(p.x), std::abs(p.z));
      return reach < 0.75 - 0.2 ? 0.0 : reach > 0.79 + 0.25 ? 1.0 : -1.0;
    });
  }
  EXPECT_THAT(Host::get().log, testing::Each(testing::Not(testing::HasSubstr("no room"))));
}

TEST(ShadowMap, SameInputGivesTheSameBytes) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 10.0);
  scene.add_sphere({0, 1, 0}, 0.5, 64);
  scene.add_light(light(HEDDLE_LIGHT_POINT), {0.3, 4, 0.2});
  scene.look({0, 2, 4}, {0, 0, 0});
  Patch patch{{-1.5, 0, -1.5}, {3, 0, 0}, {0, 0, 3}, {0, 1, 0}};
  patch.camera = {0, 2, 4};
  for (const std::string& pass : {shadow_map(), ray_traced()})
    EXPECT_EQ(ask(scene, patch, pass).pixels, ask(scene, patch, pass).pixels);
}

// ---- ray_marched_screen ---------------------------------------------------------------------------------------------

TEST(ContactShadow, H1PlaneDoesNotShadowItselfAtGrazingLightOrView) {
  for (const double NoL : {0.05, 0.3}) {
    for (const double height : {0.3, 3.0}) {  // of the camera: the view grazes as well
      for (const double azimuth : {0.0, 1.4, 3.1}) {
        SCOPED_TRACE(std::to_string(NoL) + " " + std::to_string(height) + " " + std::to_string(azimuth));
        const double level = std::sqrt(1 - NoL * NoL);
        const dvec3 to_light(level * std::sin(azimuth), NoL, level * std::cos(azimuth));
        Scene scene;
        scene.add_floor({0, 0, 0}, 200.0);
        scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, -to_light));
        const dvec3 camera(0, height, 4);
        scene.look(camera, {0, 0, 0});
        Patch patch{{-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, {0, 1, 0}};
        patch.camera = camera;
        patch.grid = 512;
        expect_everywhere(ask(scene, patch, contact("params.distance = 1.0\nparams.steps = 64\n")), patch,
                          [](const dvec3&) { return 1.0; });
      }
    }
  }
}

TEST(ContactShadow, BoxOnTheFloorDarkensItsFootAndNothingElse) {
  // Light from the left, seen from the front: the floor right of the box is dark within the ray's length.
  const dvec3 to_light = glm::normalize(dvec3(-1, 1, 0));
  Scene scene;
  scene.add_floor({0, 0, 0}, 50.0);
  scene.add_box({-0.3, 0, -0.3}, {0, 0.3, 0.3});
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, -to_light));
  const dvec3 camera(0, 1.5, 2.5);
  scene.look(camera, {0, 0, 0});
  Patch patch{{0.001, 0, -0.1}, {1, 0, 0}, {0, 0, 0.2}, {0, 1, 0}};
  patch.camera = camera;
  patch.grid = 512;
  const Image image =
      ask(scene, patch,
          contact("params.distance = 0.4\nparams.steps = 64\nparams.thickness = 0.5\nparams.dither = false\n"));
  // The true shadow ends at x = 0.3. The ray meets the box within its first part, where nothing fades, up to 0.15; the
  // pixels are 6 mm.
  expect_everywhere(image, patch, [](const dvec3& p) { return p.x < 0.15 ? 0.0 : p.x > 0.33 ? 1.0 : -1.0; });
}

TEST(ContactShadow, NeverLooksPastTheLight) {
  // A lamp between floor and ceiling slab: the slab behind the lamp must not shadow, however long the ray.
  Scene scene;
  scene.add_floor({0, 0, 0}, 50.0);
  scene.add_box({-0.5, 0.8, -0.5}, {0.5, 0.9, 0.5});
  scene.add_light(light(HEDDLE_LIGHT_POINT), {0, 0.5, 0});
  const dvec3 camera(0, 0.6, 3);
  scene.look(camera, {0, 0.3, 0});
  Patch patch{{-0.2, 0, -0.2}, {0.4, 0, 0}, {0, 0, 0.4}, {0, 1, 0}};
  patch.camera = camera;
  patch.grid = 512;
  const std::string parameters = "params.distance = 5.0\nparams.steps = 128\nparams.thickness = 10.0\n";
  expect_everywhere(ask(scene, patch, contact(parameters)), patch, [](const dvec3&) { return 1.0; });
}

TEST(ContactShadow, WithoutDepthEverythingIsLit) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 5.0);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {0.5, -1, 0}));
  scene.look({0, 3, 4}, {0, 0, 0});
  Patch patch{{-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, {0, 1, 0}};
  patch.camera = {0, 3, 4};
  patch.grid = 512;
  expect_everywhere(
      ask(scene, patch, "[[pass]]\nname = \"contact\"\nrole = \"shadow\"\ntechnique = \"ray_marched_screen\"\n"), patch,
      [](const dvec3&) { return 1.0; });
}

TEST(ShadowJoin, ProductOfTwoProvidersIsTheProductOfTheirAnswers) {
  Scene scene;
  scene.add_floor({0, 0, 0}, 50.0);
  scene.add_box({-0.3, 0, -0.3}, {0, 0.3, 0.3});
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {1, -1, 0.2}));
  const dvec3 camera(0.5, 1.5, 2.5);
  scene.look(camera, {0, 0, 0});
  Patch patch{{-0.5, 0, -0.5}, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}};
  patch.camera = camera;
  patch.grid = 512;
  const Image map = ask(scene, patch, shadow_map());
  const Image screen = ask(scene, patch, contact());
  const Image both = ask(scene, patch, shadow_map() + contact());
  for (std::size_t i = 0; i < both.pixels.size(); i += 4) {
    EXPECT_FLOAT_EQ(both.pixels[i], map.pixels[i] * screen.pixels[i]);
  }
}

TEST(ShadowJoin, EveryCombinationOfProvidersRendersUnderLighting) {
  // lavapipe 22.3 writes past a table where a branch hangs on a uniform of the fourth block or later, and dies or not
  // by what lies behind it: each combination gives the blocks other numbers.
  Scene scene;
  scene.add_floor({0, 0, 0}, 50.0);
  scene.add_light(light(HEDDLE_LIGHT_DIRECTIONAL, {1, -1, 0.2}));
  scene.look({0.5, 1.5, 2.5}, {0, 0, 0});
  const std::string second_map = "[[pass]]\nname = \"second\"\nrole = \"shadow\"\ntechnique = \"shadow_map\"\n";
  const std::string gbuffer = "[[pass]]\nrole = \"gbuffer\"\ntechnique = \"raster\"\n";
  const std::string screen = contact().substr(contact().find("[[pass]]", 1));
  for (const std::string& shadows : {shadow_map(), screen, shadow_map() + screen, shadow_map() + screen + second_map,
                                     ray_traced(), ray_traced() + screen}) {
    for (const std::string& sky :
         {std::string(), std::string("[[pass]]\nrole = \"sky\"\ntechnique = \"procedural\"\n")}) {
      for (const std::string& material :
           {std::string(), std::string("[[pass]]\nrole = \"surface_material\"\ntechnique = \"ggx\"\n")}) {
        SCOPED_TRACE(sky + shadows + material);
        Graph graph("extent = [64, 64]\noutput = \"lighting.radiance\"\n" + sky + gbuffer + shadows + material +
                    "[[pass]]\nrole = \"lighting\"\ntechnique = \"deferred\"\n");
        const Image image = graph.image(scene);
        ASSERT_EQ(image.width, 64U);
        EXPECT_GT(image.at(32, 40), 0.0F);
      }
    }
  }
}

}  // namespace
