// SPDX-License-Identifier: Apache-2.0
// Draws the depth maps that would look different by now, and leaves the others in the atlas as they are.
#pragma once

#include "depth_maps.hpp"

#include <heddle/meshes.hpp>
#include <heddle/views.hpp>

#include <map>
#include <span>
#include <string>
#include <vector>

namespace depth_maps {

/// reach_of_scene of depth_maps.hpp, from where a view of this frame stands.
inline Reach reach_of_scene(const heddle::pass::PassHost& host, const HeddleView& view, const glm::dvec3& origin,
                            double most, double caster_distance) {
  const heddle::pass::Meshes meshes(host);
  const heddle_scene_content& scene = meshes.content();
  const glm::dvec3 eye = origin + glm::dvec3(view.rel_from_view[12], view.rel_from_view[13], view.rel_from_view[14]);
  return reach_of_scene(scene.bounds, scene.typical_size, eye, most, caster_distance);
}

/// A map of this frame and where it is drawn.
struct PlacedMap {
  MapView view;
  Tile tile;
};

/// What techniques have in common that look points up in an atlas of depth maps. Their stage `draw_depth` has the atlas
/// as depth attachment, HEDDLE_PORT_KEPT, and a depth-only surface shader "depth"; ports and parameters are called
/// shadow_views, kernel, filter_taps and keep.
class DepthMapAtlas {
 public:
  /// The atlas may be another than before.
  heddle_status prepare(const heddle::pass::PassHost&) {
    looks_.clear();
    return HEDDLE_OK;
  }

  /// Finds out which of the frame's maps are to be drawn.
  std::uint32_t activity(const heddle::pass::Frame& frame) {
    if (frame.stage() != draw_stage_) return HEDDLE_RUN;
    if (frame.info().cut != 0 && frame.info().iteration == 0) looks_.clear();
    const bool draws_all = !frame.host().toggle("keep");
    due_.clear();
    std::map<Place, heddle::pass::Look> looks;
    const auto views = heddle::pass::Views::of(frame);
    for (const PlacedMap& map : maps_) {
      heddle::pass::Look look{};
      // An error ends the frame, and all that is kept with it.
      if (!views || with_drawing(map, [&](const auto& placed) { return views->look(placed, look); }) != HEDDLE_OK)
        break;
      const auto known = looks_.find(place_of(map.tile));
      if (draws_all || known == looks_.end() || known->second != look) due_.push_back(&map);
      looks.emplace(place_of(map.tile), look);
    }
    looks_ = std::move(looks);
    heddle::pass::count(frame.host(), "maps_drawn", due_.size());
    heddle::pass::count(frame.host(), "maps_kept", maps_.size() - due_.size());
    return due_.empty() ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  /// Draws what activity() found.
  heddle_status record(const heddle::pass::Frame& frame) const {
    const auto views = heddle::pass::Views::of(frame);
    if (!views) return HEDDLE_UNSUPPORTED;
    for (const PlacedMap* map : due_) {
      const heddle_status status = with_drawing(*map, [&](const auto& placed) { return views->draw(placed); });
      if (status != HEDDLE_OK) return status;
    }
    return HEDDLE_OK;
  }

 protected:
  explicit DepthMapAtlas(std::uint32_t draw_stage) : draw_stage_(draw_stage) {}

  /// In execute, before the frame's maps are added.
  void begin_maps() {
    maps_.clear();
    lookups_.clear();
  }
  [[nodiscard]] std::uint32_t map_count() const { return static_cast<std::uint32_t>(maps_.size()); }
  void add_map(const MapView& view, const Tile& tile, const glm::dvec3& frame_origin, std::uint32_t layer_side) {
    maps_.push_back({view, tile});
    lookups_.push_back(make_lookup(view, frame_origin, tile, layer_side));
  }
  /// In execute, when all are added.
  /// `reach`: metres from the camera to where parallel lights cast no shadow any more.
  [[nodiscard]] heddle_status set_values(const heddle::pass::Frame& frame, double reach) const {
    auto kernel = make_kernel(static_cast<std::uint32_t>(frame.host().integer("filter_taps")));
    for (std::array<float, 4>& tap : kernel) tap[2] = static_cast<float>(reach);
    const heddle_status status = frame.set_value("shadow_views", std::span<const LookupView>(lookups_));
    if (status != HEDDLE_OK) return status;
    return frame.set_value("kernel", std::span<const std::array<float, 4>>(kernel));
  }
  /// Says once for each number of lights that have no map, not in every frame. `what`: "light", `help`: what to do.
  void tell_of_lights_without_map(const heddle::pass::PassHost& host, std::size_t count, const std::string& what,
                                  const std::string& help) {
    if (count == told_of_) return;
    told_of_ = count;
    if (count == 0) return;
    host.warn(std::to_string(count) + " " + what + (count == 1 ? " finds" : "s find") +
              " no room in the atlas and cast no shadow; " + help);
  }

 private:
  using Place = std::array<std::uint32_t, 4>;
  static Place place_of(const Tile& tile) { return {tile.layer, tile.x, tile.y, tile.side}; }

  template <typename Use>
  static heddle_status with_drawing(const PlacedMap& map, const Use& use) {
    heddle_draw drawing = heddle::pass::Frame::drawing("depth");
    drawing.view = &map.view.draw;
    drawing.include = HEDDLE_SURFACE_CASTS_SHADOW;
    drawing.layer = map.tile.layer;
    drawing.x = map.tile.x;
    drawing.y = map.tile.y;
    drawing.width = drawing.height = map.tile.side;
    heddle_placed_draw placed{};
    placed.struct_size = sizeof placed;
    placed.clears = 1;
    placed.draw = &drawing;
    for (int i = 0; i < 3; ++i) placed.origin[i] = map.view.origin[i];
    return use(placed);
  }

  std::uint32_t draw_stage_;
  std::vector<PlacedMap> maps_;                // of this frame
  std::vector<LookupView> lookups_;            // parallel to maps_
  std::map<Place, heddle::pass::Look> looks_;  // of what is in the atlas
  std::vector<const PlacedMap*> due_;          // of maps_
  std::size_t told_of_ = 0;                    // lights without a map that the last warning counted
};

}  // namespace depth_maps
