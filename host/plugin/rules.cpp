// SPDX-License-Identifier: Apache-2.0
// A technique -> the rules of plugin.h that it breaks.
#include "plugin/rules.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>

namespace heddle {
namespace {

constexpr std::uint32_t kLastCompareOp = VK_COMPARE_OP_ALWAYS;

bool is_image_access(std::uint32_t access) {
  return access == HEDDLE_ACCESS_SAMPLED || access == HEDDLE_ACCESS_SAMPLED_LINEAR ||
         access == HEDDLE_ACCESS_SAMPLED_COMPARE || access == HEDDLE_ACCESS_COLOR || access == HEDDLE_ACCESS_DEPTH ||
         access == HEDDLE_ACCESS_DEPTH_READ;
}

bool is_storage_access(std::uint32_t access) {
  return access == HEDDLE_ACCESS_STORAGE_READ || access == HEDDLE_ACCESS_STORAGE_WRITE ||
         access == HEDDLE_ACCESS_STORAGE_READ_WRITE;
}

// Whoever writes into a list appends, or changes elements that are there.
bool fits_list(std::uint32_t access) {
  return access == HEDDLE_ACCESS_APPEND || access == HEDDLE_ACCESS_STORAGE_READ ||
         access == HEDDLE_ACCESS_STORAGE_READ_WRITE || access == HEDDLE_ACCESS_HOST_READ ||
         access == HEDDLE_ACCESS_TRANSFER_READ;
}

bool is_host_access(std::uint32_t access) {
  return access == HEDDLE_ACCESS_HOST_READ || access == HEDDLE_ACCESS_HOST_WRITE;
}

bool is_write(std::uint32_t access) {
  return access == HEDDLE_ACCESS_STORAGE_WRITE || access == HEDDLE_ACCESS_STORAGE_READ_WRITE ||
         access == HEDDLE_ACCESS_COLOR || access == HEDDLE_ACCESS_DEPTH || access == HEDDLE_ACCESS_HOST_WRITE ||
         access == HEDDLE_ACCESS_TRANSFER_WRITE || access == HEDDLE_ACCESS_APPEND || access == HEDDLE_ACCESS_BATCHES;
}

bool fits_port(std::uint32_t access, PortType type) {
  const bool is_transfer = access == HEDDLE_ACCESS_TRANSFER_READ || access == HEDDLE_ACCESS_TRANSFER_WRITE;
  switch (type) {
    case PortType::kImage:
      return is_image_access(access) || is_storage_access(access) || is_host_access(access) || is_transfer;
    case PortType::kBuffer:
      return is_storage_access(access) || is_host_access(access) || is_transfer;
    case PortType::kValue:
      return access == HEDDLE_ACCESS_VALUE || is_host_access(access);
    case PortType::kSurfaces:
      return access == HEDDLE_ACCESS_DRAW || access == HEDDLE_ACCESS_HOST_READ || access == HEDDLE_ACCESS_BATCHES;
    case PortType::kArtifact:
    case PortType::kReport:
      return access == HEDDLE_ACCESS_VALUE;
  }
  return true;  // an unknown type is complained of once, as the port's
}

bool ends_with_stage(std::string_view file, std::string_view ending) {
  return file.size() > ending.size() && file.ends_with(ending);
}

// A file of the technique's own folder: nothing that leads out of it.
bool is_own_file(std::string_view file) {
  return !file.empty() && file.front() != '/' && file.find("..") == std::string_view::npos;
}

class Rules {
 public:
  Rules(const Technique& technique, const Location& where) : technique_(technique), where_(where) {}

  std::vector<Diagnostic> check() {
    if (!is_technique_id(technique_.id) || technique_.name() == "none") {
      complain("id is no technique id", fmt::format("\"{}\"", technique_.id),
               "\"role/technique\", both names, and the technique's not 'none'");
    }
    if (technique_.title.empty()) complain("title is empty");
    if (technique_.role_revision == 0) complain("role_revision is 0", {}, "the revision in role.toml, from 1");
    for (const Port& port : technique_.ports) check_port(port);
    for (const Parameter& parameter : technique_.parameters) check_parameter(parameter);
    for (const Stage& stage : technique_.stages) check_stage(stage);
    for (const Shader& shader : technique_.shaders) check_shader(shader);
    for (const Function& function : technique_.functions) check_function(function);
    check_loop();
    check_outputs();
    for (const Port& port : technique_.ports) check_surfaces(port);
    return std::move(broken_);
  }

 private:
  void complain(std::string_view message, std::string found = {}, std::string expected = {}) {
    Diagnostic diagnostic;
    diagnostic.where = where_;
    diagnostic.message = fmt::format("technique '{}': {}", technique_.id, message);
    diagnostic.found = std::move(found);
    diagnostic.expected = std::move(expected);
    broken_.push_back(std::move(diagnostic));
  }

  // Identifiers, unique in their kind.
  void check_name(std::string_view kind, const std::string& name, std::set<std::string>& taken) {
    if (!is_identifier(name)) {
      complain(fmt::format("{} '{}': this is no name", kind, name), {},
               "letters, digits and single underscores, no digit first, no gl_");
    }
    if (!taken.insert(name).second) complain(fmt::format("two of the kind {} are called '{}'", kind, name));
  }

  void check_flags(std::string_view what, std::uint32_t flags, std::uint32_t known) {
    if ((flags & ~known) != 0) {
      complain(fmt::format("{}: unknown flags", what), fmt::format("{:#x}", flags),
               fmt::format("a combination within {:#x}", known));
    }
  }

  // False if an enumeration is out of range, so that nothing else is concluded from it.
  bool check_choice(std::string_view what, std::string_view field, std::uint32_t value, std::uint32_t last) {
    if (value <= last) return true;
    complain(fmt::format("{}: unknown {}", what, field), fmt::format("{}", value), fmt::format("0 to {}", last));
    return false;
  }

  void check_port(const Port& port) {
    check_name("port", port.name, port_names_);
    const std::string what = fmt::format("port '{}'", port.name);
    check_flags(what, port.flags,
                HEDDLE_PORT_OPTIONAL | HEDDLE_PORT_KEPT | HEDDLE_PORT_CUBE | HEDDLE_PORT_REWRITTEN | HEDDLE_PORT_LIST);
    bool is_known = check_choice(what, "type", static_cast<std::uint32_t>(port.type), HEDDLE_PORT_REPORT);
    is_known = check_choice(what, "direction", static_cast<std::uint32_t>(port.direction), HEDDLE_INOUT) && is_known;
    is_known = check_choice(what, "extent_rule", port.extent_rule, HEDDLE_EXTENT_ABSOLUTE) && is_known;
    if (!is_known) return;
    const bool is_image = port.type == PortType::kImage;
    if (port.is_optional() && port.direction == Direction::kOut) {
      complain(what + ": an output cannot be HEDDLE_PORT_OPTIONAL");
    }
    if (port.is_kept() && port.direction == Direction::kIn) complain(what + ": an input cannot be HEDDLE_PORT_KEPT");
    if ((port.flags & HEDDLE_PORT_REWRITTEN) != 0 && !port.is_kept()) {
      complain(what + ": HEDDLE_PORT_REWRITTEN is for outputs that are HEDDLE_PORT_KEPT");
    }
    if (!port.previous_of.empty()) check_history(port, what);
    if ((port.flags & HEDDLE_PORT_CUBE) != 0 &&
        (!is_image || (port.direction == Direction::kOut && port.layers % 6 != 0))) {
      complain(what + ": HEDDLE_PORT_CUBE needs an image with layers in sixes", fmt::format("{} layers", port.layers));
    }
    if (port.direction == Direction::kIn && port.format != 0) {
      complain(what + ": an input cannot choose a format", fmt::format("{}", port.format), "0");
    }
    if (!std::isfinite(port.extent_scale) || port.extent_scale <= 0) {
      complain(what + ": extent_scale is no scale", fmt::format("{}", port.extent_scale), "a number above 0");
    }
    if (is_image && port.direction == Direction::kOut && port.extent_rule == HEDDLE_EXTENT_ABSOLUTE &&
        (port.width == 0 || port.height == 0)) {
      complain(what + ": HEDDLE_EXTENT_ABSOLUTE without an extent", fmt::format("{} x {}", port.width, port.height),
               "width and height above 0");
    }
    if (port.layers == 0 || port.mips == 0) complain(what + ": no layers or no mips");
    if (!port.glsl.empty() && port.type != PortType::kBuffer && port.type != PortType::kValue) {
      complain(what + ": glsl belongs to buffers and values");
    }
    if (lasts(port.type)) check_lasting(port, what);
    check_list(port, what);
  }

  void check_lasting(const Port& port, const std::string& what) {
    const bool is_report = port.type == PortType::kReport;
    if (port.direction != Direction::kOut && (is_report || port.direction == Direction::kInout)) {
      complain(what + ": the direction does not fit its type", is_report ? "a report" : "an artifact that is changed",
               is_report ? "HEDDLE_OUT" : "HEDDLE_IN or HEDDLE_OUT");
    }
    if ((port.flags & ~HEDDLE_PORT_OPTIONAL) != 0 || port.byte_size != 0) {
      complain(what + ": artifacts and reports have no size and no flags but HEDDLE_PORT_OPTIONAL");
    }
  }

  // Made surfaces lie in buffers that the technique makes, and one stage says what is in them.
  void check_surfaces(const Port& port) {
    const std::string what = fmt::format("port '{}'", port.name);
    const std::array<std::pair<std::string_view, const std::string*>, 4> buffers{{{"vertices", &port.vertices},
                                                                                  {"indices", &port.indices},
                                                                                  {"instances", &port.instances},
                                                                                  {"commands", &port.commands}}};
    const bool is_made = port.type == PortType::kSurfaces && port.direction != Direction::kIn;
    for (const auto& [field, name] : buffers) {
      if (name->empty()) continue;
      const Port* buffer = technique_.find_port(*name);
      const bool is_buffer = buffer != nullptr && buffer->type == PortType::kBuffer &&
                             buffer->direction == Direction::kOut && (!buffer->is_list() || field == "commands");
      if (!is_made || !is_buffer) {
        complain(fmt::format("{}: {} names nothing that batches could lie in", what, field),
                 fmt::format("\"{}\"", *name),
                 is_made ? "an out buffer of the technique, a list for commands alone" : "NULL: it makes no surfaces");
      }
    }
    if (!is_made) return;
    const bool has_vertices = !port.vertices.empty() || technique_.find_function(kProgramRole) != nullptr;
    if (!has_vertices || port.indices.empty() || port.instances.empty() != port.commands.empty()) {
      complain(what + ": its batches have no place", {},
               "vertices, or a function of role surface_program, and indices; instances and commands both or none");
    }
    const auto makers = std::count_if(technique_.stages.begin(), technique_.stages.end(), [&](const Stage& stage) {
      return std::any_of(stage.accesses.begin(), stage.accesses.end(), [&](const Access& access) {
        return access.port == port.name && access.access == HEDDLE_ACCESS_BATCHES;
      });
    });
    if (makers != 1) {
      complain(what + ": one stage sets its batches", fmt::format("{} with HEDDLE_ACCESS_BATCHES", makers), "one");
    }
  }

  void check_list(const Port& port, const std::string& what) {
    if (!port.is_list()) {
      if (port.capacity != 0 || port.element_bytes != 0)
        complain(what + ": capacity and element_bytes belong to HEDDLE_PORT_LIST");
      return;
    }
    if (port.type != PortType::kBuffer) complain(what + ": HEDDLE_PORT_LIST is for buffers");
    if (port.byte_size != 0) {
      complain(what + ": a list's memory follows from its capacity", fmt::format("byte_size {}", port.byte_size),
               "byte_size 0");
    }
    // An optional inout port makes the list where nobody has made it above.
    const bool may_make =
        port.direction == Direction::kOut || (port.direction == Direction::kInout && port.is_optional());
    if (may_make && (port.element_bytes == 0 || port.element_bytes % 4 != 0)) {
      complain(what + ": element_bytes is no size of an element", fmt::format("{}", port.element_bytes),
               "a multiple of 4 above 0");
    }
  }

  void check_history(const Port& port, const std::string& what) {
    const Port* newest = technique_.find_port(port.previous_of);
    const bool is_block = port.type == PortType::kImage || port.type == PortType::kBuffer;
    if (newest == nullptr || newest->direction == Direction::kIn || newest->type != port.type ||
        port.direction != Direction::kIn || port.type == PortType::kSurfaces || lasts(port.type) ||
        (is_block && !newest->is_kept())) {
      complain(what + ": previous_of names nothing that it could read", fmt::format("\"{}\"", port.previous_of),
               "for an input: an output of its type, images and buffers HEDDLE_PORT_KEPT");
    }
  }

  // The value of one component: of the type, and within the bounds.
  void check_value(const Parameter& parameter, const std::string& what, std::string_view field, double value) {
    if (!std::isfinite(value)) {
      complain(fmt::format("{}: {} is not finite", what, field), fmt::format("{}", value));
      return;
    }
    double low = parameter.minimum;
    double high = parameter.maximum;
    bool is_integer = parameter.type == ParameterType::kInt;
    if (parameter.type == ParameterType::kBool || parameter.type == ParameterType::kChoice) {
      low = 0;
      high = parameter.type == ParameterType::kBool ? 1 : static_cast<double>(parameter.choices.size()) - 1;
      is_integer = true;
    } else if (low == high) {
      low = -std::numeric_limits<double>::infinity();
      high = std::numeric_limits<double>::infinity();
    }
    if (is_integer && value != std::floor(value)) {
      complain(fmt::format("{}: {} is no integer", what, field), fmt::format("{}", value));
    } else if (value < low || value > high) {
      complain(fmt::format("{}: {} is out of range", what, field), fmt::format("{}", value),
               fmt::format("{} to {}", low, high));
    }
  }

  void check_parameter(const Parameter& parameter) {
    check_name("parameter", parameter.name, parameter_names_);
    const std::string what = fmt::format("parameter '{}'", parameter.name);
    check_flags(what, parameter.flags, HEDDLE_PARAMETER_KNOB | HEDDLE_PARAMETER_REDECLARE | HEDDLE_PARAMETER_CONSTANT);
    if (!check_choice(what, "type", static_cast<std::uint32_t>(parameter.type), HEDDLE_TYPE_TEXT)) return;
    if (std::isnan(parameter.minimum) || std::isnan(parameter.maximum) || parameter.minimum > parameter.maximum) {
      complain(what + ": the range is empty", fmt::format("{} to {}", parameter.minimum, parameter.maximum),
               "minimum <= maximum; equal: unbounded");
    }
    const bool is_choice = parameter.type == ParameterType::kChoice;
    if (is_choice == parameter.choices.empty()) {
      complain(what + (is_choice ? ": a choice without choices" : ": choices belong to HEDDLE_TYPE_CHOICE"));
    }
    std::set<std::string> names;
    for (const std::string& choice : parameter.choices) {
      if (choice.empty() || !names.insert(choice).second) {
        complain(what + ": a choice is empty or stands twice", fmt::format("\"{}\"", choice));
      }
    }
    for (std::uint32_t i = 0; i < parameter.components(); ++i) {
      check_value(parameter, what, "default_value", parameter.default_value[i]);
    }
    const bool is_scalar = parameter.components() == 1;
    if (parameter.is_knob() && (!is_scalar || parameter.ladder.size() < 2)) {
      complain(what + ": a knob needs one component and a ladder of two values or more",
               fmt::format("{} components, {} values", parameter.components(), parameter.ladder.size()));
    }
    if (!parameter.is_knob() && !parameter.ladder.empty()) {
      complain(what + ": a ladder belongs to HEDDLE_PARAMETER_KNOB");
    }
    if ((parameter.flags & HEDDLE_PARAMETER_CONSTANT) != 0 && !is_scalar) {
      complain(what + ": HEDDLE_PARAMETER_CONSTANT needs one component");
    }
    for (const double step : parameter.ladder) check_value(parameter, what, "ladder", step);
  }

  void check_accesses(const std::string& what, const std::vector<Access>& accesses) {
    std::set<std::pair<std::string, std::uint32_t>> taken;
    for (const Access& access : accesses) {
      const std::string place = fmt::format("{}: access to '{}'", what, access.port);
      const Port* port = technique_.find_port(access.port);
      if (port == nullptr) {
        std::vector<std::string> ports;
        for (const Port& candidate : technique_.ports) ports.push_back(candidate.name);
        complain(place + ": there is no such port", {}, "one of " + join_names(ports));
        continue;
      }
      bool is_known = check_choice(place, "access", access.access, HEDDLE_ACCESS_BATCHES);
      is_known = check_choice(place, "load", access.load, HEDDLE_LOAD_CLEAR_NEW) && is_known;
      is_known = check_choice(place, "blend", access.blend, HEDDLE_BLEND_CONSTANT) && is_known;
      if (!is_known) continue;
      if (port->is_list() ? !fits_list(access.access) : !fits_port(access.access, port->type)) {
        complain(place + ": the access does not fit the port's type", fmt::format("HEDDLE_ACCESS {}", access.access));
      }
      const bool is_shared_output = port->direction == Direction::kInout && port->is_optional();
      if (access.load == HEDDLE_LOAD_CLEAR_NEW && !is_shared_output) {
        complain(place + ": HEDDLE_LOAD_CLEAR_NEW is for optional inout ports");
      }
      if (access.blend != HEDDLE_BLEND_NONE && access.access != HEDDLE_ACCESS_COLOR) {
        complain(place + ": blend belongs to HEDDLE_ACCESS_COLOR");
      }
      if (is_write(access.access) && port->direction == Direction::kIn) complain(place + ": an input is written");
      if (!taken.emplace(access.port, access.access).second) complain(place + ": stands twice");
      for (const float clear : access.clear) {
        if (std::isnan(clear)) complain(place + ": clear is NaN");
      }
      used_ports_.insert(access.port);
    }
  }

  void check_stage(const Stage& stage) {
    check_name("stage", stage.name, stage_names_);
    const std::string what = fmt::format("stage '{}'", stage.name);
    if (!check_choice(what, "kind", static_cast<std::uint32_t>(stage.kind), HEDDLE_STAGE_CPU)) return;
    check_accesses(what, stage.accesses);
    const auto colors = std::count_if(stage.accesses.begin(), stage.accesses.end(),
                                      [](const Access& access) { return access.access == HEDDLE_ACCESS_COLOR; });
    for (const Access& access : stage.accesses) {
      if (access.blend == HEDDLE_BLEND_TINT && colors > 1) {
        complain(fmt::format("{}: HEDDLE_BLEND_TINT of '{}' beside another colour attachment", what, access.port),
                 fmt::format("{} colour attachments", colors), "one");
      }
      const bool is_host = is_host_access(access.access);
      const bool is_of_both = access.access == HEDDLE_ACCESS_VALUE || access.access == HEDDLE_ACCESS_BATCHES;
      const bool is_right = stage.kind == StageKind::kCpu ? is_host || is_of_both : !is_host;
      if (access.access <= HEDDLE_ACCESS_BATCHES && !is_right) {
        complain(fmt::format("{}: access to '{}' is not of its kind", what, access.port),
                 fmt::format("HEDDLE_ACCESS {}", access.access),
                 stage.kind == StageKind::kCpu ? "HOST_READ, HOST_WRITE, VALUE or BATCHES in a cpu stage"
                                               : "no HOST_READ and no HOST_WRITE in a gpu stage");
      }
      if (stage.kind == StageKind::kGpu) check_not_lasting(access, what);
    }
    check_latency(stage, what);
    if (stage.cached_by) check_cached(stage, what);
    if (stage.only_if) check_condition(*stage.only_if, what);
  }

  void check_condition(const Condition& condition, const std::string& what) {
    const Parameter* parameter = technique_.find_parameter(condition.parameter);
    const bool is_right = parameter != nullptr && parameter->type == ParameterType::kChoice &&
                          (parameter->flags & HEDDLE_PARAMETER_REDECLARE) != 0 &&
                          std::ranges::find(parameter->choices, condition.choice) != parameter->choices.end();
    if (is_right) return;
    complain(what + ": only_if names no choice that is declared anew",
             fmt::format("\"{}={}\"", condition.parameter, condition.choice),
             "\"PARAMETER=CHOICE\" of a HEDDLE_TYPE_CHOICE with HEDDLE_PARAMETER_REDECLARE");
  }

  void check_not_lasting(const Access& access, const std::string& what) {
    const Port* port = technique_.find_port(access.port);
    if (port != nullptr && lasts(port->type)) {
      complain(fmt::format("{}: access to '{}': artifacts and reports are for cpu stages", what, access.port));
    }
  }

  // What is kept on disk depends on nothing that its key lacks, and is all that the stage does.
  void check_cached(const Stage& stage, const std::string& what) {
    if (stage.kind != StageKind::kCpu || stage.latency > 0 || stage.loop_part != HEDDLE_LOOP_OUTSIDE) {
      complain(what + ": cached_by has no meaning here", {}, "a cpu stage without latency, in no part of a loop");
    }
    std::set<std::string> taken;
    for (const std::string& parameter : *stage.cached_by) {
      if (technique_.find_parameter(parameter) == nullptr || !taken.insert(parameter).second) {
        complain(what + ": cached_by names no parameter, or one twice", fmt::format("\"{}\"", parameter));
      }
    }
    bool makes_something = false;
    for (const Access& access : stage.accesses) {
      const Port* port = technique_.find_port(access.port);
      if (port == nullptr) continue;
      const bool is_out = port->direction == Direction::kOut;
      makes_something = makes_something || is_out;
      // Elements of a list have no order: nothing would be found again.
      const bool is_right = port->type != PortType::kSurfaces && !port->is_list() &&
                            port->direction != Direction::kInout &&
                            (access.access != HEDDLE_ACCESS_HOST_READ || !is_out);
      if (!is_right) {
        complain(fmt::format("{}: it is cached, and '{}' cannot be part of that", what, access.port), {},
                 "inputs that are no surfaces and no lists, and outputs that it only writes");
      }
    }
    if (!makes_something) complain(what + ": it is cached, and has no output");
  }

  void check_latency(const Stage& stage, const std::string& what) {
    if (stage.latency == 0) return;
    const bool reads = std::any_of(stage.accesses.begin(), stage.accesses.end(), [&](const Access& access) {
      const Port* port = technique_.find_port(access.port);
      return port != nullptr && stage.is_late(access, port->type);
    });
    if (stage.latency > HEDDLE_MOST_LATENCY || stage.kind != StageKind::kCpu || !reads) {
      complain(what + ": latency has no meaning here", fmt::format("{}", stage.latency),
               fmt::format("1 to {}, in a cpu stage with HOST_READ of an image or buffer", HEDDLE_MOST_LATENCY));
    }
  }

  void check_calls(const std::string& what, const std::vector<std::string>& calls) {
    std::set<std::string> taken;
    for (const std::string& role : calls) {
      if (!is_identifier(role) || !taken.insert(role).second) {
        complain(what + ": calls holds no role, or one twice", fmt::format("\"{}\"", role));
      }
    }
  }

  void check_shader(const Shader& shader) {
    check_name("shader", shader.name, shader_names_);
    const std::string what = fmt::format("shader '{}'", shader.name);
    const Stage* stage = technique_.find_stage(shader.stage);
    if (stage == nullptr || stage->kind != StageKind::kGpu) {
      std::vector<std::string> stages;
      for (const Stage& candidate : technique_.stages) {
        if (candidate.kind == StageKind::kGpu) stages.push_back(candidate.name);
      }
      complain(what + ": there is no such gpu stage", fmt::format("\"{}\"", shader.stage),
               "one of " + join_names(stages));
    }
    check_calls(what, shader.calls);
    check_choice(what, "depth_compare", shader.depth_compare, kLastCompareOp);
    if (!std::isfinite(shader.depth_bias_constant) || !std::isfinite(shader.depth_bias_slope)) {
      complain(what + ": a depth bias is not finite");
    }
    if (!check_choice(what, "kind", static_cast<std::uint32_t>(shader.kind), HEDDLE_SHADER_SURFACES)) return;
    const bool is_depth_only = shader.kind == ShaderKind::kSurfaces && shader.file.empty();
    const std::string_view ending = shader.kind == ShaderKind::kCompute ? ".comp.glsl" : ".frag.glsl";
    if (!is_depth_only && (!ends_with_stage(shader.file, ending) || !is_own_file(shader.file))) {
      complain(what + ": file is no shader of its kind", fmt::format("\"{}\"", shader.file),
               fmt::format("<what>{} in the technique's folder", ending));
    }
  }

  void check_function(const Function& function) {
    check_name("function", function.role, function_roles_);
    const std::string what = fmt::format("function '{}'", function.role);
    if (!ends_with_stage(function.file, ".glsl") || !is_own_file(function.file)) {
      complain(what + ": file is no shader text", fmt::format("\"{}\"", function.file),
               "<what>.glsl in the technique's folder");
    }
    check_accesses(what, function.accesses);
    for (const Access& access : function.accesses) {
      const bool is_sampled = access.access == HEDDLE_ACCESS_SAMPLED || access.access == HEDDLE_ACCESS_SAMPLED_LINEAR ||
                              access.access == HEDDLE_ACCESS_SAMPLED_COMPARE;
      if (!is_sampled && !is_storage_access(access.access) && access.access != HEDDLE_ACCESS_VALUE &&
          access.access != HEDDLE_ACCESS_APPEND) {
        complain(fmt::format("{}: access to '{}' is not for functions", what, access.port),
                 fmt::format("HEDDLE_ACCESS {}", access.access), "SAMPLED*, STORAGE_*, VALUE or APPEND");
      }
      check_not_lasting(access, what);
    }
    check_calls(what, function.calls);
    if (function.role == kProgramRole) check_program(function, what);
  }

  // Surface programs run in the vertex stages of passes that they do not know.
  void check_program(const Function& function, const std::string& what) {
    if (!function.calls.empty()) complain(what + " calls functions", join_names(function.calls), "none: it is no pass");
    for (const Access& access : function.accesses) {
      const Port* port = technique_.find_port(access.port);
      if (port == nullptr) continue;
      const bool is_read = access.access == HEDDLE_ACCESS_VALUE ||
                           (port->type == PortType::kBuffer && access.access == HEDDLE_ACCESS_STORAGE_READ);
      if (!is_read) {
        complain(fmt::format("{}: access to '{}' is not for surface programs", what, access.port),
                 fmt::format("HEDDLE_ACCESS {}", access.access), "VALUE, or STORAGE_READ of a buffer");
      }
    }
  }

  // Overridden values go out before the body, gathered inputs come in after it.
  void check_loop() {
    std::uint32_t last_part = HEDDLE_LOOP_OUTSIDE;
    std::array<std::uint32_t, HEDDLE_LOOP_AFTER + 1> counts{};
    for (const Stage& stage : technique_.stages) {
      const std::string what = fmt::format("stage '{}'", stage.name);
      if (!check_choice(what, "loop_part", stage.loop_part, HEDDLE_LOOP_AFTER)) return;
      ++counts[stage.loop_part];
      if (stage.loop_part == HEDDLE_LOOP_OUTSIDE) {
        if (last_part == HEDDLE_LOOP_BEFORE) complain(what + " stands between the parts of an iteration");
        continue;
      }
      if (!technique_.loop) complain(what + " is part of a loop, and the technique has none");
      if (stage.loop_part < last_part) complain(what + " stands behind the stages that gather");
      last_part = stage.loop_part;
    }
    if (!technique_.loop) return;
    const Loop& loop = *technique_.loop;
    if (loop.overrides.empty() || loop.gathers.empty() || counts[HEDDLE_LOOP_BEFORE] == 0 ||
        counts[HEDDLE_LOOP_AFTER] == 0) {
      complain("its loop overrides or gathers nothing", {},
               "an override set by a stage HEDDLE_LOOP_BEFORE, and a gathered input of a stage HEDDLE_LOOP_AFTER");
    }
    for (const Loop::Override& one : loop.overrides) {
      const Port* input = technique_.find_port(one.input);
      const Port* output = technique_.find_port(one.output);
      if (input == nullptr || output == nullptr || input->type != PortType::kValue ||
          output->type != PortType::kValue || input->direction != Direction::kIn ||
          output->direction != Direction::kOut || !is_touched(one.output, HEDDLE_LOOP_BEFORE)) {
        complain(fmt::format("its loop cannot override '{}' by '{}'", one.input, one.output), {},
                 "two values: an input, and an output that a stage HEDDLE_LOOP_BEFORE sets");
      }
    }
    for (const std::string& name : loop.gathers) {
      const Port* port = technique_.find_port(name);
      const bool has_memory = port != nullptr && (port->type == PortType::kImage || port->type == PortType::kBuffer);
      if (!has_memory || port->direction == Direction::kOut || !is_touched(name, HEDDLE_LOOP_AFTER)) {
        complain(fmt::format("its loop cannot gather '{}'", name), {},
                 "an image or buffer that goes in, and that a stage HEDDLE_LOOP_AFTER reads");
      }
    }
    for (const Stage& stage : technique_.stages) {
      if (stage.loop_part != HEDDLE_LOOP_AFTER) continue;
      for (const Access& access : stage.accesses) {
        const Port* port = technique_.find_port(access.port);
        if (port != nullptr && is_write(access.access) && port->direction == Direction::kOut && !port->is_kept()) {
          complain(fmt::format("stage '{}' gathers into '{}', which is not HEDDLE_PORT_KEPT", stage.name, access.port));
        }
      }
    }
  }

  [[nodiscard]] bool is_touched(std::string_view port, std::uint32_t loop_part) const {
    return std::any_of(technique_.stages.begin(), technique_.stages.end(), [&](const Stage& stage) {
      return stage.loop_part == loop_part && std::any_of(stage.accesses.begin(), stage.accesses.end(),
                                                         [&](const Access& access) { return access.port == port; });
    });
  }

  // What nobody writes would be handed on as garbage.
  void check_outputs() {
    for (const Port& port : technique_.ports) {
      if (port.direction != Direction::kIn && used_ports_.count(port.name) == 0) {
        complain(fmt::format("port '{}': no stage and no function touches this output", port.name));
      }
    }
  }

  const Technique& technique_;
  const Location& where_;
  std::vector<Diagnostic> broken_;
  std::set<std::string> port_names_, parameter_names_, stage_names_, shader_names_, function_roles_, used_ports_;
};

template <typename T>
const T* find_named(const std::vector<T>& things, std::string_view name) {
  const auto found = std::find_if(things.begin(), things.end(), [&](const T& thing) { return thing.name == name; });
  return found == things.end() ? nullptr : &*found;
}

}  // namespace

void complete_component_port(Port& port, const ComponentType& type) {
  port.types = component_glsl(type);
  port.glsl = fmt::format("{} {}[];", component_struct(type), port.name);
  if (port.help.empty()) port.help = type.title;
}

bool is_identifier(std::string_view name) {
  if (name.empty() || (name.front() >= '0' && name.front() <= '9') || name.starts_with("gl_")) return false;
  if (name.find("__") != std::string_view::npos) return false;  // reserved in GLSL
  return std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  });
}

bool is_technique_id(std::string_view id) {
  const std::size_t slash = id.find('/');
  return slash != std::string_view::npos && is_identifier(id.substr(0, slash)) && is_identifier(id.substr(slash + 1));
}

std::vector<std::string> split_words(std::string_view text) {
  std::vector<std::string> words;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(' '), text.size());
    if (end != 0) words.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return words;
}

std::vector<Diagnostic> broken_rules(const Technique& technique, const Location& where) {
  return Rules(technique, where).check();
}

const Port* Technique::find_port(std::string_view port) const {
  return find_named(ports, port);
}
const Parameter* Technique::find_parameter(std::string_view parameter) const {
  return find_named(parameters, parameter);
}
const Stage* Technique::find_stage(std::string_view stage) const {
  return find_named(stages, stage);
}
const Shader* Technique::find_shader(std::string_view shader) const {
  return find_named(shaders, shader);
}
const Function* Technique::find_function(std::string_view role) const {
  const auto found =
      std::find_if(functions.begin(), functions.end(), [&](const Function& f) { return f.role == role; });
  return found == functions.end() ? nullptr : &*found;
}

}  // namespace heddle
