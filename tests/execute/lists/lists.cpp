// SPDX-License-Identifier: Apache-2.0
// lists/find, more, own, shade, order, late, collect, rewrite, canvas: work that is found, listed, and done where it
// was found; kept contents that outgrow their memory. forgets, listens: what a technique may get wrong with lists. For
// tests.
#include <heddle/pass.hpp>

#include <algorithm>

namespace {

using namespace heddle::pass;

constexpr std::uint32_t kElement = 8;
constexpr const char* kPixels = "uvec2 pixels[];";
constexpr heddle_port kColor = image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "a picture");

constexpr heddle_parameter kParameters[] = {
    integer("share", "1", 0, 1000000, 250, "of 1000 pixels; collect: elements a frame"),
    integer("salt", "1", 0, 1000, 1, "other pixels"),
    integer("room", "1", 0, 2000000000, 64, "elements that the list holds at first", HEDDLE_PARAMETER_REDECLARE),
    toggle("grows", true, "whether it is made larger when it overflows"),
    integer("activity", "1", 0, 2, 0, "what stages that append answer: HEDDLE_RUN, HEDDLE_KEEP, HEDDLE_NOTHING"),
};

/// Twice the room until everything fits: a pass that grows when it must.
struct Growing {
  explicit Growing(const PassHost& given) : host(given), room(static_cast<std::uint32_t>(given.integer("room"))) {}
  heddle_status declare(const PassHost&) const { return host.set_capacity("pixels", room); }
  void counted(const PassHost&, const heddle_list_count& count) {
    if (count.overflow == 0 || !host.toggle("grows")) return;
    room = std::max(2 * room, count.count + count.overflow);
    host.request_redeclare();
  }
  PassHost host;
  std::uint32_t room;
};

// pixels: those that are worth work.
constexpr heddle_port kFindPorts[] = {kColor, list_out("pixels", 0, kElement, kPixels, "pixels that are worth work")};
constexpr heddle_access kFind[] = {appended("pixels"), storage_write("color")};
constexpr heddle_stage kFindStages[] = {gpu_stage("find", kFind)};
constexpr heddle_shader kFindShaders[] = {compute_shader("find", "find", "find.comp.glsl")};
struct Find : Growing {
  using Growing::Growing;
  heddle_status record(const Frame& frame) const { return frame.dispatch_over("find", "color"); }
};

// The same, behind what is in the list already.
constexpr heddle_port kMorePorts[] = {kColor, list_out("pixels", 0, 0, kPixels, "more of them", 0, HEDDLE_INOUT)};
struct More {
  heddle_status record(const Frame& frame) const { return frame.dispatch_over("find", "color"); }
};

// The same, and where nobody has made the list, it is its own.
constexpr heddle_port kOwnPorts[] = {
    kColor, list_out("pixels", 0, kElement, kPixels, "more of them", HEDDLE_PORT_OPTIONAL, HEDDLE_INOUT)};
struct Own {
  heddle_status declare(const PassHost& host) const {
    const auto room = static_cast<std::uint32_t>(host.integer("room"));
    return host.shape("pixels").is_bound != 0 ? HEDDLE_OK : host.set_capacity("pixels", room);
  }
  heddle_status record(const Frame& frame) const { return frame.dispatch_over("find", "color"); }
};

// color = what the list says, black elsewhere: as much work as there are elements.
constexpr heddle_port kShadePorts[] = {kColor, list_in("pixels", "what is shaded", kPixels, HEDDLE_PORT_OPTIONAL)};
constexpr heddle_access kClear[] = {storage_write("color")};
constexpr heddle_access kShade[] = {storage_read("pixels"), storage_write("color")};
constexpr heddle_stage kShadeStages[] = {gpu_stage("clear", kClear), gpu_stage("shade", kShade)};
constexpr heddle_shader kShadeShaders[] = {compute_shader("clear", "clear", "clear.comp.glsl"),
                                           compute_shader("shade", "shade", "shade.comp.glsl")};
struct Shade {
  heddle_status record(const Frame& frame) const {
    return frame.stage() == 0 ? frame.dispatch_over("clear", "color") : frame.dispatch_over_list("shade", "pixels");
  }
};

// color = the list as it lies in memory.
constexpr heddle_stage kOrderStages[] = {gpu_stage("order", kShade)};
constexpr heddle_shader kClearShaders[] = {compute_shader("order", "order", "clear.comp.glsl")};
constexpr heddle_shader kOrderShaders[] = {compute_shader("order", "order", "order.comp.glsl")};
struct Order {
  heddle_status record(const Frame& frame) const { return frame.dispatch_over("order", "color"); }
};

// The CPU reads the list of a frame ago.
constexpr heddle_port kLatePorts[] = {
    kColor, list_in("pixels", "what is read", kPixels),
    value_out("seen", 16, "frame + 1, count, overflow, sum of what is drawn", "vec4 seen;")};
constexpr heddle_access kReading[] = {host_read("pixels"), value("seen")};
constexpr heddle_access kShowing[] = {value("seen"), storage_write("color")};
constexpr heddle_stage kLateStages[] = {late(1, cpu_stage("read", kReading)), gpu_stage("show", kShowing)};
constexpr heddle_shader kLateShaders[] = {compute_shader("seen", "show", "seen.comp.glsl")};
struct Late {
  heddle_status execute(const Frame& frame) const {
    heddle_mapped list;
    if (const heddle_status status = frame.map("pixels", list); status != HEDDLE_OK) return status;
    const auto* elements = static_cast<const std::uint32_t*>(list.data);
    float sum = 0;  // of integers below 2^24: exact in every order
    for (std::uint32_t i = 0; i < list.count; ++i) sum += static_cast<float>(elements[2 * i + 1]);
    const float seen[4] = {list.frame == HEDDLE_NO_FRAME ? 0.0F : static_cast<float>(list.frame) + 1.0F,
                           static_cast<float>(list.count), static_cast<float>(list.overflow), sum};
    return frame.set_value<float>("seen", seen);
  }
  heddle_status record(const Frame& frame) const { return frame.dispatch_over("seen", "color"); }
};

// A list that goes on from frame to frame.
constexpr heddle_port kCollectPorts[] = {
    kColor, list_out("pixels", 0, kElement, kPixels, "elements of all frames", HEDDLE_PORT_KEPT)};
constexpr heddle_access kCollecting[] = {appended("pixels")};
constexpr heddle_stage kCollectStages[] = {gpu_stage("collect", kCollecting), gpu_stage("show", kShade)};
constexpr heddle_shader kCollectShaders[] = {compute_shader("collect", "collect", "collect.comp.glsl"),
                                             compute_shader("collected", "show", "collected.comp.glsl")};
struct Collect : Growing {
  using Growing::Growing;
  std::uint32_t activity(const Frame& frame) const {
    return frame.stage() == 1 ? HEDDLE_RUN : static_cast<std::uint32_t>(host.integer("activity"));
  }
  heddle_status record(const Frame& frame) const {
    if (frame.stage() == 1) return frame.dispatch("collected", (frame.host().shape("color").width + 7) / 8);
    const auto share = static_cast<std::uint32_t>(host.integer("share"));
    return frame.dispatch("collect", (share + 7) / 8, 1, 1, static_cast<std::uint32_t>(frame.info().index));
  }
};

// A list that is kept, and made anew where its stage runs.
constexpr heddle_port kRewritePorts[] = {
    kColor, list_out("pixels", 0, kElement, kPixels, "elements of the last frame that appended",
                     HEDDLE_PORT_KEPT | HEDDLE_PORT_REWRITTEN)};

// A kept image that becomes wider when the next column would not fit, and its history.
constexpr heddle_port kCanvasPorts[] = {
    kColor,
    image_out_sized("canvas", VK_FORMAT_R32_SFLOAT, 2, 8, "a column a frame", HEDDLE_PORT_KEPT),
    previous_of("canvas", image_in("last_canvas", "last frame's")),
};
constexpr heddle_access kPaint[] = {storage_write("canvas")};
constexpr heddle_access kShowCanvas[] = {sampled("canvas"), sampled("last_canvas"), storage_write("color")};
constexpr heddle_stage kCanvasStages[] = {gpu_stage("paint", kPaint), gpu_stage("show", kShowCanvas)};
constexpr heddle_shader kCanvasShaders[] = {compute_shader("paint", "paint", "paint.comp.glsl"),
                                            compute_shader("canvas", "show", "canvas.comp.glsl")};
struct Canvas {
  std::uint32_t width = 2;
  heddle_status declare(const PassHost& host) const {
    heddle_shape shape{};
    shape.width = width;
    return host.set_shape("canvas", shape);
  }
  heddle_status migrate(const PassHost& host, const heddle_migration& migration) const {
    VkImageCopy region{};
    region.srcSubresource = region.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.extent = {migration.old_shape->width, migration.old_shape->height, 1};
    host.raw()->vulkan->CmdCopyImage(migration.commands, migration.old_image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                                     migration.new_image, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
    return HEDDLE_OK;
  }
  heddle_status record(const Frame& frame) {
    if (frame.stage() == 1) return frame.dispatch_over("canvas", "color");
    const auto index = static_cast<std::uint32_t>(frame.info().index);
    if (index + 1 == width) {
      width += 3;
      frame.host().request_redeclare();
    }
    return frame.dispatch_over("paint", "canvas", index);
  }
};

/// Empties the list itself, and tells nobody.
struct Forgets : Growing {
  using Growing::Growing;
  heddle_status record(const Frame& frame) const {
    frame.vulkan().CmdFillBuffer(frame.command_buffer(), frame.buffer("pixels"), 0, 16, 0);
    return frame.dispatch_over("find", "color");
  }
};
/// Appends twice; nothing says that the second is done after the first.
struct Twice : Growing {
  using Growing::Growing;
  heddle_status record(const Frame& frame) const {
    if (const heddle_status status = frame.dispatch_over("find", "color"); status != HEDDLE_OK) return status;
    return frame.dispatch_over("find", "color");
  }
};
/// Reads a buffer that is no list.
constexpr heddle_port kFixedPorts[] = {kColor, [] {
                                         heddle_port fixed = buffer_in("pixels", "what is read");
                                         fixed.glsl = kPixels;
                                         return fixed;
                                       }()};
/// Dispatches over a list that its stage does not declare.
struct Undeclared {
  heddle_status record(const Frame& frame) const { return frame.dispatch_over_list("clear", "pixels"); }
};

constexpr heddle_technique kFindTechnique =
    technique<Find>("lists/find", "Lists pixels", "definition", kFindPorts, kParameters, kFindStages, kFindShaders);
constexpr heddle_technique kMoreTechnique = technique<More>("lists/more", "Lists more pixels", "definition", kMorePorts,
                                                            kParameters, kFindStages, kFindShaders);
constexpr heddle_technique kOwnTechnique = technique<Own>("lists/own", "Lists more pixels, or the first", "definition",
                                                          kOwnPorts, kParameters, kFindStages, kFindShaders);
constexpr heddle_technique kShadeTechnique = technique<Shade>("lists/shade", "Shades listed pixels", "definition",
                                                              kShadePorts, kParameters, kShadeStages, kShadeShaders);
constexpr heddle_technique kOrderTechnique = technique<Order>("lists/order", "Shows the order of a list", "definition",
                                                              kShadePorts, kParameters, kOrderStages, kOrderShaders);
constexpr heddle_technique kLateTechnique = technique<Late>("lists/late", "Reads a list a frame later", "definition",
                                                            kLatePorts, kParameters, kLateStages, kLateShaders);
constexpr heddle_technique kCollectTechnique = technique<Collect>(
    "lists/collect", "Collects over frames", "definition", kCollectPorts, kParameters, kCollectStages, kCollectShaders);
constexpr heddle_technique kRewriteTechnique =
    technique<Collect>("lists/rewrite", "Collects of one frame", "definition", kRewritePorts, kParameters,
                       kCollectStages, kCollectShaders);
constexpr heddle_technique kCanvasTechnique = technique<Canvas>(
    "lists/canvas", "A canvas that grows", "definition", kCanvasPorts, kParameters, kCanvasStages, kCanvasShaders);
constexpr heddle_technique kForgetsTechnique =
    technique<Forgets>("lists/forgets", "Empties a list behind the host's back", "definition", kFindPorts, kParameters,
                       kFindStages, kFindShaders);
constexpr heddle_technique kTwiceTechnique =
    technique<Twice>("lists/twice", "No barrier between two dispatches that append", "definition", kFindPorts,
                     kParameters, kFindStages, kFindShaders);
constexpr heddle_technique kFixedTechnique =
    technique<Order>("lists/fixed", "Reads a buffer of fixed length", "definition", kFixedPorts, kParameters,
                     kOrderStages, kClearShaders);
constexpr heddle_stage kUndeclaredStages[] = {gpu_stage("clear", kClear)};
constexpr heddle_shader kUndeclaredShaders[] = {compute_shader("clear", "clear", "clear.comp.glsl")};
constexpr heddle_technique kUndeclaredTechnique =
    technique<Undeclared>("lists/undeclared", "Dispatches over what it does not declare", "definition", kShadePorts,
                          kParameters, kUndeclaredStages, kUndeclaredShaders);

}  // namespace

HEDDLE_PLUGIN(kFindTechnique, kMoreTechnique, kOwnTechnique, kShadeTechnique, kOrderTechnique, kLateTechnique,
              kCollectTechnique, kRewriteTechnique, kCanvasTechnique, kForgetsTechnique, kTwiceTechnique,
              kFixedTechnique, kUndeclaredTechnique)
