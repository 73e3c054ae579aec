// SPDX-License-Identifier: Apache-2.0
// shadow/shadow_map: lights and surfaces to an atlas of depth maps, and the function that looks points up in it.
#include "views.hpp"

#include <heddle/pass.hpp>

#include <algorithm>
#include <numeric>
#include <string>

namespace {

using namespace heddle::pass;
using shadow_map::LightViews;
using shadow_map::MapView;
using shadow_map::Settings;
using shadow_map::ShadowView;

constexpr std::uint32_t kMostTaps = 64;
constexpr std::uint32_t kMostViews = 64;
constexpr std::uint32_t kMostLights = 4096;
constexpr const char* kSettings = "shadow.settings";  // component of a light: role.toml

constexpr double kResolutionLadder[] = {512, 1024, 2048, 4096};
constexpr double kCascadesLadder[] = {1, 2, 3, 4};
constexpr double kTapsLadder[] = {1, 4, 9, 16, 25, 49};

constexpr heddle_parameter kParameters[] = {
    knob(integer("resolution", "px", 64, 8192, 1024, "side of one depth map", HEDDLE_PARAMETER_REDECLARE),
         kResolutionLadder),
    integer("views", "1", 2, kMostViews, 16,
            "depth maps in the atlas: a directional light takes `cascades`, a spot or box 1, any other light 6",
            HEDDLE_PARAMETER_REDECLARE),
    knob(integer("cascades", "1", 1, 4, 3, "depth maps of a directional light, each three times wider than the last"),
         kCascadesLadder),
    parameter("distance", "m", 1e-3, 1e5, 60, "how far from the camera directional lights cast shadows"),
    parameter("caster_distance", "m", 0, 1e5, 200,
              "how far towards a directional light, outside of the view, casters are drawn"),
    parameter("near_distance", "m", 1e-6, 100, 0.02,
              "what is nearer than this to a light with a position casts no shadow"),
    knob(integer("filter_taps", "1", 1, kMostTaps, 9, "bilinear comparisons averaged for each lookup"), kTapsLadder),
    parameter("filter_radius", "px", 0, 16, 1.5, "radius, in texels, of the disk that they are spread over"),
};

constexpr heddle_port kPorts[] = {
    value_in("lights", "the lights that get depth maps, in their order, directional ones first"),
    surfaces_in("surfaces", "what casts"),
    value_in("camera", "the main view: where directional lights need their texels"),
    image_out_sized("atlas", VK_FORMAT_D32_SFLOAT, 1024, 1024, "a depth map a layer, reversed depth", 0, 16),
    value_out("shadow_views", kMostViews * sizeof(ShadowView), "six vec4 a layer", "vec4 shadow_views[];"),
    value_out("light_views", kMostLights * sizeof(LightViews),
              "for each light: first layer, number of layers, layout, filter radius", "uvec4 light_views[];"),
    value_out("kernel", kMostTaps * 4 * sizeof(float), "filter taps, in filter radii", "vec4 kernel[];"),
};

constexpr heddle_access kFitAccesses[] = {value("lights"), value("camera"), value("shadow_views"), value("light_views"),
                                          value("kernel")};
// shadow_views: the views that are drawn are those that fit_views made.
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
  settings.cascades = static_cast<std::uint32_t>(host.integer("cascades"));
  settings.distance = host.parameter("distance");
  settings.caster_distance = host.parameter("caster_distance");
  settings.near_distance = host.parameter("near_distance");
  settings.filter_radius = host.parameter("filter_radius");
  return settings;
}

class ShadowMap {
 public:
  heddle_status declare(const PassHost& host) {
    capacity_ = static_cast<std::uint32_t>(host.integer("views"));
    heddle_shape shape{};
    shape.width = shape.height = static_cast<std::uint32_t>(host.integer("resolution"));
    shape.layers = capacity_;
    return host.set_shape("atlas", shape);
  }

  heddle_status execute(const Frame& frame) {
    if (const heddle_status status = fit_views(frame); status != HEDDLE_OK) return status;
    std::vector<ShadowView> lookups;
    for (const MapView& view : views_) lookups.push_back(view.lookup);
    const auto kernel = shadow_map::make_kernel(static_cast<std::uint32_t>(frame.host().integer("filter_taps")), 1.0);
    heddle_status status = frame.set_value("shadow_views", std::span<const ShadowView>(lookups));
    if (status == HEDDLE_OK) status = frame.set_value("light_views", std::span<const LightViews>(light_views_));
    if (status == HEDDLE_OK) status = frame.set_value("kernel", std::span<const std::array<float, 4>>(kernel));
    return status;
  }

  heddle_status record(const Frame& frame) {
    for (std::size_t i = 0; i < views_.size(); ++i) {
      heddle_draw drawing = Frame::drawing("depth");
      drawing.view = &views_[i].draw;
      drawing.include = HEDDLE_SURFACE_CASTS_SHADOW;
      drawing.layer = static_cast<std::uint32_t>(i);
      if (const heddle_status status = frame.draw(drawing); status != HEDDLE_OK) return status;
    }
    if (!views_.empty()) return HEDDLE_OK;
    // No light has a map. Callers bind the atlas all the same, so it must hold something: one clear, no triangles.
    heddle_draw nothing = Frame::drawing("depth");
    const HeddleView view{};
    nothing.view = &view;
    nothing.require = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_BLENDED;  // no surface is both
    return frame.draw(nothing);
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

  /// Gives depth maps to lights until none is left.
  heddle_status fit_views(const Frame& frame) {
    const Settings general = settings_of(frame.host());
    std::optional<Components> components;
    if (const heddle_status status = frame.components(kSettings, components); status != HEDDLE_OK) return status;
    const auto lights = frame.value<HeddleLight>("lights");
    const auto camera = frame.value<HeddleView>("camera");
    const double* origin = frame.info().origin;
    views_.clear();
    light_views_.assign(std::min<std::size_t>(lights.size(), kMostLights), LightViews{});
    if (camera.empty()) return HEDDLE_OK;
    std::size_t without_map = 0;
    for (const std::size_t i : order_of(lights, *components)) {
      const Settings settings = settings_for(lights[i], *components, general);
      LightViews needed = shadow_map::views_needed(lights[i], settings);
      if (needed.count == 0) continue;
      if (i >= light_views_.size() || views_.size() + needed.count > capacity_) {
        ++without_map;
        continue;
      }
      needed.first = static_cast<std::uint32_t>(views_.size());
      light_views_[i] = needed;
      const auto made =
          shadow_map::make_views(lights[i], camera.front(), glm::dvec3(origin[0], origin[1], origin[2]), settings);
      views_.insert(views_.end(), made.begin(), made.end());
    }
    tell_of_lights_without_map(frame.host(), without_map);
    return HEDDLE_OK;
  }

  /// Says once for each number of such lights, not in every frame.
  void tell_of_lights_without_map(const PassHost& host, std::size_t count) {
    if (count == told_of_) return;
    told_of_ = count;
    if (count == 0) return;
    host.warn(std::to_string(count) + (count == 1 ? " light finds" : " lights find") + " no room among the " +
              std::to_string(capacity_) + " depth maps and cast no shadow; raise the parameter 'views'");
  }

  std::vector<MapView> views_;           // of this frame; layer i of the atlas
  std::vector<LightViews> light_views_;  // of this frame, for each light
  std::uint32_t capacity_ = 0;           // layers of the atlas
  std::size_t told_of_ = 0;              // lights without a map that the last warning counted
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
