// SPDX-License-Identifier: Apache-2.0
// Header-only C++20 sugar over heddle/plugin.h for authors of techniques: constexpr builders for descriptors, and thin
// wrappers for what the host gives. Nothing here crosses the border; a plugin may use plugin.h alone instead.
//
// A complete technique (pass.cpp; blur.comp.glsl stands beside it):
//
//   #include <heddle/pass.hpp>
//   namespace {
//   using namespace heddle::pass;
//   constexpr heddle_port kPorts[] = {
//       image_in("radiance", "what to blur"),
//       image_out("color", VK_FORMAT_R8G8B8A8_UNORM, "blurred"),
//   };
//   constexpr double kRadii[] = {1, 2, 4, 8};
//   constexpr heddle_parameter kParameters[] = {
//       knob(parameter("radius", "px", 1, 16, 4, "half width of the box"), kRadii),
//       toggle("linear", true, "blur before encoding"),
//   };
//   constexpr heddle_access kMain[] = {sampled("radiance"), storage_write("color")};
//   constexpr heddle_stage kStages[] = {gpu_stage("main", kMain)};
//   constexpr heddle_shader kShaders[] = {compute_shader("blur", "main", "blur.comp.glsl")};
//
//   struct Blur {  // one object a pass; every function below is optional, and so is the constructor's argument
//     explicit Blur(const PassHost&) {}
//     heddle_status record(const Frame& frame) { return frame.dispatch_over("blur", "color"); }
//   };
//
//   constexpr heddle_technique kBlur =
//       technique<Blur>("display/blur", "A box blur", "folklore", kPorts, kParameters, kStages, kShaders);
//   }  // namespace
//   HEDDLE_PLUGIN(kBlur)
//
// What the class may have, each called as plugin.h says of its namesake:
//   Pass(const PassHost&) or Pass()               create
//   heddle_status declare(const PassHost&)        PassHost::set_format, set_shape
//   heddle_status prepare(const PassHost&)
//   heddle_status record(const Frame&)            gpu stages; Frame::stage() is the index in kStages
//   heddle_status execute(const Frame&)           cpu stages
//   std::uint32_t activity(const Frame&)          HEDDLE_RUN, HEDDLE_KEEP, HEDDLE_NOTHING
//   heddle_status iterations(const heddle_frame_info&, heddle_iterations&)     loops
//   void counted(const PassHost&, const heddle_list_count&)                   lists
//   heddle_status migrate(const PassHost&, const heddle_migration&)           kept ports, after request_redeclare
//   heddle_status save_state(const Frame&)        between slices: Frame::keep_state
//   heddle_status load_state(const Frame&, std::span<const std::byte>)
// An exception that leaves one of them becomes a report and HEDDLE_FAILED. `host` may be kept: it lives as long as the
// object. Setters of plugin.h's structures that have no builder are plain fields: change them on the builder's result.
#pragma once

#include <heddle/components.h>
#include <heddle/plugin.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <initializer_list>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace heddle::pass {

// ---- descriptors ----------------------------------------------------------------------------------------------------

/// `t.ports = list(kPorts, t.port_count)`: an array and its length, in one place.
template <typename T, std::size_t kCount>
constexpr const T* list(const T (&items)[kCount], std::uint32_t& count) {
  count = static_cast<std::uint32_t>(kCount);
  return items;
}

constexpr heddle_port port(const char* name, std::uint32_t type, std::uint32_t direction, const char* help,
                           std::uint32_t flags = 0) {
  heddle_port p{};
  p.struct_size = sizeof(heddle_port);
  p.name = name;
  p.type = type;
  p.direction = direction;
  p.flags = flags;
  p.extent_rule = HEDDLE_EXTENT_FRAME;
  p.extent_scale = 1.0F;
  p.help = help;
  return p;
}
constexpr heddle_port image_in(const char* name, const char* help, std::uint32_t flags = 0) {
  return port(name, HEDDLE_PORT_IMAGE, HEDDLE_IN, help, flags);
}
/// An image of the frame's extent times `scale`.
constexpr heddle_port image_out(const char* name, VkFormat format, const char* help, std::uint32_t flags = 0,
                                float scale = 1.0F) {
  heddle_port p = port(name, HEDDLE_PORT_IMAGE, HEDDLE_OUT, help, flags);
  p.format = static_cast<std::uint32_t>(format);
  p.extent_scale = scale;
  return p;
}
/// An image of fixed size, e.g. a table or an atlas.
constexpr heddle_port image_out_sized(const char* name, VkFormat format, std::uint32_t width, std::uint32_t height,
                                      const char* help, std::uint32_t flags = 0, std::uint32_t layers = 1,
                                      std::uint32_t mips = 1) {
  heddle_port p = image_out(name, format, help, flags);
  p.extent_rule = HEDDLE_EXTENT_ABSOLUTE;
  p.width = width;
  p.height = height;
  p.layers = layers;
  p.mips = mips;
  return p;
}
/// glsl: members of the block as shaders see them, "float histogram[256];".
constexpr heddle_port buffer_out(const char* name, std::uint64_t byte_size, const char* glsl, const char* help,
                                 std::uint32_t flags = 0) {
  heddle_port p = port(name, HEDDLE_PORT_BUFFER, HEDDLE_OUT, help, flags);
  p.byte_size = byte_size;
  p.glsl = glsl;
  return p;
}
constexpr heddle_port buffer_in(const char* name, const char* help, std::uint32_t flags = 0) {
  return port(name, HEDDLE_PORT_BUFFER, HEDDLE_IN, help, flags);
}
/// A list. glsl: one array without length, "uvec4 tiles[];"; element_bytes: of an element in it, by std430.
constexpr heddle_port list_out(const char* name, std::uint32_t capacity, std::uint32_t element_bytes, const char* glsl,
                               const char* help, std::uint32_t flags = 0, std::uint32_t direction = HEDDLE_OUT) {
  heddle_port p = port(name, HEDDLE_PORT_BUFFER, direction, help, flags | HEDDLE_PORT_LIST);
  p.capacity = capacity;
  p.element_bytes = element_bytes;
  p.glsl = glsl;
  return p;
}
/// glsl NULL: what the role's contract says.
constexpr heddle_port list_in(const char* name, const char* help, const char* glsl = nullptr, std::uint32_t flags = 0) {
  heddle_port p = port(name, HEDDLE_PORT_BUFFER, HEDDLE_IN, help, flags | HEDDLE_PORT_LIST);
  p.glsl = glsl;
  return p;
}
constexpr heddle_port value_in(const char* name, const char* help, std::uint32_t flags = 0) {
  return port(name, HEDDLE_PORT_VALUE, HEDDLE_IN, help, flags);
}
/// byte_size: capacity. glsl NULL: what the role's contract says.
constexpr heddle_port value_out(const char* name, std::uint64_t byte_size, const char* help, const char* glsl = nullptr,
                                std::uint32_t direction = HEDDLE_OUT) {
  heddle_port p = port(name, HEDDLE_PORT_VALUE, direction, help);
  p.byte_size = byte_size;
  p.glsl = glsl;
  return p;
}
constexpr heddle_port surfaces_in(const char* name, const char* help, std::uint32_t flags = 0) {
  return port(name, HEDDLE_PORT_SURFACES, HEDDLE_IN, help, flags);
}

/// What a job makes once, and what reads it: bytes on the CPU.
constexpr heddle_port artifact_out(const char* name, const char* help) {
  return port(name, HEDDLE_PORT_ARTIFACT, HEDDLE_OUT, help);
}
constexpr heddle_port artifact_in(const char* name, const char* help, std::uint32_t flags = 0) {
  return port(name, HEDDLE_PORT_ARTIFACT, HEDDLE_IN, help, flags);
}
/// What a job has found, in rows.
constexpr heddle_port report_out(const char* name, const char* help) {
  return port(name, HEDDLE_PORT_REPORT, HEDDLE_OUT, help);
}
/// Surfaces that lie in buffers of the technique: vertices and indices, and where it places them itself, instances and
/// commands. HEDDLE_INOUT: beside what the port is bound to.
constexpr heddle_port surfaces_out(const char* name, std::uint32_t direction, const char* vertices, const char* indices,
                                   const char* help, const char* instances = nullptr, const char* commands = nullptr) {
  heddle_port p = port(name, HEDDLE_PORT_SURFACES, direction, help);
  p.vertices = vertices;
  p.indices = indices;
  p.instances = instances;
  p.commands = commands;
  return p;
}

/// An input that reads last frame's version of the kept output `output` of the same technique.
constexpr heddle_port previous_of(const char* output, heddle_port p) {
  p.previous_of = output;
  return p;
}

/// A float parameter; equal bounds: unbounded.
constexpr heddle_parameter parameter(const char* name, const char* unit, double minimum, double maximum,
                                     double default_value, const char* help, std::uint32_t type = HEDDLE_TYPE_FLOAT,
                                     std::uint32_t flags = 0) {
  heddle_parameter p{};
  p.struct_size = sizeof(heddle_parameter);
  p.name = name;
  p.type = type;
  p.flags = flags;
  p.unit = unit;
  p.minimum = minimum;
  p.maximum = maximum;
  p.default_value[0] = default_value;
  p.help = help;
  return p;
}
constexpr heddle_parameter integer(const char* name, const char* unit, std::int32_t minimum, std::int32_t maximum,
                                   std::int32_t default_value, const char* help, std::uint32_t flags = 0) {
  return parameter(name, unit, minimum, maximum, default_value, help, HEDDLE_TYPE_INT, flags);
}
constexpr heddle_parameter toggle(const char* name, bool default_value, const char* help, std::uint32_t flags = 0) {
  return parameter(name, "1", 0, 1, default_value ? 1 : 0, help, HEDDLE_TYPE_BOOL, flags);
}
/// `choices` ends with NULL: constexpr const char* kFilters[] = {"box", "tent", nullptr};
template <std::size_t kCount>
constexpr heddle_parameter choice(const char* name, const char* const (&choices)[kCount], std::uint32_t default_index,
                                  const char* help, std::uint32_t flags = 0) {
  static_assert(kCount >= 2, "at least one choice and the closing NULL");
  heddle_parameter p =
      parameter(name, "1", 0, static_cast<double>(kCount - 2), default_index, help, HEDDLE_TYPE_CHOICE, flags);
  p.choices = choices;
  return p;
}
/// HEDDLE_TYPE_COLOR or HEDDLE_TYPE_FLOAT3.
constexpr heddle_parameter triple(const char* name, const char* unit, double minimum, double maximum,
                                  std::array<double, 3> default_value, const char* help,
                                  std::uint32_t type = HEDDLE_TYPE_FLOAT3, std::uint32_t flags = 0) {
  heddle_parameter p = parameter(name, unit, minimum, maximum, 0, help, type, flags);
  for (std::size_t i = 0; i < 3; ++i) p.default_value[i] = default_value[i];
  return p;
}
constexpr heddle_parameter color(const char* name, const char* unit, double minimum, double maximum,
                                 std::array<double, 3> default_value, const char* help, std::uint32_t flags = 0) {
  return triple(name, unit, minimum, maximum, default_value, help, HEDDLE_TYPE_COLOR, flags);
}
/// A list of names, e.g. of lights; read on the CPU.
constexpr heddle_parameter names(const char* name, const char* help) {
  return parameter(name, "1", 0, 0, 0, help, HEDDLE_TYPE_NAMES);
}
/// A line of text, e.g. a file; read on the CPU.
constexpr heddle_parameter text(const char* name, const char* help, std::uint32_t flags = 0) {
  return parameter(name, "1", 0, 0, 0, help, HEDDLE_TYPE_TEXT, flags);
}
/// The parameter buys accuracy with time: `ladder` goes from cheap to accurate.
template <std::size_t kCount>
constexpr heddle_parameter knob(heddle_parameter p, const double (&ladder)[kCount]) {
  p.flags |= HEDDLE_PARAMETER_KNOB;
  p.ladder = list(ladder, p.ladder_count);
  return p;
}

constexpr heddle_access access(const char* port_name, std::uint32_t kind, std::uint32_t load = HEDDLE_LOAD_KEEP,
                               std::array<float, 4> clear = {}) {
  heddle_access a{};
  a.struct_size = sizeof(heddle_access);
  a.port = port_name;
  a.access = kind;
  a.load = load;
  for (std::size_t i = 0; i < 4; ++i) a.clear[i] = clear[i];
  return a;
}
constexpr heddle_access sampled(const char* p) {
  return access(p, HEDDLE_ACCESS_SAMPLED);
}
constexpr heddle_access sampled_linear(const char* p) {
  return access(p, HEDDLE_ACCESS_SAMPLED_LINEAR);
}
constexpr heddle_access sampled_compare(const char* p) {
  return access(p, HEDDLE_ACCESS_SAMPLED_COMPARE);
}
constexpr heddle_access storage_read(const char* p) {
  return access(p, HEDDLE_ACCESS_STORAGE_READ);
}
constexpr heddle_access storage_write(const char* p) {
  return access(p, HEDDLE_ACCESS_STORAGE_WRITE);
}
constexpr heddle_access storage_read_write(const char* p) {
  return access(p, HEDDLE_ACCESS_STORAGE_READ_WRITE);
}
constexpr heddle_access appended(const char* p) {
  return access(p, HEDDLE_ACCESS_APPEND);
}
constexpr heddle_access value(const char* p) {
  return access(p, HEDDLE_ACCESS_VALUE);
}
constexpr heddle_access drawn(const char* p) {
  return access(p, HEDDLE_ACCESS_DRAW);
}
constexpr heddle_access batches(const char* p) {
  return access(p, HEDDLE_ACCESS_BATCHES);
}
constexpr heddle_access host_read(const char* p) {
  return access(p, HEDDLE_ACCESS_HOST_READ);
}
constexpr heddle_access host_write(const char* p) {
  return access(p, HEDDLE_ACCESS_HOST_WRITE);
}
constexpr heddle_access transfer_read(const char* p) {
  return access(p, HEDDLE_ACCESS_TRANSFER_READ);
}
constexpr heddle_access transfer_write(const char* p) {
  return access(p, HEDDLE_ACCESS_TRANSFER_WRITE);
}
/// A colour attachment whose every pixel is written.
constexpr heddle_access color_target(const char* p) {
  return access(p, HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_DONT_CARE);
}
constexpr heddle_access color_cleared(const char* p, std::array<float, 4> clear) {
  return access(p, HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR, clear);
}
/// A colour attachment that keeps what is there and mixes what is drawn into it; `blend` is HEDDLE_BLEND_*.
constexpr heddle_access color_blended(const char* p, std::uint32_t blend) {
  heddle_access a = access(p, HEDDLE_ACCESS_COLOR);
  a.blend = blend;
  return a;
}
/// A depth attachment that is tested and left as it is.
constexpr heddle_access depth_tested(const char* p) {
  return access(p, HEDDLE_ACCESS_DEPTH_READ);
}
/// A depth attachment; 0 is infinitely far away.
constexpr heddle_access depth_cleared(const char* p, float clear = 0.0F) {
  return access(p, HEDDLE_ACCESS_DEPTH, HEDDLE_LOAD_CLEAR, {clear, 0, 0, 0});
}

template <std::size_t kCount>
constexpr heddle_stage stage(const char* name, std::uint32_t kind, const heddle_access (&accesses)[kCount]) {
  heddle_stage s{};
  s.struct_size = sizeof(heddle_stage);
  s.name = name;
  s.kind = kind;
  s.accesses = list(accesses, s.access_count);
  return s;
}
template <std::size_t kCount>
constexpr heddle_stage gpu_stage(const char* name, const heddle_access (&accesses)[kCount]) {
  return stage(name, HEDDLE_STAGE_GPU, accesses);
}
template <std::size_t kCount>
constexpr heddle_stage cpu_stage(const char* name, const heddle_access (&accesses)[kCount]) {
  return stage(name, HEDDLE_STAGE_CPU, accesses);
}

/// A cpu stage that reads what the GPU made `latency` frames ago, and waits for nothing.
constexpr heddle_stage late(std::uint32_t latency, heddle_stage s) {
  s.latency = latency;
  return s;
}

/// A cpu stage whose outputs are kept on disk, by its inputs and these parameters, separated by spaces.
constexpr heddle_stage cached_by(const char* parameters, heddle_stage s) {
  s.cached_by = parameters;
  return s;
}

/// A stage that is there only while a choice is this one: "accumulation=blend".
constexpr heddle_stage only_if(const char* choice, heddle_stage s) {
  s.only_if = choice;
  return s;
}

/// A stage of a loop: HEDDLE_LOOP_BEFORE or HEDDLE_LOOP_AFTER.
constexpr heddle_stage in_loop(std::uint32_t part, heddle_stage s) {
  s.loop_part = part;
  return s;
}
/// Passes of a loop's body read the value `output` in place of what the input `input` is bound to.
constexpr heddle_override override_of(const char* input, const char* output) {
  heddle_override o{};
  o.struct_size = sizeof(heddle_override);
  o.input = input;
  o.output = output;
  return o;
}
/// gathers: ports, separated by spaces.
template <std::size_t kCount>
constexpr heddle_loop loop(const heddle_override (&overrides)[kCount], const char* gathers) {
  heddle_loop l{};
  l.struct_size = sizeof(heddle_loop);
  l.overrides = list(overrides, l.override_count);
  l.gathers = gathers;
  return l;
}

/// calls: roles whose functions the shader calls, separated by spaces, or NULL.
constexpr heddle_shader shader(std::uint32_t kind, const char* name, const char* stage_name, const char* file,
                               const char* calls = nullptr) {
  heddle_shader s{};
  s.struct_size = sizeof(heddle_shader);
  s.name = name;
  s.kind = kind;
  s.stage = stage_name;
  s.file = file;
  s.calls = calls;
  return s;
}
constexpr heddle_shader compute_shader(const char* name, const char* stage_name, const char* file,
                                       const char* calls = nullptr) {
  return shader(HEDDLE_SHADER_COMPUTE, name, stage_name, file, calls);
}
constexpr heddle_shader fullscreen_shader(const char* name, const char* stage_name, const char* file,
                                          const char* calls = nullptr) {
  return shader(HEDDLE_SHADER_FULLSCREEN, name, stage_name, file, calls);
}
/// file "": depth only. Bias is towards the light when negative (reversed depth).
constexpr heddle_shader surfaces_shader(const char* name, const char* stage_name, const char* file,
                                        float depth_bias_constant = 0.0F, float depth_bias_slope = 0.0F) {
  heddle_shader s = shader(HEDDLE_SHADER_SURFACES, name, stage_name, file);
  s.depth_bias_constant = depth_bias_constant;
  s.depth_bias_slope = depth_bias_slope;
  return s;
}

template <std::size_t kCount>
constexpr heddle_function function(const char* role, const char* file, const heddle_access (&accesses)[kCount],
                                   const char* calls = nullptr, const void* service = nullptr) {
  heddle_function f{};
  f.struct_size = sizeof(heddle_function);
  f.role = role;
  f.file = file;
  f.accesses = list(accesses, f.access_count);
  f.calls = calls;
  f.service = service;
  return f;
}
/// A function that reads no port.
constexpr heddle_function function(const char* role, const char* file, const char* calls = nullptr,
                                   const void* service = nullptr) {
  heddle_function f{};
  f.struct_size = sizeof(heddle_function);
  f.role = role;
  f.file = file;
  f.calls = calls;
  f.service = service;
  return f;
}

// ---- what the host gives --------------------------------------------------------------------------------------------

/// The host's side of a pass, from create until destroy; copied freely.
class PassHost {
 public:
  explicit PassHost(const heddle_pass_host* host) : host_(host) {}
  [[nodiscard]] const heddle_pass_host* raw() const { return host_; }

  /// Says something to the person at the screen and gives the status back: `return host.fail(HEDDLE_UNSUPPORTED, ...)`.
  heddle_status fail(heddle_status status, const std::string& text) const {
    host_->report(host_, HEDDLE_SEVERITY_ERROR, text.c_str());
    return status;
  }
  void warn(const std::string& text) const { host_->report(host_, HEDDLE_SEVERITY_WARNING, text.c_str()); }
  void inform(const std::string& text) const { host_->report(host_, HEDDLE_SEVERITY_INFO, text.c_str()); }

  /// 0 for names that do not exist.
  [[nodiscard]] double parameter(const char* name) const { return parameter3(name)[0]; }
  [[nodiscard]] std::array<double, 3> parameter3(const char* name) const {
    std::array<double, 3> out{};
    host_->parameter(host_, name, out.data());
    return out;
  }
  [[nodiscard]] bool toggle(const char* name) const { return parameter(name) != 0.0; }
  [[nodiscard]] std::int32_t integer(const char* name) const { return static_cast<std::int32_t>(parameter(name)); }
  [[nodiscard]] std::uint32_t choice(const char* name) const { return static_cast<std::uint32_t>(parameter(name)); }

  /// A parameter of type text, or one of the names of a list; "" if there is none.
  [[nodiscard]] std::string text(const char* name, std::uint32_t index = 0) const {
    const char* found = "";
    host_->text(host_, name, index, &found);
    return found;
  }
  /// Of a relative path: as seen from the graph's file.
  [[nodiscard]] std::string resolve_path(const std::string& path) const {
    return host_->resolve_path(host_, path.c_str());
  }
  /// In declare and prepare: what shaders include as "generated/NAME.glsl".
  heddle_status set_text(const char* name, const std::string& glsl) const {
    return host_->set_text(host_, name, glsl.c_str());
  }

  /// In declare: the format of an out port; the rest stays as the descriptor says.
  heddle_status set_format(const char* port_name, VkFormat format) const {
    heddle_shape shape{};
    shape.format = static_cast<std::uint32_t>(format);
    return set_shape(port_name, shape);
  }
  /// In declare: zero fields keep what the descriptor says.
  heddle_status set_shape(const char* port_name, heddle_shape shape) const {
    shape.struct_size = sizeof(heddle_shape);
    return host_->set_shape(host_, port_name, &shape);
  }
  /// In declare: how many elements an out list holds.
  heddle_status set_capacity(const char* port_name, std::uint32_t capacity) const {
    return host_->set_capacity(host_, port_name, capacity);
  }
  /// Before the next frame: declare, migrate, prepare.
  void request_redeclare() const { host_->request_redeclare(host_); }
  /// In declare: of inputs; later: of all. All zero for unknown ports.
  [[nodiscard]] heddle_shape shape(const char* port_name) const {
    heddle_shape out{};
    out.struct_size = sizeof(heddle_shape);
    if (host_->shape(host_, port_name, &out) != HEDDLE_OK) return {};
    return out;
  }
  [[nodiscard]] bool is_bound(const char* port_name) const { return shape(port_name).is_bound != 0; }
  /// An artifact that comes in, at any time; empty if unbound. Valid as long as the object.
  template <typename T>
  [[nodiscard]] std::span<const T> artifact(const char* port_name) const {
    static_assert(std::is_trivially_copyable_v<T>);
    std::uint64_t bytes = 0;
    const void* data = host_->value(host_, nullptr, port_name, &bytes);
    return {static_cast<const T*>(data), data == nullptr ? 0 : static_cast<std::size_t>(bytes / sizeof(T))};
  }
  /// The optional service `id` as the table Service, or NULL.
  template <typename Service>
  [[nodiscard]] const Service* service(const char* id) const {
    return static_cast<const Service*>(host_->service(host_, id));
  }
  template <typename Service>
  [[nodiscard]] const Service* function_service(const char* role) const {
    return static_cast<const Service*>(host_->function_service(host_, role));
  }

 private:
  const heddle_pass_host* host_;
};

/// One component of the rendered scene: a row for each thing that has it. Valid until the running call returns; empty
/// on a host without the service.
class Components {
 public:
  explicit Components(const heddle_component_table& table) : table_(table) {}
  [[nodiscard]] std::uint32_t count() const { return table_.count; }
  [[nodiscard]] std::uint64_t revision() const { return table_.revision; }
  [[nodiscard]] std::uint32_t owner_kind(std::uint32_t row) const { return table_.owner_kinds[row]; }
  [[nodiscard]] std::uint32_t owner(std::uint32_t row) const { return table_.owners[row]; }
  /// The row of a thing.
  [[nodiscard]] std::optional<std::uint32_t> find(std::uint32_t kind, std::uint32_t id) const {
    std::uint32_t low = 0, high = table_.count;
    while (low < high) {
      const std::uint32_t middle = low + (high - low) / 2;
      const bool is_before =
          table_.owner_kinds[middle] != kind ? table_.owner_kinds[middle] < kind : table_.owners[middle] < id;
      if (is_before)
        low = middle + 1;
      else
        high = middle;
    }
    const bool is_found = low < table_.count && table_.owner_kinds[low] == kind && table_.owners[low] == id;
    return is_found ? std::optional(low) : std::nullopt;
  }
  /// A property that the scene wrote: its first number.
  [[nodiscard]] std::optional<double> written(std::uint32_t row, std::string_view property) const {
    const std::uint32_t i = index(property);
    if (i == table_.property_count || (table_.written[row] >> i & 1U) == 0) return std::nullopt;
    return at(row, i)[0];
  }
  /// A property's numbers, the default where nothing was written; empty for an unknown name.
  [[nodiscard]] std::span<const double> values(std::uint32_t row, std::string_view property) const {
    const std::uint32_t i = index(property);
    if (i == table_.property_count) return {};
    const std::uint32_t end = i + 1 == table_.property_count ? table_.value_count : table_.first_values[i + 1];
    return {at(row, i), end - table_.first_values[i]};
  }

 private:
  [[nodiscard]] std::uint32_t index(std::string_view property) const {
    std::uint32_t i = 0;
    while (i < table_.property_count && property != table_.property_names[i]) ++i;
    return i;
  }
  [[nodiscard]] const double* at(std::uint32_t row, std::uint32_t property) const {
    return table_.values + std::size_t{row} * table_.value_count + table_.first_values[property];
  }
  heddle_component_table table_;
};

/// A component that the technique names in `components`; *out is empty on an error. frame NULL: in declare.
inline heddle_status components(const PassHost& host, heddle_frame* frame, const char* name,
                                std::optional<Components>& out) {
  heddle_component_table table{};
  table.struct_size = sizeof table;
  heddle_status status = HEDDLE_OK;
  const auto* service = host.service<heddle_components_service>(HEDDLE_COMPONENTS_SERVICE);
  if (service != nullptr) status = service->table(host.raw(), frame, name, &table);
  out.emplace(status == HEDDLE_OK ? table : heddle_component_table{});
  return status;
}

/// One record or execute call: the stage, the frame, and what may be done in it. Not to be kept.
class Frame {
 public:
  Frame(const heddle_pass_host* host, std::uint32_t stage, heddle_frame* frame, const heddle_frame_info* info)
      : host_(host), stage_(stage), frame_(frame), info_(info) {}
  [[nodiscard]] PassHost host() const { return PassHost(host_); }
  [[nodiscard]] std::uint32_t stage() const { return stage_; }
  [[nodiscard]] const heddle_frame_info& info() const { return *info_; }
  [[nodiscard]] heddle_frame* raw() const { return frame_; }

  /// Elements of a bound value port: `frame.value<HeddleLight>("lights")`. Empty if unbound.
  template <typename T>
  [[nodiscard]] std::span<const T> value(const char* port_name) const {
    static_assert(std::is_trivially_copyable_v<T>);
    std::uint64_t bytes = 0;
    const void* data = host_->value(host_, frame_, port_name, &bytes);
    return {static_cast<const T*>(data), data == nullptr ? 0 : static_cast<std::size_t>(bytes / sizeof(T))};
  }
  template <typename T>
  heddle_status set_value(const char* port_name, std::span<const T> data) const {
    static_assert(std::is_trivially_copyable_v<T>);
    return host_->set_value(host_, frame_, port_name, data.data(), data.size_bytes());
  }

  /// A component that the technique names in `components`; *out is empty on an error.
  [[nodiscard]] heddle_status components(const char* name, std::optional<Components>& out) const {
    return pass::components(host(), frame_, name, out);
  }

  // cpu stages
  heddle_status map(const char* port_name, heddle_mapped& out) const {
    out = {};
    out.struct_size = sizeof(heddle_mapped);
    return host_->map(host_, frame_, port_name, &out);
  }
  /// How much is done, 0 to 1. Other than HEDDLE_OK: return it at once.
  heddle_status progress(double done) const { return host_->progress(host_, frame_, done); }
  /// One more row of a report; level: HEDDLE_SEVERITY_*. `frame.add_row("report", HEDDLE_SEVERITY_ERROR, "a hole",
  /// {{"edge", 12.0}, {"mesh", "floor"}})`
  struct RowValue {
    RowValue(const char* value_name, double value) : name(value_name), number(value) {}
    RowValue(const char* value_name, const char* value) : name(value_name), text(value) {}
    const char* name;
    double number = 0;
    const char* text = nullptr;
  };
  heddle_status add_row(const char* port_name, std::uint32_t level, const std::string& message,
                        std::initializer_list<RowValue> values = {}) const {
    std::vector<heddle_report_value> all;
    for (const RowValue& one : values) all.push_back({sizeof(heddle_report_value), 0, one.name, one.number, one.text});
    const heddle_report_row row{sizeof row, level, message.c_str(), all.data(), static_cast<std::uint32_t>(all.size()),
                                0};
    return host_->add_row(host_, frame_, port_name, &row);
  }
  /// In save_state.
  template <typename T>
  heddle_status keep_state(std::span<const T> data) const {
    static_assert(std::is_trivially_copyable_v<T>);
    return host_->keep_state(host_, frame_, data.data(), data.size_bytes());
  }
  /// *out is the host's, valid until execute returns.
  heddle_status snapshot(const char* port_name, const heddle_snapshot*& out, heddle_alpha_test& out_alpha_test) const {
    return host_->snapshot(host_, frame_, port_name, &out, &out_alpha_test);
  }

  // gpu stages; Push: the structure of the shader's push constants
  heddle_status dispatch(const char* shader_name, std::uint32_t x, std::uint32_t y = 1, std::uint32_t z = 1) const {
    return host_->dispatch(host_, frame_, shader_name, x, y, z, nullptr, 0);
  }
  template <typename Push>
  heddle_status dispatch(const char* shader_name, std::uint32_t x, std::uint32_t y, std::uint32_t z,
                         const Push& push) const {
    return host_->dispatch(host_, frame_, shader_name, x, y, z, &push, push_size<Push>());
  }
  heddle_status dispatch_over(const char* shader_name, const char* port_name) const {
    return host_->dispatch_over(host_, frame_, shader_name, port_name, nullptr, 0);
  }
  template <typename Push>
  heddle_status dispatch_over(const char* shader_name, const char* port_name, const Push& push) const {
    return host_->dispatch_over(host_, frame_, shader_name, port_name, &push, push_size<Push>());
  }
  /// One invocation in x for each element that the list holds.
  heddle_status dispatch_over_list(const char* shader_name, const char* port_name) const {
    return host_->dispatch_over_list(host_, frame_, shader_name, port_name, nullptr, 0);
  }
  template <typename Push>
  heddle_status dispatch_over_list(const char* shader_name, const char* port_name, const Push& push) const {
    return host_->dispatch_over_list(host_, frame_, shader_name, port_name, &push, push_size<Push>());
  }
  heddle_status fullscreen(const char* shader_name, std::uint32_t layer = 0) const {
    return host_->fullscreen(host_, frame_, shader_name, layer, nullptr, 0);
  }
  template <typename Push>
  heddle_status fullscreen(const char* shader_name, std::uint32_t layer, const Push& push) const {
    return host_->fullscreen(host_, frame_, shader_name, layer, &push, push_size<Push>());
  }
  /// What attachments of HEDDLE_BLEND_CONSTANT weigh the drawings that follow with, 0 to 1 in every channel.
  heddle_status set_blend_constant(float weight) const {
    const std::array<float, 4> constant{weight, weight, weight, weight};
    return host_->set_blend_constant(host_, frame_, constant.data());
  }
  /// A drawing to be changed field by field, then given to draw().
  [[nodiscard]] static heddle_draw drawing(const char* shader_name, const char* surfaces_port = "surfaces") {
    heddle_draw d{};
    d.struct_size = sizeof(heddle_draw);
    d.shader = shader_name;
    d.surfaces = surfaces_port;
    return d;
  }
  heddle_status draw(const heddle_draw& drawing) const { return host_->draw(host_, frame_, &drawing); }
  /// What a surfaces port of the technique holds from now on; revision 0: its buffers may hold anything.
  heddle_status set_batches(const char* port_name, std::span<const heddle_batch> list, std::uint64_t revision) const {
    return host_->set_batches(host_, frame_, port_name, list.data(), static_cast<std::uint32_t>(list.size()), revision);
  }
  void barrier() const { host_->barrier(host_, frame_); }
  template <typename T>
  heddle_status update_buffer(const char* port_name, std::uint64_t offset, std::span<const T> data) const {
    return host_->update_buffer(host_, frame_, port_name, offset, data.data(), data.size_bytes());
  }

  // underneath
  [[nodiscard]] const heddle_vulkan& vulkan() const { return *host_->vulkan; }
  [[nodiscard]] VkCommandBuffer command_buffer() const { return host_->command_buffer(host_, frame_); }
  [[nodiscard]] VkImage image(const char* port_name) const { return host_->image(host_, frame_, port_name); }
  [[nodiscard]] VkImageView image_view(const char* port_name) const {
    return host_->image_view(host_, frame_, port_name);
  }
  [[nodiscard]] VkBuffer buffer(const char* port_name) const { return host_->buffer(host_, frame_, port_name); }

 private:
  template <typename Push>
  static constexpr std::uint32_t push_size() {
    static_assert(std::is_trivially_copyable_v<Push> && sizeof(Push) <= 64 && sizeof(Push) % 4 == 0);
    return sizeof(Push);
  }
  const heddle_pass_host* host_;
  std::uint32_t stage_;
  heddle_frame* frame_;
  const heddle_frame_info* info_;
};

// ---- the technique --------------------------------------------------------------------------------------------------

namespace detail {

/// Nothing throws across the border.
template <typename Call>
heddle_status guarded(const heddle_pass_host* host, const Call& call) noexcept {
  try {
    return call();
  } catch (const std::bad_alloc&) {
    host->report(host, HEDDLE_SEVERITY_ERROR, "out of memory");
  } catch (const std::exception& error) {
    host->report(host, HEDDLE_SEVERITY_ERROR, error.what());
  } catch (...) {
    host->report(host, HEDDLE_SEVERITY_ERROR, "an exception without text left the plugin");
  }
  return HEDDLE_FAILED;
}

template <typename Pass>
struct Thunks {
  static Pass& self(heddle_pass* pass) { return *reinterpret_cast<Pass*>(pass); }
  static heddle_status create(const heddle_pass_host* host, heddle_pass** out) {
    return guarded(host, [&]() -> heddle_status {
      if constexpr (std::is_constructible_v<Pass, const PassHost&>)
        *out = reinterpret_cast<heddle_pass*>(new Pass(PassHost(host)));
      else
        *out = reinterpret_cast<heddle_pass*>(new Pass());
      return HEDDLE_OK;
    });
  }
  static void destroy(heddle_pass* pass) { delete reinterpret_cast<Pass*>(pass); }
  static heddle_status declare(heddle_pass* pass, const heddle_pass_host* host) {
    return guarded(host, [&] { return self(pass).declare(PassHost(host)); });
  }
  static heddle_status prepare(heddle_pass* pass, const heddle_pass_host* host) {
    return guarded(host, [&] { return self(pass).prepare(PassHost(host)); });
  }
  static heddle_status record(heddle_pass* pass, const heddle_pass_host* host, std::uint32_t stage, heddle_frame* frame,
                              const heddle_frame_info* info) {
    return guarded(host, [&] { return self(pass).record(Frame(host, stage, frame, info)); });
  }
  static heddle_status execute(heddle_pass* pass, const heddle_pass_host* host, std::uint32_t stage,
                               heddle_frame* frame, const heddle_frame_info* info) {
    return guarded(host, [&] { return self(pass).execute(Frame(host, stage, frame, info)); });
  }
  static std::uint32_t activity(heddle_pass* pass, const heddle_pass_host* host, std::uint32_t stage,
                                heddle_frame* frame, const heddle_frame_info* info) {
    std::uint32_t answer = HEDDLE_RUN;
    static_cast<void>(guarded(host, [&]() -> heddle_status {
      answer = self(pass).activity(Frame(host, stage, frame, info));
      return HEDDLE_OK;
    }));
    return answer;
  }
  static heddle_status iterations(heddle_pass* pass, const heddle_pass_host* host, const heddle_frame_info* info,
                                  heddle_iterations* out) {
    return guarded(host, [&] { return self(pass).iterations(*info, *out); });
  }
  static void counted(heddle_pass* pass, const heddle_pass_host* host, const heddle_list_count* count) {
    static_cast<void>(guarded(host, [&]() -> heddle_status {
      self(pass).counted(PassHost(host), *count);
      return HEDDLE_OK;
    }));
  }
  static heddle_status migrate(heddle_pass* pass, const heddle_pass_host* host, const heddle_migration* migration) {
    return guarded(host, [&] { return self(pass).migrate(PassHost(host), *migration); });
  }
  static heddle_status save_state(heddle_pass* pass, const heddle_pass_host* host, std::uint32_t stage,
                                  heddle_frame* frame) {
    const heddle_frame_info none{};
    return guarded(host, [&] { return self(pass).save_state(Frame(host, stage, frame, &none)); });
  }
  static heddle_status load_state(heddle_pass* pass, const heddle_pass_host* host, std::uint32_t stage,
                                  heddle_frame* frame, const void* data, std::uint64_t bytes) {
    const heddle_frame_info none{};
    return guarded(host, [&] {
      return self(pass).load_state(Frame(host, stage, frame, &none), {static_cast<const std::byte*>(data), bytes});
    });
  }
};

}  // namespace detail

/// A technique of class Pass: only the functions that Pass has are filled in.
template <typename Pass>
constexpr heddle_technique technique(const char* id, const char* title, const char* source,
                                     std::uint32_t role_revision = 1, std::uint32_t flags = 0) {
  using Thunks = detail::Thunks<Pass>;
  heddle_technique t{};
  t.struct_size = sizeof(heddle_technique);
  t.flags = flags;
  t.id = id;
  t.title = title;
  t.source = source;
  t.role_revision = role_revision;
  t.create = &Thunks::create;
  t.destroy = &Thunks::destroy;
  if constexpr (requires(Pass pass, const PassHost& host) { pass.declare(host); }) t.declare = &Thunks::declare;
  if constexpr (requires(Pass pass, const PassHost& host) { pass.prepare(host); }) t.prepare = &Thunks::prepare;
  if constexpr (requires(Pass pass, const Frame& frame) { pass.record(frame); }) t.record = &Thunks::record;
  if constexpr (requires(Pass pass, const Frame& frame) { pass.execute(frame); }) t.execute = &Thunks::execute;
  if constexpr (requires(Pass pass, const Frame& frame) { pass.activity(frame); }) t.activity = &Thunks::activity;
  if constexpr (requires(Pass pass, const heddle_frame_info& info, heddle_iterations& out) {
                  pass.iterations(info, out);
                })
    t.iterations = &Thunks::iterations;
  if constexpr (requires(Pass pass, const PassHost& host, const heddle_list_count& count) {
                  pass.counted(host, count);
                })
    t.counted = &Thunks::counted;
  if constexpr (requires(Pass pass, const PassHost& host, const heddle_migration& migration) {
                  pass.migrate(host, migration);
                })
    t.migrate = &Thunks::migrate;
  if constexpr (requires(Pass pass, const Frame& frame) { pass.save_state(frame); }) t.save_state = &Thunks::save_state;
  if constexpr (requires(Pass pass, const Frame& frame, std::span<const std::byte> state) {
                  pass.load_state(frame, state);
                })
    t.load_state = &Thunks::load_state;
  return t;
}

namespace detail {

template <std::size_t kCount>
constexpr void put(heddle_technique& t, const heddle_port (&ports)[kCount]) {
  t.ports = list(ports, t.port_count);
}
template <std::size_t kCount>
constexpr void put(heddle_technique& t, const heddle_parameter (&parameters)[kCount]) {
  t.parameters = list(parameters, t.parameter_count);
}
template <std::size_t kCount>
constexpr void put(heddle_technique& t, const heddle_stage (&stages)[kCount]) {
  t.stages = list(stages, t.stage_count);
}
template <std::size_t kCount>
constexpr void put(heddle_technique& t, const heddle_shader (&shaders)[kCount]) {
  t.shaders = list(shaders, t.shader_count);
}
template <std::size_t kCount>
constexpr void put(heddle_technique& t, const heddle_function (&functions)[kCount]) {
  t.functions = list(functions, t.function_count);
}

}  // namespace detail

/// The same with its tables: kPorts, kParameters, kStages, kShaders, kFunctions, those that there are, in any order.
template <typename Pass, typename... Tables>
requires(sizeof...(Tables) > 0 && (std::is_array_v<Tables> && ...)) constexpr heddle_technique
    technique(const char* id, const char* title, const char* source, const Tables&... tables) {
  heddle_technique t = technique<Pass>(id, title, source);
  (detail::put(t, tables), ...);
  return t;
}

/// A technique whose functions are all text: no object.
struct Nothing {};

template <typename... Techniques>
constexpr std::array<const heddle_technique*, sizeof...(Techniques)> technique_list(const Techniques&... techniques) {
  return {&techniques...};
}

}  // namespace heddle::pass

/// Defines heddle_entry: HEDDLE_PLUGIN(kMyTechnique) or several, separated by commas. Once in a library.
#define HEDDLE_PLUGIN(...)                                                                                      \
  extern "C" const heddle_plugin* heddle_entry(void) {                                                          \
    static constexpr auto kTechniques = heddle::pass::technique_list(__VA_ARGS__);                              \
    static constexpr heddle_plugin kPlugin{sizeof(heddle_plugin), HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR,           \
                                           static_cast<std::uint32_t>(kTechniques.size()), kTechniques.data()}; \
    return &kPlugin;                                                                                            \
  }
