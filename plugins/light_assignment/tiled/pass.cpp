// SPDX-License-Identifier: Apache-2.0
// light_assignment/tiled: lights and depth to lists of lights for squares of pixels, and the function that walks them.
#include <heddle/pass.hpp>

#include <algorithm>

namespace {

using namespace heddle::pass;

// What every Vulkan device lets a shader see of one buffer.
constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 27;
constexpr std::uint64_t kMebibyte = std::uint64_t{1} << 20;
constexpr std::uint32_t kPairBytes = 8;
// Work groups in a row of a dispatch; every Vulkan device takes 65,535.
constexpr std::uint32_t kGroupsInRow = 32768;
// Tiles that one work group may visit: assign.comp.glsl states its loops for it.
constexpr std::uint32_t kTilesInSlice = 65536;

constexpr double kTileLadder[] = {32, 16, 8};
constexpr double kStepsLadder[] = {0, 1, 2, 4, 8, 16};
constexpr heddle_parameter kParameters[] = {
    knob(integer("tile", "px", 8, 64, 16, "side of the squares that have a list each"), kTileLadder),
    knob(integer("steps", "1", 0, 32, 2, "of the search for a plane between a light and a tile's space"), kStepsLadder),
    integer("fewest", "1", 0, 65536, 16, "with fewer lights that have a place, lists do not pay and are not made"),
    parameter("memory", "MiB", 0.01, 128, 4, "room for lists in the first frame; later ones have as much as they need",
              HEDDLE_TYPE_FLOAT, HEDDLE_PARAMETER_REDECLARE),
};

/// As tiles.glsl reads it.
struct Tiling {
  std::uint32_t tiles_x = 0, tiles_y = 0, tile = 1, pairs_per_tile = 0;
  std::uint32_t listed_lights = 0, summary_words = 0, reserved[2] = {0, 0};
};
static_assert(sizeof(Tiling) == 32, "two uvec4, as tiles.glsl reads them");

constexpr heddle_port kPorts[] = {
    value_in("lights", "every light of the frame"),
    value_in("camera", "the view that is divided into tiles"),
    image_in("depth", "what the camera sees; without it every list is the one of the whole column",
             HEDDLE_PORT_OPTIONAL),
    value_out("tiling", sizeof(Tiling), "number and size of the tiles, lights in lists", "uvec4 tiling[2];"),
    buffer_out("tile_lists", 4 * kMebibyte, "uint tile_lists[];", "depths and lights of each tile"),
};

constexpr heddle_access kPlanAccesses[] = {value("lights"), value("camera"), value("tiling")};
constexpr heddle_access kRangeAccesses[] = {sampled("depth"), value("camera"), value("tiling"),
                                            storage_write("tile_lists")};
constexpr heddle_access kAssignAccesses[] = {value("lights"), value("camera"), value("tiling"),
                                             storage_read_write("tile_lists")};
constexpr heddle_access kFunctionAccesses[] = {value("lights"), value("camera"), value("tiling"),
                                               storage_read("tile_lists")};

enum : std::uint32_t { kPlan, kRange, kAssign };
constexpr heddle_stage kStages[] = {cpu_stage("plan", kPlanAccesses), gpu_stage("range", kRangeAccesses),
                                    gpu_stage("assign", kAssignAccesses)};
constexpr heddle_shader kShaders[] = {compute_shader("range", "range", "range.comp.glsl"),
                                      compute_shader("assign", "assign", "assign.comp.glsl")};
constexpr heddle_function kFunctions[] = {function("light_assignment", "tiled.glsl", kFunctionAccesses)};

struct Push {
  std::uint32_t groups_x;
};

constexpr std::uint32_t rounded_up(std::uint32_t count, std::uint32_t unit) {
  return (count + unit - 1) / unit;
}

/// Words for the depths, the summary and the lights of a tile, as pairs.
constexpr std::uint64_t pairs_for(std::uint32_t lights) {
  const std::uint32_t words = rounded_up(lights, 32);
  return std::uint64_t{1} + rounded_up(words, 32) + words;
}

bool has_place(const HeddleLight& light) {
  return light.type != HEDDLE_LIGHT_DIRECTIONAL && light.type != HEDDLE_LIGHT_ENVIRONMENT;
}

class Tiled {
 public:
  explicit Tiled(const PassHost& host) : memory_(memory_parameter(host)) {}

  heddle_status declare(const PassHost& host) {
    room_ = std::max(memory_, memory_parameter(host));
    heddle_shape shape{};
    shape.byte_size = room_;
    return host.set_shape("tile_lists", shape);
  }

  /// Which lights have room in lists. The others are met everywhere, and the next frame has more room.
  heddle_status execute(const Frame& frame) {
    const auto lights = frame.value<HeddleLight>("lights");
    const auto cameras = frame.value<HeddleView>("camera");
    tiling_ = {};
    const auto placed = std::count_if(lights.begin(), lights.end(), has_place);
    const bool is_worth_it = placed > 0 && placed >= frame.host().integer("fewest");
    if (is_worth_it && !cameras.empty()) plan(frame.host(), cameras[0], static_cast<std::uint32_t>(lights.size()));
    return frame.set_value("tiling", std::span<const Tiling>(&tiling_, 1));
  }

  std::uint32_t activity(const Frame& frame) const {
    // Without lists nobody looks at them: `tiling` says so.
    return frame.stage() != kPlan && tiling_.listed_lights == 0 ? HEDDLE_NOTHING : HEDDLE_RUN;
  }

  heddle_status record(const Frame& frame) {
    if (frame.stage() == kRange) return frame.dispatch("range", tiling_.tiles_x, tiling_.tiles_y);
    const std::uint32_t count = tiling_.listed_lights;
    const std::uint32_t groups_x = std::min(count, kGroupsInRow);
    const Push push = {groups_x};
    return frame.dispatch("assign", groups_x, rounded_up(count, groups_x),
                          rounded_up(tiling_.tiles_x * tiling_.tiles_y, kTilesInSlice), push);
  }

 private:
  static std::uint64_t memory_parameter(const PassHost& host) {
    return static_cast<std::uint64_t>(static_cast<double>(kMebibyte) * host.parameter("memory"));
  }

  void plan(const PassHost& host, const HeddleView& camera, std::uint32_t count) {
    const auto tile = static_cast<std::uint32_t>(host.integer("tile"));
    tiling_.tile = tile;
    tiling_.tiles_x = rounded_up(camera.extent[0], tile);
    tiling_.tiles_y = rounded_up(camera.extent[1], tile);
    const std::uint64_t tiles = std::uint64_t{tiling_.tiles_x} * tiling_.tiles_y;
    const std::uint64_t needed = tiles * pairs_for(count) * kPairBytes;
    std::uint32_t listed = count;
    if (needed > room_) {
      listed = most_lights(tiles, room_);
      if (room_ < kMostBytes) {
        memory_ = std::min(kMostBytes, rounded_to_mebibytes(needed));
        host.request_redeclare();
      } else if (!has_warned_) {
        has_warned_ = true;
        host.warn("lists of " + std::to_string(count) + " lights for " + std::to_string(tiles) + " tiles need " +
                  std::to_string(needed / kMebibyte + 1) + " MiB, and the most is " +
                  std::to_string(kMostBytes / kMebibyte) + ": lights from number " + std::to_string(listed) +
                  " on are tried at every pixel; a larger params.tile has room for more");
      }
    }
    tiling_.listed_lights = listed;
    tiling_.summary_words = rounded_up(rounded_up(listed, 32), 32);
    tiling_.pairs_per_tile = static_cast<std::uint32_t>(pairs_for(listed));
  }

  static std::uint64_t rounded_to_mebibytes(std::uint64_t bytes) {
    return (bytes + kMebibyte - 1) / kMebibyte * kMebibyte;
  }

  /// Whole words of lights that `bytes` have room for.
  static std::uint32_t most_lights(std::uint64_t tiles, std::uint64_t bytes) {
    const std::uint64_t pairs = bytes / (tiles * kPairBytes);
    if (pairs < 3) return 0;
    // One pair for the depths, and one of 33 for the summary.
    const std::uint64_t words = (pairs - 1) - rounded_up(static_cast<std::uint32_t>(pairs - 1), 33);
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(words * 32, 0xffffffe0U));
  }

  std::uint64_t memory_;    // bytes that the next declare asks for
  std::uint64_t room_ = 0;  // bytes that there are
  Tiling tiling_;           // of this frame
  bool has_warned_ = false;
};

constexpr heddle_technique kTiled = [] {
  heddle_technique t =
      technique<Tiled>("light_assignment/tiled", "Lists of lights for tiles of pixels and their depths",
                       "Olsson and Assarsson 2011, Tiled Shading; Harada, McKee and Yang 2012, "
                       "Forward+: Bringing Deferred Lighting to the Next Level",
                       kPorts, kParameters, kStages, kShaders, kFunctions);
  t.features = "lights";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kTiled)
