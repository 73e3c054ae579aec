// SPDX-License-Identifier: Apache-2.0
// views/placed: the scene from above, from a place of its own, into one tile of an image that is kept; and what a
// technique may get wrong with placed drawings. For tests.
#include <heddle/views.hpp>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what is drawn"),
    image_out_sized("color", VK_FORMAT_R32G32B32A32_SFLOAT, 32, 16, "positions", HEDDLE_PORT_KEPT),
};
constexpr heddle_parameter kParameters[] = {
    triple("origin", "m", -1e9, 1e9, {0, 0, 0}, "of the drawing, in the scene"),
    integer("tile", "1", 0, 1, 0, "left or right half"),
    toggle("front", false, "looks along -Z, not down"),
    toggle("clears", true, "heddle_placed_draw.clears"),
    integer("mistake", "1", 0, 3, 0, "1: no view; 2: an order; 3: another port"),
};
constexpr heddle_access kDraw[] = {drawn("surfaces"), color_cleared("color", {-1, -1, -1, -1})};
constexpr heddle_stage kStages[] = {gpu_stage("draw", kDraw)};
constexpr heddle_shader kShaders[] = {surfaces_shader("positions", "draw", "positions.frag.glsl")};

/// Orthographic, 2 m wide, 100 m deep: down, or from the front along -Z.
HeddleView view_of(bool is_from_front) {
  HeddleView view{};
  const float down[16] = {1, 0, 0, 0, 0, 0, 0.01F, 0, 0, 1, 0, 0, 0, 0, 0.5F, 1};
  const float from_front[16] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0.01F, 0, 0, 0, 0.5F, 1};
  for (int i = 0; i < 16; ++i) view.clip_from_rel[i] = is_from_front ? from_front[i] : down[i];
  view.is_orthographic = 1;
  return view;
}

struct Placed {
  Look last{};
  std::uint32_t activity(const Frame& frame) {
    const heddle_status status = with_drawing(frame, [&](const Views& views, const heddle_placed_draw& placed) {
      Look look{};
      const heddle_status seen = views.look(placed, look);
      count(frame.host(), "changes", look != last ? 1 : 0);
      last = look;
      return seen;
    });
    const auto views = Views::of(frame);
    count(frame.host(), "lights", views->light_position(0) ? 1 : 0);
    count(frame.host(), "lights", views->light_position(1) ? 1 : 0);
    return status == HEDDLE_OK ? HEDDLE_RUN : HEDDLE_NOTHING;
  }
  heddle_status record(const Frame& frame) const {
    return with_drawing(frame, [](const Views& views, const heddle_placed_draw& placed) { return views.draw(placed); });
  }

 private:
  template <typename Use>
  static heddle_status with_drawing(const Frame& frame, const Use& use) {
    const PassHost host = frame.host();
    const auto views = Views::of(frame);
    if (!views) return HEDDLE_UNSUPPORTED;
    const std::int32_t mistake = host.integer("mistake");
    const HeddleView view = view_of(host.toggle("front"));
    heddle_draw drawing = Frame::drawing("positions", mistake == 3 ? "color" : "surfaces");
    if (mistake != 1) drawing.view = &view;
    if (mistake == 2) drawing.order = HEDDLE_ORDER_BACK_TO_FRONT;
    drawing.x = host.integer("tile") == 1 ? 16 : 0;
    drawing.width = drawing.height = 16;
    heddle_placed_draw placed{};
    placed.struct_size = sizeof placed;
    placed.clears = host.toggle("clears") ? 1 : 0;
    placed.draw = &drawing;
    const std::array<double, 3> origin = host.parameter3("origin");
    for (std::size_t i = 0; i < 3; ++i) placed.origin[i] = origin[i];
    return use(*views, placed);
  }
};

constexpr heddle_technique kPlaced = technique<Placed>("views/placed", "Positions seen from a place", "definition",
                                                       kPorts, kParameters, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kPlaced)
