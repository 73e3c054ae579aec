// SPDX-License-Identifier: Apache-2.0
// shadow/cascaded: directional lights and surfaces to cascades of depth maps that stand still under the camera, of
// which those are drawn that would look different by now, and the function that looks points up in them.
#include "cascades.hpp"
#include "kept_maps.hpp"

#include <heddle/pass.hpp>

#include <algorithm>
#include <string>

namespace {

using namespace heddle::pass;
using cascaded::LightCascades;
using cascaded::Settings;
using depth_maps::LookupView;

constexpr std::uint32_t kMostTaps = 64;
constexpr std::uint32_t kMostCascades = 8;
constexpr std::uint32_t kMostSuns = 8;
constexpr std::uint32_t kMostLights = 4096;
constexpr const char* kSettings = "shadow.settings";  // component of a light: role.toml

constexpr double kMostDistance = 100.0;      // metres: of `distance` 0, in scenes of things of a usual size
constexpr double kUsualNearest = 2.0;        // metres: of `nearest` 0 ...
constexpr double kDistanceOfNearest = 50.0;  // ... and of it where `distance` goes by the scene

constexpr double kResolutionLadder[] = {512, 1024, 2048, 4096};
constexpr double kCascadesLadder[] = {1, 2, 3, 4, 6, 8};
constexpr double kSplitLadder[] = {0, 0.5, 0.8, 1};
constexpr double kBlendLadder[] = {0, 0.1, 0.2, 0.4};
constexpr double kTapsLadder[] = {1, 4, 9, 16, 25, 49};

constexpr heddle_parameter kParameters[] = {
    knob(integer("resolution", "px", 64, 8192, 1024, "side of one depth map", HEDDLE_PARAMETER_REDECLARE),
         kResolutionLadder),
    knob(integer("cascades", "1", 1, kMostCascades, 4, "depth maps of a light", HEDDLE_PARAMETER_REDECLARE),
         kCascadesLadder),
    integer("suns", "1", 1, kMostSuns, 1, "directional lights that there is room for", HEDDLE_PARAMETER_REDECLARE),
    parameter("distance", "m", 0, 1e7, 0, "how far from the camera lights cast shadows; 0: by the scene"),
    parameter("nearest", "m", 0, 1e7, 0,
              "distance from which on texels may grow as pixels do; 0: 2, or by the scene as well"),
    knob(parameter("split", "1", 0, 1, 0.8, "1: cascades reach farther by equal factors; 0: by equal distances"),
         kSplitLadder),
    parameter("caster_distance", "m", 0, 1e7, 200, "how far towards the light, outside of the view, casters are drawn"),
    knob(parameter("blend", "1", 0, 1, 0.2, "part of a cascade, at its border, that fades into the next one"),
         kBlendLadder),
    parameter("slack", "px", 1, 256, 16, "texels that the camera may go before a map follows it and is drawn again"),
    knob(integer("filter_taps", "1", 1, kMostTaps, 9, "bilinear comparisons averaged for each lookup"), kTapsLadder),
    parameter("filter_radius", "px", 0, 16, 1.5, "radius, in texels, of the disk that they are spread over"),
    toggle("keep", true, "maps that would look the same are not drawn again; false is for measuring"),
};

constexpr heddle_port kPorts[] = {
    value_in("lights", "the lights, of which directional ones get cascades"),
    surfaces_in("surfaces", "what casts"),
    value_in("camera", "the main view: where lights need their texels"),
    image_out_sized("atlas", VK_FORMAT_D32_SFLOAT, 1024, 1024, "a depth map a layer, reversed depth", HEDDLE_PORT_KEPT,
                    4),
    value_out("shadow_views", kMostSuns* kMostCascades * sizeof(LookupView), "seven vec4 a map",
              "vec4 shadow_views[];"),
    value_out("light_cascades", kMostLights * sizeof(LightCascades),
              "for each light: first map, number of maps, blend, filter radius", "uvec4 light_cascades[];"),
    value_out("kernel", kMostTaps * 4 * sizeof(float), "filter taps, in filter radii; z: how far shadows reach, m",
              "vec4 kernel[];"),
};

constexpr heddle_access kFitAccesses[] = {value("lights"), value("camera"), value("shadow_views"),
                                          value("light_cascades"), value("kernel")};
// shadow_views: the maps that are drawn are those that fit_views made. Cleared: each map its own layer.
constexpr heddle_access kDrawAccesses[] = {drawn("surfaces"), value("shadow_views"), depth_cleared("atlas")};
constexpr heddle_access kFunctionAccesses[] = {value("lights"), value("shadow_views"), value("light_cascades"),
                                               value("kernel"), sampled_compare("atlas")};

enum : std::uint32_t { kFitViews, kDrawDepth };
constexpr heddle_stage kStages[] = {cpu_stage("fit_views", kFitAccesses), gpu_stage("draw_depth", kDrawAccesses)};
// No depth bias: the lookup's normal offset is the whole of it.
constexpr heddle_shader kShaders[] = {surfaces_shader("depth", "draw_depth", "")};
constexpr heddle_function kFunctions[] = {function("shadow", "cascaded.glsl", kFunctionAccesses)};

Settings settings_of(const PassHost& host) {
  Settings settings;
  settings.resolution = static_cast<std::uint32_t>(host.integer("resolution"));
  settings.cascades = static_cast<std::uint32_t>(host.integer("cascades"));
  settings.distance = host.parameter("distance");
  settings.nearest = host.parameter("nearest");
  settings.split = host.parameter("split");
  settings.caster_distance = host.parameter("caster_distance");
  settings.filter_radius = host.parameter("filter_radius");
  settings.slack = host.parameter("slack");
  return settings;
}

class Cascaded : public depth_maps::DepthMapAtlas {
 public:
  Cascaded() : DepthMapAtlas(kDrawDepth) {}

  heddle_status declare(const PassHost& host) {
    capacity_ = static_cast<std::uint32_t>(host.integer("suns"));
    heddle_shape shape{};
    shape.width = shape.height = static_cast<std::uint32_t>(host.integer("resolution"));
    shape.layers = capacity_ * static_cast<std::uint32_t>(host.integer("cascades"));
    return host.set_shape("atlas", shape);
  }

  heddle_status execute(const Frame& frame) {
    heddle_status status = fit_views(frame);
    if (status == HEDDLE_OK) status = set_values(frame, reach_);
    if (status == HEDDLE_OK) status = frame.set_value("light_cascades", std::span<const LightCascades>(lights_));
    return status;
  }

 private:
  static bool has_cascades(const HeddleLight& light) {
    const bool shines = light.intensity[0] > 0 || light.intensity[1] > 0 || light.intensity[2] > 0;
    return light.type == HEDDLE_LIGHT_DIRECTIONAL && shines && (light.flags & HEDDLE_LIGHT_CASTS_SHADOW) != 0;
  }

  heddle_status fit_views(const Frame& frame) {
    Settings general = settings_of(frame.host());
    const auto blend = static_cast<float>(frame.host().parameter("blend"));
    std::optional<Components> components;
    if (const heddle_status status = frame.components(kSettings, components); status != HEDDLE_OK) return status;
    const auto lights = frame.value<HeddleLight>("lights");
    const auto camera = frame.value<HeddleView>("camera");
    const glm::dvec3 origin(frame.info().origin[0], frame.info().origin[1], frame.info().origin[2]);
    begin_maps();
    lights_.assign(std::min<std::size_t>(lights.size(), kMostLights), LightCascades{});
    if (camera.empty()) return HEDDLE_OK;
    const bool goes_by_scene = general.distance <= 0.0;
    if (goes_by_scene) {
      const auto [distance, caster_distance] =
          depth_maps::reach_of_scene(frame.host(), camera.front(), origin, kMostDistance, general.caster_distance);
      general.distance = distance;
      general.caster_distance = caster_distance;
    }
    reach_ = general.distance;
    if (general.nearest <= 0.0) general.nearest = goes_by_scene ? reach_ / kDistanceOfNearest : kUsualNearest;
    std::size_t without_map = 0;
    for (const std::size_t i : order_of(lights, *components)) {
      if (i >= lights_.size() || map_count() == std::size_t{capacity_} * general.cascades) {
        ++without_map;
        continue;
      }
      Settings settings = general;
      if (const auto row = components->find(HEDDLE_OWNER_LIGHT, lights[i].id))
        settings.filter_radius = components->written(*row, "filter_radius").value_or(settings.filter_radius);
      lights_[i] = {map_count(), settings.cascades, blend, static_cast<float>(settings.filter_radius)};
      for (const depth_maps::MapView& view : cascaded::make_views(lights[i], camera.front(), origin, settings))
        add_map(view, {map_count(), 0, 0, settings.resolution}, origin, settings.resolution);
    }
    tell_of_lights_without_map(frame.host(), without_map, "directional light", "raise the parameter 'suns'");
    return HEDDLE_OK;
  }

  /// Directional lights in the order in which they choose: by priority, then as the scene has them.
  static std::vector<std::size_t> order_of(std::span<const HeddleLight> lights, const Components& components) {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < lights.size(); ++i)
      if (has_cascades(lights[i])) order.push_back(i);
    const auto priority = [&](std::size_t i) {
      const auto row = components.find(HEDDLE_OWNER_LIGHT, lights[i].id);
      return row ? components.values(*row, "priority")[0] : 0.0;
    };
    std::ranges::stable_sort(order, std::ranges::greater{}, priority);
    return order;
  }

  std::vector<LightCascades> lights_;  // of this frame, for each light
  double reach_ = 0;                   // metres, of shadows
  std::uint32_t capacity_ = 0;         // lights that have layers
};

constexpr heddle_technique kCascaded = [] {
  heddle_technique t = technique<Cascaded>(
      "shadow/cascaded", "Cascaded depth maps for directional lights, still under the camera, blended and kept",
      "Engel 2006, Cascaded Shadow Maps, ShaderX5; Zhang, Sun, Xu and Lun 2006, Parallel-split shadow maps for "
      "large-scale virtual environments",
      kPorts, kParameters, kStages, kShaders, kFunctions);
  t.components = kSettings;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kCascaded)
