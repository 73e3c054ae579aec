// SPDX-License-Identifier: Apache-2.0
// contents/asks: draws the scene into two layers of two images, in the ways of `how`, and counts which of them are said
// to be neutral afterwards. For tests.
#include <heddle/contents.hpp>
#include <heddle/views.hpp>

namespace {

using namespace heddle::pass;

constexpr VkFormat kFormat = VK_FORMAT_R32G32B32A32_SFLOAT;
constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what is drawn"),
    value_in("camera", "where from"),
    image_in("absent", "bound to nothing", HEDDLE_PORT_OPTIONAL),
    image_out_sized("image", kFormat, 16, 16, "cleared to its neutral value", 0, 2),
    image_out_sized("other", kFormat, 16, 16, "cleared to another value", 0, 2),
};
constexpr const char* kHow[] = {"both_layers", "one_layer", "by_hand", "nothing", "placed", "undeclared", nullptr};
enum : std::uint32_t { kBothLayers, kOneLayer, kByHand, kNothing, kPlaced, kUndeclared };
constexpr heddle_parameter kParameters[] = {choice("how", kHow, kBothLayers, "what the first stage does")};
constexpr heddle_access kDraw[] = {drawn("surfaces"), value("camera"), color_cleared("image", {-1, -1, -1, -1}),
                                   color_cleared("other", {5, 5, 5, 5})};
constexpr heddle_access kAsk[] = {sampled("image"), sampled("other"), sampled("absent")};
constexpr heddle_stage kStages[] = {gpu_stage("draw", kDraw), gpu_stage("ask", kAsk)};
constexpr heddle_shader kShaders[] = {surfaces_shader("white", "draw", "white.frag.glsl")};

struct Asks {
  std::uint32_t activity(const Frame& frame) const {
    const PassHost host = frame.host();
    if (frame.stage() == 0) return host.choice("how") == kNothing ? HEDDLE_NOTHING : HEDDLE_RUN;
    for (const char* port : {"image", "other", "absent"}) count(host, port, is_neutral(frame, port) ? 1 : 0);
    if (host.choice("how") == kUndeclared) count(host, "undeclared", is_neutral(frame, "surfaces") ? 1 : 0);
    return HEDDLE_NOTHING;
  }
  heddle_status record(const Frame& frame) const {
    const std::uint32_t how = frame.host().choice("how");
    if (how == kByHand) (void)frame.host().raw()->command_buffer(frame.host().raw(), frame.raw());
    for (std::uint32_t layer = 0; layer < (how == kOneLayer ? 1U : 2U); ++layer) {
      heddle_draw drawing = Frame::drawing("white");
      drawing.layer = layer;
      const heddle_status status = how == kPlaced ? place(frame, drawing) : frame.draw(drawing);
      if (status != HEDDLE_OK) return status;
    }
    return HEDDLE_OK;
  }

 private:
  static heddle_status place(const Frame& frame, heddle_draw& drawing) {
    const HeddleView view = frame.value<HeddleView>("camera").front();
    drawing.view = &view;
    heddle_placed_draw placed{};
    placed.struct_size = sizeof placed;
    placed.clears = 1;
    placed.draw = &drawing;
    return Views::of(frame)->draw(placed);
  }
};

constexpr heddle_technique kAsks =
    technique<Asks>("contents/asks", "What images hold", "definition", kPorts, kParameters, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kAsks)
