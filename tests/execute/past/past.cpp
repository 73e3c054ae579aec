// SPDX-License-Identifier: Apache-2.0
// past/average, columns, show, count, values: what is made this frame from what was made in the last. For tests.
#include <heddle/pass.hpp>

#include <algorithm>

namespace {

using namespace heddle::pass;

constexpr std::uint32_t kWhole = HEDDLE_PORT_KEPT | HEDDLE_PORT_REWRITTEN;

// color = history + weight (value - history); KEEP where `is_asleep`.
constexpr heddle_port kAveragePorts[] = {
    image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "the average", kWhole),
    previous_of("color", image_in("history", "last frame's average")),
};
constexpr heddle_parameter kAverageParameters[] = {
    parameter("value", "1", 0, 0, 1, "what is averaged"),
    parameter("weight", "1", 0, 1, 0.5, "of this frame"),
    toggle("is_asleep", false, "answers HEDDLE_KEEP"),
};
constexpr heddle_access kAverage[] = {storage_write("color"), sampled("history")};
constexpr heddle_stage kAverageStages[] = {gpu_stage("average", kAverage)};
constexpr heddle_shader kAverageShaders[] = {compute_shader("average", "average", "average.comp.glsl")};
struct Average {
  explicit Average(const PassHost& given) : host(given) {}
  PassHost host;
  std::uint32_t activity(const Frame&) const { return host.toggle("is_asleep") ? HEDDLE_KEEP : HEDDLE_RUN; }
  heddle_status record(const Frame& frame) const { return frame.dispatch_over("average", "color"); }
};

// Column index % width = index + 1; the others stay as they were.
constexpr heddle_port kColumnsPorts[] = {
    image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "one column a frame", HEDDLE_PORT_KEPT),
};
constexpr heddle_access kColumns[] = {storage_write("color")};
constexpr heddle_stage kColumnsStages[] = {gpu_stage("columns", kColumns)};
constexpr heddle_shader kColumnsShaders[] = {compute_shader("columns", "columns", "columns.comp.glsl")};
struct Columns {
  heddle_status record(const Frame& frame) const {
    return frame.dispatch_over("columns", "color", static_cast<std::uint32_t>(frame.info().index));
  }
};

// color = image.
constexpr heddle_port kShowPorts[] = {
    image_in("image", "what is shown", HEDDLE_PORT_OPTIONAL),
    image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "a copy"),
};
constexpr heddle_access kShow[] = {sampled("image"), storage_write("color")};
constexpr heddle_stage kShowStages[] = {gpu_stage("show", kShow)};
constexpr heddle_shader kShowShaders[] = {compute_shader("show", "show", "show.comp.glsl")};
struct Show {
  heddle_status record(const Frame& frame) const { return frame.dispatch_over("show", "color"); }
};

// counts[i] = last_counts[i] + i + 1.
constexpr heddle_port kCountPorts[] = {
    buffer_out("counts", 64, "uint counts[16];", "counts frames", kWhole),
    previous_of("counts",
                [] {
                  heddle_port p = buffer_in("history", "last frame's");
                  p.glsl = "uint last_counts[16];";
                  return p;
                }()),
    image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "the counts"),
};
constexpr heddle_access kCount[] = {storage_write("counts"), storage_read("history"), storage_write("color")};
constexpr heddle_stage kCountStages[] = {gpu_stage("count", kCount)};
constexpr heddle_shader kCountShaders[] = {compute_shader("count", "count", "count.comp.glsl")};
struct Count {
  heddle_status record(const Frame& frame) const { return frame.dispatch("count", 2); }
};

// A value that counts frames in its own past, and what the camera and the lights were; seen by the CPU and by a shader.
constexpr heddle_port with_glsl(heddle_port p, const char* glsl) {
  p.glsl = glsl;
  return p;
}
constexpr heddle_port kValuesPorts[] = {
    with_glsl(value_in("camera", "this frame's"), "HeddleView camera;"),
    with_glsl(value_in("last_camera", "last frame's"), "HeddleView last_camera;"),
    with_glsl(value_in("last_lights", "last frame's"), "HeddleLight last_lights[];"),
    value_out("frames", 16, "frames since the cut", "vec4 frames;"),
    previous_of("frames", with_glsl(value_in("last_frames", "last frame's"), "vec4 last_frames;")),
    image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "numbers of each, a column each"),
};
constexpr heddle_access kCounting[] = {value("frames"), value("last_frames")};
constexpr heddle_access kShowing[] = {value("camera"),      value("last_camera"), value("last_lights"),
                                      value("last_frames"), value("frames"),      storage_write("color")};
constexpr heddle_stage kValuesStages[] = {cpu_stage("count", kCounting), gpu_stage("show", kShowing)};
constexpr heddle_shader kValuesShaders[] = {compute_shader("show", "show", "values.comp.glsl")};
struct Values {
  heddle_status execute(const Frame& frame) const {
    const auto last = frame.value<float>("last_frames");
    const float next[4] = {last.empty() ? 1.0F : last[0] + 1.0F, static_cast<float>(last.size()), 0, 0};
    return frame.set_value<float>("frames", next);
  }
  heddle_status record(const Frame& frame) const {
    // How far this frame's origin is from last frame's: what was relative to that one is moved by it.
    const heddle_frame_info& info = frame.info();
    const float moved[4] = {static_cast<float>(info.origin[0] - info.previous_origin[0]), static_cast<float>(info.cut)};
    return frame.dispatch("show", 1, 1, 1, moved);
  }
};

// The GPU makes 3 index + i; the CPU reads it, two frames later or at once, and hands it to a shader that shows it.
constexpr heddle_port kReadPorts[] = {
    buffer_out("made", 64, "uint made[16];", "numbers"),
    image_out("numbers", VK_FORMAT_R32_SFLOAT, "the same as a picture"),
    value_out("seen", 16, "the frame they are of + 1 (0: none), one of each, whether all bytes are 0", "vec4 seen;"),
    image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "what was seen"),
};
constexpr heddle_access kReading[] = {host_read("made"), host_read("numbers"), value("seen")};
constexpr heddle_access kMaking[] = {storage_write("made"), storage_write("numbers")};
constexpr heddle_access kShowSeen[] = {value("seen"), storage_write("color")};
constexpr heddle_stage kLateStages[] = {late(2, cpu_stage("read", kReading)), gpu_stage("make", kMaking),
                                        gpu_stage("show", kShowSeen)};
constexpr heddle_stage kPromptStages[] = {gpu_stage("make", kMaking), cpu_stage("read", kReading),
                                          gpu_stage("show", kShowSeen)};
constexpr heddle_shader kReadShaders[] = {compute_shader("make", "make", "make.comp.glsl"),
                                          compute_shader("seen", "show", "seen.comp.glsl")};
template <std::uint32_t kMake>
struct Read {
  heddle_status execute(const Frame& frame) const {
    heddle_mapped made;
    heddle_mapped numbers;
    if (const heddle_status status = frame.map("made", made); status != HEDDLE_OK) return status;
    if (const heddle_status status = frame.map("numbers", numbers); status != HEDDLE_OK) return status;
    if (made.frame != numbers.frame) return frame.host().fail(HEDDLE_BUG, "two frames in one");
    const auto* counts = static_cast<const std::uint32_t*>(made.data);
    const auto* row = static_cast<const float*>(numbers.data) + 2 * numbers.row_bytes / sizeof(float);
    const bool is_zero = std::all_of(counts, counts + 16, [](std::uint32_t count) { return count == 0; });
    const float seen[4] = {made.frame == HEDDLE_NO_FRAME ? 0.0F : static_cast<float>(made.frame) + 1.0F,
                           static_cast<float>(counts[5]), row[7], is_zero ? 1.0F : 0.0F};
    return frame.set_value<float>("seen", seen);
  }
  heddle_status record(const Frame& frame) const {
    if (frame.stage() != kMake) return frame.dispatch_over("seen", "color");
    return frame.dispatch_over("make", "numbers", static_cast<std::uint32_t>(frame.info().index));
  }
};

// As late, a frame later; and the GPU does nothing that is submitted after a frame in which `is_held` is set, that
// frame included, until a frame is recorded whose `released` counts as many frames as were held.
constexpr heddle_stage kHeldStages[] = {late(1, cpu_stage("read", kReading)), gpu_stage("make", kMaking),
                                        gpu_stage("show", kShowSeen)};
constexpr heddle_parameter kHeldParameters[] = {
    toggle("is_held", false, "the GPU waits before it runs this frame"),
    integer("released", "1", 0, 1000, 0, "held frames that may run"),
};
struct Held : Read<1> {
  explicit Held(const PassHost& given) : host(given) {}
  PassHost host;
  VkSemaphore semaphore = VK_NULL_HANDLE;
  std::uint64_t held = 0, released = 0;
  ~Held() {
    const heddle_vulkan& vk = *host.raw()->vulkan;
    if (semaphore != VK_NULL_HANDLE) vk.DestroySemaphore(vk.device, semaphore, nullptr);
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  heddle_status prepare(const PassHost&) {
    if (semaphore != VK_NULL_HANDLE) return HEDDLE_OK;
    VkSemaphoreTypeCreateInfo timeline{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
    timeline.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &timeline};
    const heddle_vulkan& vk = *host.raw()->vulkan;
    return vk.CreateSemaphore(vk.device, &info, nullptr, &semaphore) == VK_SUCCESS ? HEDDLE_OK : HEDDLE_FAILED;
  }
  heddle_status record(const Frame& frame) {
    if (frame.stage() == 1 && !let_run(frame)) return HEDDLE_FAILED;
    return Read::record(frame);
  }

 private:
  bool let_run(const Frame& frame) {
    const heddle_vulkan& vk = frame.vulkan();
    if (host.toggle("is_held")) {
      VkSemaphoreSubmitInfo wait{VK_STRUCTURE_TYPE_SEMAPHORE_SUBMIT_INFO};
      wait.semaphore = semaphore;
      wait.value = ++held;
      wait.stageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
      VkSubmitInfo2 submit{VK_STRUCTURE_TYPE_SUBMIT_INFO_2};
      submit.waitSemaphoreInfoCount = 1;
      submit.pWaitSemaphoreInfos = &wait;
      VkQueue queue = VK_NULL_HANDLE;
      vk.GetDeviceQueue(vk.device, 0, 0, &queue);
      if (vk.QueueSubmit2(queue, 1, &submit, VK_NULL_HANDLE) != VK_SUCCESS) return false;
    }
    const auto wanted = static_cast<std::uint64_t>(host.integer("released"));
    if (wanted <= released) return true;
    released = wanted;
    VkSemaphoreSignalInfo signal{VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO};
    signal.semaphore = semaphore;
    signal.value = released;
    return vk.SignalSemaphore(vk.device, &signal) == VK_SUCCESS;
  }
};

constexpr heddle_technique kAverageTechnique =
    technique<Average>("past/average", "An exponential average", "definition", kAveragePorts, kAverageParameters,
                       kAverageStages, kAverageShaders);
constexpr heddle_technique kColumnsTechnique = technique<Columns>("past/columns", "One column a frame", "definition",
                                                                  kColumnsPorts, kColumnsStages, kColumnsShaders);
constexpr heddle_technique kShowTechnique =
    technique<Show>("past/show", "A copy", "definition", kShowPorts, kShowStages, kShowShaders);
constexpr heddle_technique kCountTechnique =
    technique<Count>("past/count", "Counts in a buffer", "definition", kCountPorts, kCountStages, kCountShaders);
constexpr heddle_technique kValuesTechnique =
    technique<Values>("past/values", "Counts in a value", "definition", kValuesPorts, kValuesStages, kValuesShaders);

constexpr heddle_technique kLateTechnique =
    technique<Read<1>>("past/late", "Read two frames later", "definition", kReadPorts, kLateStages, kReadShaders);
constexpr heddle_technique kPromptTechnique =
    technique<Read<0>>("past/prompt", "Read at once", "definition", kReadPorts, kPromptStages, kReadShaders);
constexpr heddle_technique kHeldTechnique =
    technique<Held>("past/held", "Read a frame later, from a GPU that can be held", "definition", kReadPorts,
                    kHeldParameters, kHeldStages, kReadShaders);

}  // namespace

HEDDLE_PLUGIN(kAverageTechnique, kColumnsTechnique, kShowTechnique, kCountTechnique, kValuesTechnique, kLateTechnique,
              kPromptTechnique, kHeldTechnique)
