// SPDX-License-Identifier: Apache-2.0
// display/ocio: radiance to a display through OpenColorIO: its shader text is joined into the pass's own, its tables
// lie in a buffer.
#include "transform.hpp"

#include <heddle/pass.hpp>

#include <cstring>
#include <optional>

namespace {

using namespace heddle::pass;
using ocio_display::Request;
using ocio_display::Transform;

constexpr heddle_port kPorts[] = {
    image_in("radiance", "linear Rec.709 [cd/m^2]"),
    buffer_out("lookups", 16, "vec4 lookup[];", "tables of the transform", HEDDLE_PORT_KEPT),
    image_out("color", VK_FORMAT_R8G8B8A8_UNORM, "encoded for the display; 16 bits for PQ and HLG"),
};

constexpr std::uint32_t kRedeclare = HEDDLE_PARAMETER_REDECLARE;
constexpr double kLutLadder[] = {17, 33, 65, 129, 0};
constexpr heddle_parameter kParameters[] = {
    parameter("exposure", "EV100", -16, 24, 15, "a radiance of 1.2 * 2^exposure cd/m^2 is the scene's white, 1"),
    choice("display", ocio_display::kDisplayNames, 0, "the display's primaries and curve", kRedeclare),
    choice("view", ocio_display::kViewNames, 0, "how scene becomes picture: an ACES 1.x output transform, or as it is",
           kRedeclare),
    toggle("gamut_compression", false, "first brings colours outside of AP1 into it (ACES 1.3)", kRedeclare),
    text("config", "a config file of OpenColorIO to use in place of display, view and gamut_compression", kRedeclare),
    text("config_source", "its name for linear Rec.709", kRedeclare),
    text("config_display", "one of its displays; empty: its default", kRedeclare),
    text("config_view", "one of the display's views; empty: its default", kRedeclare),
    knob(integer("lut_size", "1", 0, 129, 0, "side of a baked table in place of the transform; 0: none, exact",
                 kRedeclare),
         kLutLadder),
};

constexpr heddle_access kTables[] = {host_write("lookups")};
constexpr heddle_access kEncode[] = {sampled("radiance"), storage_read("lookups"), color_target("color")};
enum : std::uint32_t { kTablesStage, kEncodeStage };
constexpr heddle_stage kStages[] = {cpu_stage("tables", kTables), gpu_stage("encode", kEncode)};
constexpr heddle_shader kShaders[] = {fullscreen_shader("encode", "encode", "encode.frag.glsl")};

Request request_of(const PassHost& host) {
  Request request;
  request.display = host.choice("display");
  request.view = host.choice("view");
  request.compresses_gamut = host.toggle("gamut_compression");
  if (const std::string config = host.text("config"); !config.empty()) request.config = host.resolve_path(config);
  request.config_source = host.text("config_source");
  request.config_display = host.text("config_display");
  request.config_view = host.text("config_view");
  request.lut_size = static_cast<std::uint32_t>(host.integer("lut_size"));
  return request;
}

class Ocio {
 public:
  heddle_status declare(const PassHost& host) {
    const Request request = request_of(host);
    try {
      transform_.emplace(request);
    } catch (const ocio_display::BadRequest& error) {
      return host.fail(HEDDLE_BAD_INPUT, error.what());
    }
    are_tables_written_ = false;
    heddle_shape tables{};
    tables.byte_size = transform_->lookups().size() * sizeof(float);
    heddle_status status = host.set_text("transform", transform_->glsl());
    if (status == HEDDLE_OK) status = host.set_shape("lookups", tables);
    // What a config's display is cannot be told from its name: 16 bits are enough for any.
    const bool is_deep = !request.config.empty() || ocio_display::needs_16_bits(request.display);
    return status == HEDDLE_OK && is_deep ? host.set_format("color", VK_FORMAT_R16G16B16A16_UNORM) : status;
  }

  std::uint32_t activity(const Frame& frame) const {
    return frame.stage() == kTablesStage && are_tables_written_ ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  heddle_status execute(const Frame& frame) {
    heddle_mapped tables;
    if (const heddle_status status = frame.map("lookups", tables); status != HEDDLE_OK) return status;
    std::memcpy(tables.data, transform_->lookups().data(), transform_->lookups().size() * sizeof(float));
    are_tables_written_ = true;
    return HEDDLE_OK;
  }

  heddle_status record(const Frame& frame) const { return frame.fullscreen("encode"); }

 private:
  std::optional<Transform> transform_;
  bool are_tables_written_ = false;
};

constexpr heddle_technique kOcio = technique<Ocio>(
    "display/ocio", "Displays and views of OpenColorIO: ACES and config files",
    "OpenColorIO 2.1; Academy Color Encoding System 1.x, output transforms", kPorts, kParameters, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kOcio)
