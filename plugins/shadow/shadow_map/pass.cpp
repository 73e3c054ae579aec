// SPDX-License-Identifier: Apache-2.0
// shadow/shadow_map: lights and surfaces to an atlas of depth maps, of which those are drawn that would look different
// by now, and the function that looks points up in it.
#include "kept_maps.hpp"
#include "views.hpp"

#include <heddle/pass.hpp>

#include <algorithm>
#include <numeric>
#include <string>

namespace {

using namespace heddle::pass;
using depth_maps::LookupView;
using depth_maps::Square;
using shadow_map::LightViews;
using shadow_map::Settings;

constexpr std::uint32_t kMostTaps = 64;
constexpr std::uint32_t kMostViews = 64;
constexpr std::uint32_t kMostMaps = 8192;
constexpr std::uint32_t kMostLights = 4096;
constexpr const char* kSettings = "shadow.settings";  // component of a light: role.toml

constexpr double kMostDistance = 60.0;  // metres: of `distance` 0, in scenes of things of a usual size

constexpr double kResolutionLadder[] = {512, 1024, 2048, 4096};
constexpr double kCascadesLadder[] = {1, 2, 3, 4};
constexpr double kTapsLadder[] = {1, 4, 9, 16, 25, 49};
constexpr double kFinenessLadder[] = {0.25, 0.5, 1, 2, 4};

constexpr heddle_parameter kParameters[] = {
    knob(integer("resolution", "px", 64, 8192, 1024, "side of the largest depth maps", HEDDLE_PARAMETER_REDECLARE),
         kResolutionLadder),
    integer("views", "1", 2, kMostViews, 16,
            "room of the atlas, in largest maps: a directional light takes `cascades`, a spot or box 1, others 6",
            HEDDLE_PARAMETER_REDECLARE),
    knob(parameter("texels_per_pixel", "1", 0.125, 64, 1,
                   "maps of lights with a range are halved until, at the least, a pixel sees so many texels"),
         kFinenessLadder),
    integer("smallest", "px", 16, 8192, 64, "side below which no map is halved"),
    knob(integer("cascades", "1", 0, 4, 3,
                 "depth maps of a directional light, each three times wider than the last; 0: it casts no shadow"),
         kCascadesLadder),
    parameter("distance", "m", 0, 1e7, 0, "how far from the camera directional lights cast shadows; 0: by the scene"),
    parameter("caster_distance", "m", 0, 1e7, 200,
              "how far towards a directional light, outside of the view, casters are drawn"),
    parameter("near_distance", "m", 1e-6, 100, 0.02,
              "what is nearer than this to a light with a position casts no shadow"),
    knob(integer("filter_taps", "1", 1, kMostTaps, 9, "bilinear comparisons averaged for each lookup"), kTapsLadder),
    parameter("filter_radius", "px", 0, 16, 1.5, "radius, in texels, of the disk that they are spread over"),
    toggle("keep", true, "maps that would look the same are not drawn again; false is for measuring"),
};

constexpr heddle_port kPorts[] = {
    value_in("lights", "the lights that get depth maps"),
    surfaces_in("surfaces", "what casts"),
    value_in("camera", "the main view: where directional lights need their texels"),
    image_out_sized("atlas", VK_FORMAT_D32_SFLOAT, 1024, 1024, "depth maps, reversed depth", HEDDLE_PORT_KEPT, 16),
    value_out("shadow_views", kMostMaps * sizeof(LookupView), "seven vec4 a map", "vec4 shadow_views[];"),
    value_out("light_views", kMostLights * sizeof(LightViews),
              "for each light: first map, number of maps, layout, filter radius", "uvec4 light_views[];"),
    value_out("kernel", kMostTaps * 4 * sizeof(float), "filter taps, in filter radii; z: how far shadows reach, m",
              "vec4 kernel[];"),
};

constexpr heddle_access kFitAccesses[] = {value("lights"), value("camera"), value("shadow_views"), value("light_views"),
                                          value("kernel")};
// shadow_views: the maps that are drawn are those that fit_views made. Cleared: each map its own part.
constexpr heddle_access kDrawAccesses[] = {drawn("surfaces"), value("shadow_views"), depth_cleared("atlas")};
constexpr heddle_access kFunctionAccesses[] = {value("lights"), value("shadow_views"), value("light_views"),
                                               value("kernel"), sampled_compare("atlas")};

enum : std::uint32_t { kFitViews, kDrawDepth };
constexpr heddle_stage kStages[] = {cpu_stage("fit_views", kFitAccesses), gpu_stage("draw_depth", kDrawAccesses)};
// No depth bias: the lookup's normal offset is the whole of it (README equation 1).
constexpr heddle_shader kShaders[] = {surfaces_shader("depth", "draw_depth", "")};
constexpr heddle_function kFunctions[] = {function("shadow", "shadow_map.glsl", kFunctionAccesses)};

Settings settings_of(const PassHost& host) {
  Settings settings;
  settings.resolution = static_cast<std::uint32_t>(host.integer("resolution"));
  settings.smallest = static_cast<std::uint32_t>(host.integer("smallest"));
  settings.cascades = static_cast<std::uint32_t>(host.integer("cascades"));
  settings.distance = host.parameter("distance");
  settings.caster_distance = host.parameter("caster_distance");
  settings.near_distance = host.parameter("near_distance");
  settings.filter_radius = host.parameter("filter_radius");
  settings.fineness = host.parameter("texels_per_pixel");
  return settings;
}

class ShadowMap : public depth_maps::DepthMapAtlas {
 public:
  ShadowMap() : DepthMapAtlas(kDrawDepth) {}

  heddle_status declare(const PassHost& host) {
    capacity_ = static_cast<std::uint32_t>(host.integer("views"));
    heddle_shape shape{};
    shape.width = shape.height = static_cast<std::uint32_t>(host.integer("resolution"));
    shape.layers = capacity_;
    return host.set_shape("atlas", shape);
  }

  heddle_status execute(const Frame& frame) {
    heddle_status status = fit_views(frame);
    if (status == HEDDLE_OK) status = set_values(frame, reach_);
    if (status == HEDDLE_OK) status = frame.set_value("light_views", std::span<const LightViews>(light_views_));
    return status;
  }

 private:
  /// What the scene says of one light, over the parameters.
  static Settings settings_for(const HeddleLight& light, const Components& components, Settings settings) {
    const auto row = components.find(HEDDLE_OWNER_LIGHT, light.id);
    if (!row) return settings;
    settings.near_distance = components.written(*row, "near_distance").value_or(settings.near_distance);
    settings.filter_radius = components.written(*row, "filter_radius").value_or(settings.filter_radius);
    return settings;
  }

  /// Lights in the order in which they choose: by priority, then the sun before all others, then as the scene has them.
  static std::vector<std::size_t> order_of(std::span<const HeddleLight> lights, const Components& components) {
    std::vector<double> priorities(lights.size(), 0.0);
    for (std::size_t i = 0; i < lights.size(); ++i) {
      if (const auto row = components.find(HEDDLE_OWNER_LIGHT, lights[i].id))
        priorities[i] = components.values(*row, "priority")[0];
    }
    std::vector<std::size_t> order(lights.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      if (priorities[a] != priorities[b]) return priorities[a] > priorities[b];
      return lights[a].type == HEDDLE_LIGHT_DIRECTIONAL && lights[b].type != HEDDLE_LIGHT_DIRECTIONAL;
    });
    return order;
  }

  /// In the scene; exact unless another pass has moved the light.
  static glm::dvec3 position_of(const HeddleLight& light, const std::optional<Views>& views, const glm::dvec3& origin) {
    const auto said = views ? views->light_position(light.id) : std::nullopt;
    bool is_there = said.has_value();
    for (int i = 0; i < 3 && is_there; ++i) {
      const auto axis = static_cast<std::size_t>(i);
      is_there = static_cast<float>((*said)[axis] - origin[i]) == light.position_rel[i];
    }
    if (is_there) return {(*said)[0], (*said)[1], (*said)[2]};
    return origin + depth_maps::to_double(light.position_rel);
  }

  /// Gives depth maps to lights until none is left.
  heddle_status fit_views(const Frame& frame) {
    Settings general = settings_of(frame.host());
    std::optional<Components> components;
    if (const heddle_status status = frame.components(kSettings, components); status != HEDDLE_OK) return status;
    const auto views = Views::of(frame);
    const auto lights = frame.value<HeddleLight>("lights");
    const auto camera = frame.value<HeddleView>("camera");
    const glm::dvec3 origin(frame.info().origin[0], frame.info().origin[1], frame.info().origin[2]);
    begin_maps();
    light_views_.assign(std::min<std::size_t>(lights.size(), kMostLights), LightViews{});
    if (camera.empty()) return HEDDLE_OK;
    if (general.distance <= 0.0) {
      const auto [distance, caster_distance] =
          depth_maps::reach_of_scene(frame.host(), camera.front(), origin, kMostDistance, general.caster_distance);
      general.distance = distance;
      general.caster_distance = caster_distance;
    }
    reach_ = general.distance;

    const std::vector<std::size_t> order = order_of(lights, *components);
    std::vector<depth_maps::AtlasWish> wishes;
    for (const std::size_t i : order) {
      const Settings settings = settings_for(lights[i], *components, general);
      wishes.push_back({i, shadow_map::level_needed(lights[i], camera.front(), settings),
                        shadow_map::levels_of(settings) - 1, shadow_map::views_needed(lights[i], settings).count});
    }
    const auto& granted = places_.grant(wishes, capacity_, shadow_map::kMostLevels);
    std::size_t without_map = 0;
    for (std::size_t w = 0; w < wishes.size(); ++w) {
      const std::size_t i = order[w];
      const std::vector<Square>& squares = granted[w];
      if (wishes[w].count == 0) continue;
      if (squares.empty() || i >= light_views_.size() || map_count() + squares.size() > kMostMaps) {
        ++without_map;
        continue;
      }
      const Settings settings = settings_for(lights[i], *components, general);
      light_views_[i] = shadow_map::views_needed(lights[i], settings);
      light_views_[i].first = map_count();
      const depth_maps::Tile first = depth_maps::tile_of(squares.front(), settings.resolution);
      const auto made = shadow_map::make_views(lights[i], position_of(lights[i], views, origin), camera.front(), origin,
                                               settings, first.side);
      for (std::size_t k = 0; k < made.size(); ++k)
        add_map(made[k], depth_maps::tile_of(squares[k], settings.resolution), origin, settings.resolution);
    }
    tell_of_lights_without_map(frame.host(), without_map, "light", "raise the parameter 'views', or lower 'smallest'");
    return HEDDLE_OK;
  }

  std::vector<LightViews> light_views_;  // of this frame, for each light
  depth_maps::AtlasPlaces places_;
  double reach_ = 0;            // metres, of directional lights' shadows
  std::uint32_t capacity_ = 0;  // layers of the atlas
};

constexpr heddle_technique kShadowMap = [] {
  heddle_technique t = technique<ShadowMap>(
      "shadow/shadow_map", "Depth maps with percentage-closer filtering for directional, spot and point lights",
      "Williams 1978, Casting curved shadows on curved surfaces; Reeves, Salesin and Cook 1987, Rendering antialiased "
      "shadows with depth maps",
      kPorts, kParameters, kStages, kShaders, kFunctions);
  t.components = kSettings;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kShadowMap)
