// SPDX-License-Identifier: Apache-2.0
// Draws the depth maps that would look different by now, and leaves the others in the atlas as they are.
#pragma once

#include "depth_maps.hpp"

#include <heddle/views.hpp>

#include <map>
#include <span>
#include <vector>

namespace depth_maps {

/// A map of this frame and where it is drawn.
struct PlacedMap {
  MapView view;
  Tile tile;
};

/// For one atlas: a depth attachment that is HEDDLE_PORT_KEPT, of a stage with a depth-only surface shader.
class KeptMaps {
 public:
  /// Nothing that was drawn is there any more.
  void forget() { looks_.clear(); }

  /// In activity: finds out which of the frame's maps are to be drawn, all if `draws_all`, and what to answer.
  std::uint32_t choose(const heddle::pass::Frame& frame, std::span<const PlacedMap> maps, bool draws_all) {
    due_.clear();
    std::map<Place, heddle::pass::Look> looks;
    const auto views = heddle::pass::Views::of(frame);
    for (const PlacedMap& map : maps) {
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
    heddle::pass::count(frame.host(), "maps_kept", maps.size() - due_.size());
    return due_.empty() ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  /// In record: draws what choose() found; its maps are still where they were.
  heddle_status record(const heddle::pass::Frame& frame) const {
    const auto views = heddle::pass::Views::of(frame);
    if (!views) return HEDDLE_UNSUPPORTED;
    for (const PlacedMap* map : due_) {
      const heddle_status status = with_drawing(*map, [&](const auto& placed) { return views->draw(placed); });
      if (status != HEDDLE_OK) return status;
    }
    return HEDDLE_OK;
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

  std::map<Place, heddle::pass::Look> looks_;  // of what is in the atlas
  std::vector<const PlacedMap*> due_;
};

}  // namespace depth_maps
