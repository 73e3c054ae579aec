// SPDX-License-Identifier: Apache-2.0
// WrittenGraph + registry -> ResolvedGraph: names become roles, techniques, resources and providers. All mistakes are
// collected; what depends on something mistaken is left in peace, so that one cause makes one message.
#include "graph/resolve.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "graph/scene_ports.hpp"
#include "graph/uses.hpp"

namespace heddle::graph {
namespace {

constexpr std::string_view kPreviousSuffix = "@previous";

std::string_view type_word(PortType type) {
  constexpr std::array<std::string_view, 6> kWords{"an image", "a buffer",    "a value",
                                                   "surfaces", "an artifact", "a report"};
  return kWords.at(static_cast<std::size_t>(type));
}

/// A pass as written, and what became of it.
struct Entry {
  enum class Fate : std::uint8_t { kPresent, kLeftOut, kBroken };
  const WrittenPass* written = nullptr;
  Fate fate = Fate::kBroken;
  const Role* role = nullptr;  // also of passes that are left out
  TechniqueEntry technique;
  PassIndex pass = kNoIndex;  // kPresent only
  [[nodiscard]] const std::string& name() const { return text_of(written->name); }
};

/// What an input is bound to.
struct Source {
  enum class Kind : std::uint8_t { kResource, kAbsent, kUnknown };  // kUnknown: a message was made already
  Kind kind = Kind::kUnknown;
  ResourceIndex resource = kNoIndex;
};

class Resolver {
 public:
  Resolver(const WrittenGraph& written, const Registry& registry) : written_(written), registry_(registry) {}

  ResolvedGraph run() {
    graph_.is_job = is_job(written_);
    graph_.file = written_.file;
    graph_.folder = written_.folder;
    read_extent();
    for (const auto& [key, value] : written_.params) presets_.values[key.name] = &value;
    find_passes();
    make_outputs();
    for (std::size_t e = 0; e < entries_.size(); ++e)
      if (entries_[e].fate == Entry::Fate::kPresent) bind_inputs(e);
    check_branches();
    check_histories();
    check_kind();
    read_joins();
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      if (entries_[e].fate != Entry::Fate::kPresent) continue;
      bind_functions(e);
      Pass& pass = graph_.passes[entries_[e].pass];
      pass.parameters = read_parameters(*entries_[e].written, *entries_[e].technique.technique, presets_, problems_,
                                        graph_.notes, pass.origins);
    }
    check_presets();
    read_output();
    problems_.throw_if_any();
    for (ResourceIndex r = 0; r < graph_.resources.size(); ++r) take_shape(r);
    problems_.throw_if_any();
    for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
      graph_.passes[p].dependencies = find_dependencies(graph_, p);
      graph_.passes[p].past_dependencies = find_past_dependencies(graph_, p);
    }
    return std::move(graph_);
  }

 private:
  /// A file may bring presets that a swap makes useless; whoever sets one by hand means one that there is.
  void check_presets() {
    for (const auto& [key, value] : written_.params) {
      if (presets_.is_used[key.name]) continue;
      const auto means_it = [&](const auto& param) { return text_of(param.second) == "$" + key.name; };
      const bool is_meant = std::ranges::any_of(
          written_.passes, [&](const WrittenPass& pass) { return std::ranges::any_of(pass.params, means_it); });
      if (value.where.file != "--set" || is_meant) {
        graph_.notes.push_back(fmt::format("params.{} is used by no pass", key.name));
        continue;
      }
      std::vector<std::string> used;
      for (const auto& [name, is_used] : presets_.is_used)
        if (is_used) used.push_back(name);
      problems_.add(key.where, fmt::format("no pass uses a preset '{}'", key.name),
                    fmt::format("params.{} = {}", key.name, to_toml(value)),
                    used.empty() ? "a parameter of a pass: PASS.params.NAME" : "one of " + join_names(used),
                    did_you_mean(key.name, used));
    }
  }

  void read_extent() {
    graph_.width = graph_.is_job ? 0 : kDefaultWidth;
    graph_.height = graph_.is_job ? 0 : kDefaultHeight;
    if (!written_.extent) return;
    const auto* array = std::get_if<std::vector<Written>>(&written_.extent->value);
    const auto is_good = [](const Written& value) {
      const auto* number = std::get_if<std::int64_t>(&value.value);
      return number != nullptr && *number >= 1 && *number <= kLargestExtent;
    };
    if (array == nullptr || array->size() != 2 || !std::ranges::all_of(*array, is_good)) {
      problems_.add(written_.extent->where, "'extent' is no size of an image", "extent = " + to_toml(*written_.extent),
                    fmt::format("[width, height], two integers from 1 to {}", kLargestExtent));
      return;
    }
    graph_.width = static_cast<std::uint32_t>(std::get<std::int64_t>((*array)[0].value));
    graph_.height = static_cast<std::uint32_t>(std::get<std::int64_t>((*array)[1].value));
  }

  void find_passes() {
    std::vector<std::string> roles;
    for (const auto& [name, role] : registry_.roles()) roles.push_back(name);
    for (const WrittenPass& written : written_.passes) {
      Entry entry;
      entry.written = &written;
      if (const Entry* other = find_entry(entry.name())) {
        const Location& first = other->written->where;
        problems_.add(written.where, fmt::format("two passes are called '{}'", entry.name()), {}, {},
                      fmt::format("give this one a name of its own; the first is at {}:{}", first.file, first.line));
      }
      const std::string& role = text_of(written.role);
      const std::string& technique = text_of(written.technique);
      entry.role = registry_.find_role(role);
      const bool is_enabled = !written.enabled || std::get<bool>(written.enabled->value);
      if (entry.role == nullptr) {
        problems_.add(written.role.where, fmt::format("pass '{}': there is no role '{}'", entry.name(), role),
                      "role = " + to_toml(written.role),
                      roles.empty() ? "a role: no plugins were found" : "one of " + join_names(roles),
                      did_you_mean(role, roles));
      } else if (!is_enabled || technique == "none") {
        entry.fate = Entry::Fate::kLeftOut;
        graph_.notes.push_back(fmt::format("pass '{}': {}, its outputs are neutral", entry.name(),
                                           is_enabled ? "technique none" : "not enabled"));
      } else if (entry.technique = registry_.find(role + "/" + technique); entry.technique.technique == nullptr) {
        std::vector<std::string> names = registry_.technique_names(role);
        names.insert(names.begin(), "none");
        const auto left_out = registry_.left_out().find(role + "/" + technique);
        problems_.add(written.technique.where,
                      fmt::format("pass '{}': role '{}' has no technique '{}'", entry.name(), role, technique),
                      "technique = " + to_toml(written.technique), "one of " + join_names(names),
                      left_out == registry_.left_out().end() ? did_you_mean(technique, names) : left_out->second);
      } else {
        entry.fate = Entry::Fate::kPresent;
        entry.pass = static_cast<PassIndex>(graph_.passes.size());
        Pass pass;
        pass.name = entry.name();
        pass.where = written.where;
        pass.role = entry.role;
        pass.entry = entry.technique;
        for (const Written& served : written.serves) pass.serves.push_back(text_of(served));
        if (!pass.serves.empty() && entry.technique.technique->functions.empty())
          graph_.notes.push_back(fmt::format("pass '{}': 'serves' has no effect, '{}' provides no function", pass.name,
                                             entry.technique.technique->id));
        graph_.passes.push_back(std::move(pass));
      }
      entries_.push_back(entry);
    }
  }

  [[nodiscard]] const Entry* find_entry(std::string_view name) const {
    const auto found =
        std::ranges::find(entries_, name, [](const Entry& entry) -> std::string_view { return entry.name(); });
    return found == entries_.end() ? nullptr : &*found;
  }

  [[nodiscard]] std::vector<std::string> pass_names() const {
    std::vector<std::string> names;
    for (const Entry& entry : entries_) names.push_back(entry.name());
    return names;
  }

  /// Resources of the scene, then of every output, so that a reference may point below. Components that no pass reads
  /// are none.
  void make_outputs() {
    for (const ScenePort& port : kScenePorts)
      if (!graph_.is_job || port.is_in_jobs) scene_ports_.emplace_back(port.name, port.type);
    for (const Pass& pass : graph_.passes) {
      for (const Port& port : pass.entry.technique->ports) {
        const auto is_known = [&](const auto& known) { return known.first == port.name; };
        if (port.types.empty() || std::ranges::any_of(scene_ports_, is_known)) continue;
        scene_ports_.emplace_back(port.name, PortType::kValue);
      }
    }
    for (const auto& [name, type] : scene_ports_) {
      Resource resource;
      resource.name = "scene." + name;
      resource.type = type;
      resource.port = name;
      graph_.resources.push_back(std::move(resource));
    }
    for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
      Pass& pass = graph_.passes[p];
      for (const Port& port : pass.entry.technique->ports) {
        if (port.direction == Direction::kIn) continue;
        Resource resource;
        resource.name = pass.name + "." + port.name;
        resource.type = port.type;
        resource.producer = p;
        resource.port = port.name;
        resource.is_kept = port.is_kept();
        resource.flags = port.flags;
        resource.byte_size = port.byte_size;
        pass.ports[port.name] = static_cast<ResourceIndex>(graph_.resources.size());
        graph_.resources.push_back(std::move(resource));
      }
    }
  }

  static Source resource_source(ResourceIndex resource) { return {Source::Kind::kResource, resource}; }

  /// Last frame's version of a resource; made when it is first asked for.
  ResourceIndex history_of(ResourceIndex newest) {
    for (ResourceIndex r = 0; r < graph_.resources.size(); ++r)
      if (graph_.resources[r].history_of == newest) return r;
    Resource history = graph_.resources[newest];
    history.name += kPreviousSuffix;
    history.producer = kNoIndex;
    history.previous_version = kNoIndex;
    history.history_of = newest;
    history.is_kept = has_memory(history.type);
    if (history.name == "scene.camera@previous") history.byte_size = sizeof(HeddleView);
    graph_.resources.push_back(std::move(history));
    return static_cast<ResourceIndex>(graph_.resources.size() - 1);
  }

  /// The same for what an input is bound to. Whether it is kept is known when all passes are bound.
  Source history_source(std::string_view label, const Location& where, const std::string& found, Source source) {
    if (source.kind != Source::Kind::kResource) return source;
    const Resource& newest = graph_.resources[source.resource];
    if (newest.type == PortType::kSurfaces) {
      problems_.add(where, fmt::format("{}: surfaces have no history", label), found, "an image, a buffer or a value",
                    "a mesh carries its previous positions itself");
      return {};
    }
    const ResourceIndex history = history_of(source.resource);
    histories_.push_back({history, where, std::string(label), found});
    return resource_source(history);
  }

  /// Only what is kept is there in the next frame.
  void check_histories() {
    for (const AskedHistory& asked : histories_) {
      const ResourceIndex newest = graph_.resources[asked.history].history_of;
      if (!has_memory(graph_.resources[newest].type) || is_kept(graph_, newest)) continue;
      std::string kept;
      for (ResourceIndex r = 0; r < graph_.resources.size(); ++r) {
        const Resource& resource = graph_.resources[r];
        if (resource.history_of == kNoIndex && has_memory(resource.type) && is_kept(graph_, r))
          kept += fmt::format("{}'{}'", kept.empty() ? "" : ", ", resource.name);
      }
      const Resource& resource = graph_.resources[newest];
      problems_.add(asked.where, fmt::format("{}: '{}' has no history", asked.label, resource.name), asked.found,
                    kept.empty() ? "an output that its technique keeps from frame to frame: this graph has none"
                                 : fmt::format("an output that its technique keeps from frame to frame: {}", kept),
                    fmt::format("'{}' does not keep its '{}' (HEDDLE_PORT_KEPT), so the memory holds something else by "
                                "the next frame",
                                graph_.passes[resource.producer].entry.technique->id, resource.port));
    }
  }

  /// The last producer above, else the scene. A broken pass above may be the producer: then nothing is said.
  [[nodiscard]] Source default_source(std::size_t entry, std::string_view port) const {
    for (std::size_t e = entry; e-- > 0;) {
      const Entry& above = entries_[e];
      const RolePort* contract = above.role != nullptr ? above.role->find_port(port) : nullptr;
      const bool makes = contract != nullptr && contract->direction != Direction::kIn;
      if (above.fate == Entry::Fate::kBroken && (above.role == nullptr || makes)) return {};
      // A technique's own outputs, beyond its role's contract, are nobody's business unless named.
      if (above.fate != Entry::Fate::kPresent || !makes) continue;
      const auto& ports = graph_.passes[above.pass].ports;
      const Port* made = above.technique.technique->find_port(port);
      if (made == nullptr || made->direction == Direction::kIn) continue;
      return resource_source(ports.find(port)->second);
    }
    for (ResourceIndex r = 0; r < scene_ports_.size(); ++r)
      if (scene_ports_[r].first == port) return resource_source(r);
    return {Source::Kind::kAbsent, kNoIndex};
  }

  /// inputs.PORT = "pass.port" | "scene.x" | "none"; the first two also with "@previous".
  Source named_source(std::string_view label, const Written& value) {
    const std::string& written = text_of(value);
    const auto at = written.find('@');
    const Source source = newest_source(label, value, written.substr(0, at));
    if (at == std::string::npos) return source;
    if (written.substr(at) != kPreviousSuffix) {
      problems_.add(value.where, fmt::format("{}: there is no version '{}'", label, written.substr(at + 1)),
                    to_toml(value), fmt::format("\"{}@previous\", last frame's", written.substr(0, at)));
      return {};
    }
    return history_source(label, value.where, to_toml(value), source);
  }

  /// "links.toml#links": an artifact of a job, by its port or by pass and port.
  Source job_source(std::string_view label, const Written& value, const std::string& text) {
    const auto hash = text.find('#');
    const std::string file = text.substr(0, hash);
    const std::string name = text.substr(hash + 1);
    const auto job = find_job(label, value, file);
    if (!job) return {};
    const ResolvedGraph& graph = *graph_.jobs[*job].graph;
    std::vector<std::string> names;
    std::vector<const Resource*> meant;
    for (const Resource& resource : graph.resources) {
      if (resource.type != PortType::kArtifact || resource.producer == kNoIndex) continue;
      names.push_back(resource.name);
      if (resource.name == name || resource.port == name) meant.push_back(&resource);
    }
    if (meant.size() != 1) {
      problems_.add(value.where,
                    meant.empty() ? fmt::format("{}: the job '{}' makes no artifact '{}'", label, graph.file, name)
                                  : fmt::format("{}: {} passes of the job '{}' make an artifact '{}'", label,
                                                meant.size(), graph.file, name),
                    to_toml(value), names.empty() ? "a job that makes artifacts" : "one of " + join_names(names),
                    meant.empty() ? did_you_mean(name, names) : std::string{});
      return {};
    }
    for (ResourceIndex r = 0; r < graph_.resources.size(); ++r)
      if (graph_.resources[r].job == *job && graph_.resources[r].job_resource == meant.front()->name)
        return resource_source(r);
    Resource resource;
    resource.name = file + "#" + meant.front()->name;
    resource.type = PortType::kArtifact;
    resource.port = meant.front()->port;
    resource.job = *job;
    resource.job_resource = meant.front()->name;
    graph_.resources.push_back(std::move(resource));
    return resource_source(static_cast<ResourceIndex>(graph_.resources.size() - 1));
  }

  /// Resolved when it is first named; what is wrong in it is told once.
  std::optional<std::uint32_t> find_job(std::string_view label, const Written& value, const std::string& file) {
    const auto known = std::ranges::find(graph_.jobs, file, &GraphJob::file);
    if (known != graph_.jobs.end()) return static_cast<std::uint32_t>(known - graph_.jobs.begin());
    const auto written = written_.jobs.find(file);
    if (written == written_.jobs.end()) {
      if (file.empty())
        problems_.add(value.where, fmt::format("{} names no job", label), to_toml(value), "\"job.toml#artifact\"");
      return std::nullopt;
    }
    if (!broken_jobs_.insert(file).second) return std::nullopt;
    try {
      graph_.jobs.push_back({file, std::make_shared<const ResolvedGraph>(resolve(*written->second, registry_))});
    } catch (const Error& error) {
      problems_.add(error.diagnostics());
      return std::nullopt;
    }
    broken_jobs_.erase(file);
    const ResolvedGraph& job = *graph_.jobs.back().graph;
    for (const std::string& note : job.notes) graph_.notes.push_back(fmt::format("job '{}': {}", file, note));
    graph_.warnings.insert(graph_.warnings.end(), job.warnings.begin(), job.warnings.end());
    return static_cast<std::uint32_t>(graph_.jobs.size() - 1);
  }

  /// What jobs alone may make, and what they may not ask for.
  void check_kind() {
    bool leaves_something = written_.output.has_value();
    for (const Pass& pass : graph_.passes) {
      const Technique& technique = *pass.entry.technique;
      const bool is_lasting = makes_what_lasts(technique);
      leaves_something = leaves_something || is_lasting;
      if (!graph_.is_job) {
        if (is_lasting)
          problems_.add(
              pass.where,
              fmt::format("pass '{}': what '{}' makes is made once, in a job, and this graph is one of frames",
                          pass.name, technique.id),
              {}, "a file of its own with kind = \"job\"",
              "an input names the file and what it makes: inputs.PORT = \"job.toml#artifact\"");
        continue;
      }
      for (const Stage& stage : technique.stages)
        if (stage.latency > 0)
          problems_.add(pass.where,
                        fmt::format("pass '{}': stage '{}' of '{}' reads what was made {} frames ago, and a job "
                                    "has no frames",
                                    pass.name, stage.name, technique.id, stage.latency));
      if (!is_lasting) continue;
      for (const Pass& reader : graph_.passes) {
        for (const auto* ports : {&reader.ports, &reader.inout_sources}) {
          for (const auto& [port, bound] : *ports) {
            const Resource& resource = graph_.resources[bound];
            if (&reader == &pass || resource.producer == kNoIndex || &graph_.passes[resource.producer] != &pass ||
                lasts(resource.type))
              continue;
            problems_.add(reader.where,
                          fmt::format("pass '{}': its input '{}' is '{}', which is no artifact of '{}'", reader.name,
                                      port, resource.name, pass.name),
                          {}, "an artifact: the pass does not run where those are there already",
                          "let a pass before it make what both need");
          }
        }
      }
    }
    if (graph_.is_job && !leaves_something)
      problems_.add({written_.file, 0, 0}, "the job leaves nothing", {}, "a pass that makes an artifact or a report",
                    "or output = \"pass.port\", an image");
  }

  Source newest_source(std::string_view label, const Written& value, const std::string& text) {
    const auto found = fmt::format("{}", to_toml(value));
    if (text == "none") return {Source::Kind::kAbsent, kNoIndex};
    if (text.find('#') != std::string::npos) return job_source(label, value, text);
    const auto dot = text.find('.');
    if (dot == std::string::npos || dot == 0 || dot + 1 == text.size() ||
        text.find('.', dot + 1) != std::string::npos) {
      problems_.add(value.where, fmt::format("{} does not name a port", label), found,
                    "\"pass.port\", \"scene.camera\", \"scene.environment\", \"scene.light_textures\", "
                    "\"scene.lights\", \"scene.surfaces\", \"job.toml#artifact\" or \"none\"");
      return {};
    }
    const std::string pass = text.substr(0, dot);
    const std::string port = text.substr(dot + 1);
    if (pass == "scene") {
      std::vector<std::string> names;
      for (ResourceIndex r = 0; r < scene_ports_.size(); ++r) {
        if (scene_ports_[r].first == port) return resource_source(r);
        names.push_back(scene_ports_[r].first);
      }
      problems_.add(value.where,
                    graph_.is_job && port == "camera" ? fmt::format("{}: a job has no camera", label)
                                                      : fmt::format("{}: the scene has no '{}'", label, port),
                    found, "one of " + join_names(names), did_you_mean(port, names));
      return {};
    }
    const Entry* entry = find_entry(pass);
    if (entry == nullptr) {
      std::vector<std::string> names = pass_names();
      names.emplace_back("scene");
      problems_.add(value.where, fmt::format("{}: there is no pass '{}'", label, pass), found,
                    "one of " + join_names(names), did_you_mean(pass, names));
      return {};
    }
    if (entry->fate == Entry::Fate::kBroken) return {};
    const RolePort* contract = entry->role->find_port(port);
    const bool is_present = entry->fate == Entry::Fate::kPresent;
    if (!is_present || entry->technique.technique->find_port(port) == nullptr) {
      // Nobody changed it: whoever asks for the changed one gets what would have been changed.
      if (contract != nullptr && contract->direction == Direction::kInout)
        return default_source(static_cast<std::size_t>(entry - entries_.data()), port);
      if (!is_present) return {Source::Kind::kAbsent, kNoIndex};
    }
    const auto& ports = graph_.passes[entry->pass].ports;
    const Port* made = entry->technique.technique->find_port(port);
    if (made != nullptr && made->direction != Direction::kIn) return resource_source(ports.find(port)->second);
    std::vector<std::string> names;
    for (const Port& candidate : entry->technique.technique->ports)
      if (candidate.direction != Direction::kIn) names.push_back(candidate.name);
    problems_.add(value.where, fmt::format("{}: pass '{}' has no output '{}'", label, pass, port), found,
                  names.empty() ? "another pass: this one has no outputs" : "one of " + join_names(names),
                  did_you_mean(port, names));
    return {};
  }

  void bind_inputs(std::size_t e) {
    const Entry& entry = entries_[e];
    Pass& pass = graph_.passes[entry.pass];
    const Technique& technique = *entry.technique.technique;
    std::vector<std::string> inputs;
    for (const Port& port : technique.ports)
      if (port.direction != Direction::kOut) inputs.push_back(port.name);

    std::map<std::string, const Written*, std::less<>> said;
    for (const auto& [key, value] : entry.written->inputs) {
      if (std::ranges::find(inputs, key.name) != inputs.end()) {
        said[key.name] = &value;
      } else if (!key.written_for.empty()) {
        graph_.notes.push_back(
            fmt::format("pass '{}': inputs.{} was written for '{}' and is left out: '{}' has no such input", pass.name,
                        key.name, key.written_for, technique.name()));
      } else {
        const bool is_output = technique.find_port(key.name) != nullptr;
        problems_.add(
            key.where,
            is_output ? fmt::format("pass '{}': '{}' is an output of '{}'", pass.name, key.name, technique.id)
                      : fmt::format("pass '{}': technique '{}' has no input '{}'", pass.name, technique.id, key.name),
            fmt::format("inputs.{} = {}", key.name, to_toml(value)),
            inputs.empty() ? "no inputs" : "one of " + join_names(inputs), did_you_mean(key.name, inputs));
      }
    }

    for (const Port& port : technique.ports) {
      if (port.direction == Direction::kOut) continue;
      const auto given = said.find(port.name);
      const std::string label = fmt::format("pass '{}': inputs.{}", pass.name, port.name);
      Source source = given != said.end()        ? named_source(label, *given->second)
                      : port.previous_of.empty() ? default_source(e, port.name)
                                                 : resource_source(history_of(pass.ports.at(port.previous_of)));
      if (source.kind == Source::Kind::kUnknown) continue;
      if (source.kind == Source::Kind::kAbsent) {
        if (!port.is_optional()) report_missing(e, port, given == said.end() ? nullptr : given->second);
        continue;
      }
      const Resource& resource = graph_.resources[source.resource];
      if (resource.type != port.type) {
        problems_.add(given == said.end() ? pass.where : given->second->where,
                      fmt::format("pass '{}': input '{}' is {}, but '{}' is {}", pass.name, port.name,
                                  type_word(port.type), resource.name, type_word(resource.type)),
                      given == said.end() ? std::string{} : to_toml(*given->second),
                      fmt::format("a port that is {}", type_word(port.type)),
                      given == said.end() ? fmt::format("write inputs.{} = \"pass.port\"", port.name) : std::string{});
        continue;
      }
      if (resource.is_list() != port.is_list()) {
        const auto word = [](bool is_list) { return is_list ? "a list" : "a buffer of fixed length"; };
        problems_.add(given == said.end() ? pass.where : given->second->where,
                      fmt::format("pass '{}': input '{}' is {}, but '{}' is {}", pass.name, port.name,
                                  word(port.is_list()), resource.name, word(resource.is_list())),
                      given == said.end() ? std::string{} : to_toml(*given->second),
                      fmt::format("a port that is {}", word(port.is_list())),
                      given == said.end() ? fmt::format("write inputs.{} = \"pass.port\"", port.name) : std::string{});
        continue;
      }
      warn_of_units(e, port.name, resource, given == said.end() ? nullptr : given->second);
      if (port.direction == Direction::kIn) {
        pass.ports[port.name] = source.resource;
      } else if (resource.history_of != kNoIndex) {
        problems_.add(
            given->second->where,
            fmt::format("pass '{}': '{}' cannot change what was made in an earlier frame", pass.name, port.name),
            to_toml(*given->second), fmt::format("\"{}\"", graph_.resources[resource.history_of].name));
      } else if (resource.producer == entry.pass) {
        problems_.add(given->second->where,
                      fmt::format("pass '{}': '{}' cannot change what it makes itself", pass.name, port.name),
                      to_toml(*given->second));
      } else {
        pass.inout_sources[port.name] = source.resource;
        graph_.resources[pass.ports[port.name]].previous_version = source.resource;
      }
    }
  }

  /// Roles say what an image's numbers mean. Other units than the input's are no error: that is how numbers are looked
  /// at.
  void warn_of_units(std::size_t e, const std::string& port, const Resource& resource, const Written* given) {
    if (resource.type != PortType::kImage || resource.producer == kNoIndex) return;
    const auto unit_of = [&](const Resource& made) -> std::string {
      const RolePort* contract = graph_.passes[made.producer].role->find_port(made.port);
      return contract == nullptr ? std::string{} : contract->unit;
    };
    const auto words = [](const std::string& unit) { return unit == "1" ? "without unit" : "in " + unit; };
    const RolePort* contract = entries_[e].role->find_port(port);
    const std::string made = unit_of(resource);
    if (contract == nullptr || contract->unit.empty() || made.empty() || contract->unit == made) return;
    const Source usual = default_source(e, port);
    const bool suits = usual.kind == Source::Kind::kResource && graph_.resources[usual.resource].producer != kNoIndex &&
                       unit_of(graph_.resources[usual.resource]) == contract->unit;
    graph_.warnings.push_back(
        {Severity::kWarning, given != nullptr ? given->where : entries_[e].written->where,
         fmt::format("pass '{}': input '{}' is {}, but '{}' is {}", entries_[e].name(), port, words(contract->unit),
                     resource.name, words(made)),
         given != nullptr ? fmt::format("inputs.{} = {}", port, to_toml(*given)) : std::string{},
         "a port " + words(contract->unit),
         suits ? fmt::format("'{}' is one", graph_.resources[usual.resource].name) : std::string{}});
  }

  /// "a port without producer": who could make it, and whether somebody below does.
  void report_missing(std::size_t e, const Port& port, const Written* given) {
    const Entry& entry = entries_[e];
    std::string help;
    std::string expected = fmt::format("an output '{}' of a pass above", port.name);
    if (graph_.is_job && port.name == "camera" && given == nullptr) {
      problems_.add(entry.written->where,
                    fmt::format("pass '{}': '{}' needs the frame's camera, and a job has none", entry.name(),
                                entry.technique.technique->id),
                    {}, "a technique that needs no camera, or inputs.camera = \"pass.camera\"",
                    "a job bakes, encodes or inspects; what renders from a camera belongs into a graph of frames");
      return;
    }
    if (port.type == PortType::kArtifact && given == nullptr) {
      problems_.add(entry.written->where,
                    fmt::format("pass '{}': nothing makes its input '{}', an artifact", entry.name(), port.name), {},
                    fmt::format("inputs.{} = \"job.toml#{}\"", port.name, port.name));
      return;
    }
    const auto makes = [&](const Role& role) {
      const RolePort* contract = role.find_port(port.name);
      return contract != nullptr && contract->direction == Direction::kOut && contract->type == port.type;
    };
    if (given != nullptr && text_of(*given) == "none") {
      help = "this input is not optional";
    } else {
      for (std::size_t other = 0; other < entries_.size() && help.empty(); ++other) {
        const Entry& candidate = entries_[other];
        if (other == e || candidate.role == nullptr || !makes(*candidate.role)) continue;
        if (candidate.fate == Entry::Fate::kLeftOut)
          help = fmt::format("pass '{}' could make it, but is left out: give it a technique", candidate.name());
        else if (candidate.fate == Entry::Fate::kPresent && other > e)
          help = fmt::format("pass '{0}' below makes it: move it up, or write inputs.{1} = \"{0}.{1}\"",
                             candidate.name(), port.name);
      }
      if (help.empty()) {
        std::vector<std::string> roles;
        for (const auto& [name, role] : registry_.roles())
          if (makes(role)) roles.push_back(name);
        help = roles.empty() ? "no role that is installed makes it"
                             : "a pass of one of these roles makes it: " + join_names(roles);
      }
    }
    problems_.add(given != nullptr ? given->where : entry.written->where,
                  fmt::format("pass '{}': nothing makes its input '{}'", entry.name(), port.name),
                  given != nullptr ? fmt::format("inputs.{} = {}", port.name, to_toml(*given)) : std::string{},
                  expected, help);
  }

  /// Images and buffers change in place, so only one pass can change a version; and a chain of changes has an end.
  void check_branches() {
    std::map<ResourceIndex, PassIndex> changed;
    for (PassIndex p = 0; p < graph_.passes.size(); ++p) {
      for (const auto& [port, source] : graph_.passes[p].inout_sources) {
        if (!has_memory(graph_.resources[source].type)) continue;
        const auto [first, is_new] = changed.emplace(source, p);
        if (!is_new) {
          const Pass& pass = graph_.passes[p];
          const Pass& other = graph_.passes[first->second];
          problems_.add(pass.where,
                        fmt::format("passes '{}' and '{}' both change '{}' in place", other.name, pass.name,
                                    graph_.resources[source].name),
                        {}, {},
                        fmt::format("write inputs.{} = \"{}\" here, so that this one comes after the other", port,
                                    made_from(other, source)));
        }
      }
    }
    for (ResourceIndex r = 0; r < graph_.resources.size(); ++r) {
      ResourceIndex slow = r;
      for (ResourceIndex fast = r; fast != kNoIndex && graph_.resources[fast].previous_version != kNoIndex;) {
        fast = graph_.resources[graph_.resources[fast].previous_version].previous_version;
        slow = graph_.resources[slow].previous_version;
        if (fast != slow) continue;
        const Resource& resource = graph_.resources[r];
        problems_.add(graph_.passes[resource.producer].where,
                      fmt::format("'{}' is changed in a circle: no pass makes it first", resource.name));
        problems_.throw_if_any();  // everything after walks the chain
      }
    }
  }

  [[nodiscard]] std::string made_from(const Pass& pass, ResourceIndex source) const {
    for (const auto& [port, resource] : pass.inout_sources)
      if (resource == source) return graph_.resources[pass.ports.find(port)->second].name;
    return {};
  }

  void read_joins() {
    constexpr std::array<std::string_view, 3> kWords{"switch", "sum", "product"};
    std::vector<std::string> roles;
    for (const auto& [name, role] : registry_.roles())
      if (!role.functions.empty()) roles.push_back(name);
    for (const auto& [key, value] : written_.joins) {
      if (std::ranges::find(roles, key.name) == roles.end())
        problems_.add(key.where, fmt::format("no role '{}' has functions to join", key.name),
                      fmt::format("joins.{} = {}", key.name, to_toml(value)),
                      roles.empty() ? "no joins" : "one of " + join_names(roles), did_you_mean(key.name, roles));
      const auto word = std::ranges::find(kWords, text_of(value));
      if (word == kWords.end()) {
        const std::vector<std::string> words(kWords.begin(), kWords.end());
        problems_.add(value.where, fmt::format("'{}' is no way to join functions", text_of(value)),
                      fmt::format("joins.{} = {}", key.name, to_toml(value)), "one of " + join_names(words),
                      did_you_mean(text_of(value), words));
        continue;
      }
      joins_[key.name] = static_cast<Join>(word - kWords.begin());
    }
  }

  void bind_functions(std::size_t e) {
    const Entry& entry = entries_[e];
    Pass& pass = graph_.passes[entry.pass];
    const Technique& technique = *entry.technique.technique;
    const std::vector<std::string> calls = all_calls(technique);
    for (const auto& [key, value] : entry.written->functions) {
      if (std::ranges::find(calls, key.name) != calls.end()) continue;
      if (!key.written_for.empty()) {
        graph_.notes.push_back(
            fmt::format("pass '{}': functions.{} was written for '{}' and is left out: '{}' does not call it",
                        pass.name, key.name, key.written_for, technique.name()));
        continue;
      }
      problems_.add(
          key.where,
          fmt::format("pass '{}': technique '{}' calls no functions of role '{}'", pass.name, technique.id, key.name),
          fmt::format("functions.{} = {}", key.name, to_toml(value)),
          calls.empty() ? "no functions" : "one of " + join_names(calls), did_you_mean(key.name, calls));
    }
    for (const std::string& name : calls) {
      const Role* role = registry_.find_role(name);
      if (role == nullptr) {
        problems_.add(entry.written->technique.where,
                      fmt::format("pass '{}': technique '{}' calls functions of role '{}', which is not installed",
                                  pass.name, technique.id, name));
        continue;
      }
      FunctionBinding binding;
      binding.role = name;
      const auto join = joins_.find(name);
      binding.join = join != joins_.end() ? join->second : role->join;
      const auto said = std::ranges::find(entry.written->functions, name,
                                          [](const auto& f) -> const std::string& { return f.first.name; });
      if (said == entry.written->functions.end()) {
        for (std::size_t above = 0; above < e; ++above)
          if (entries_[above].fate == Entry::Fate::kPresent && provides(entries_[above], name))
            binding.providers.push_back(entries_[above].pass);
      } else {
        name_providers(entry, name, std::get<std::vector<Written>>(said->second.value), binding);
      }
      if (binding.join == Join::kSwitch && role->selector.empty() && binding.providers.size() > 1)
        problems_.add(entry.written->where,
                      fmt::format("pass '{}': {} passes answer '{}', and nothing chooses between them", pass.name,
                                  binding.providers.size(), name),
                      {}, "one provider, or a sum or product",
                      fmt::format("write functions.{0} = [\"{1}\"], or joins.{0} = \"sum\"", name,
                                  graph_.passes[binding.providers.back()].name));
      pass.functions.push_back(std::move(binding));
    }
  }

  static bool provides(const Entry& entry, std::string_view role) {
    return entry.technique.technique->find_function(role) != nullptr;
  }

  void name_providers(const Entry& caller, const std::string& role, const std::vector<Written>& names,
                      FunctionBinding& binding) {
    std::vector<std::string> candidates;
    for (const Entry& entry : entries_)
      if (&entry != &caller && entry.role != nullptr &&
          (entry.role->name == role || (entry.fate == Entry::Fate::kPresent && provides(entry, role))))
        candidates.push_back(entry.name());
    for (const Written& name : names) {
      const Entry* entry = find_entry(text_of(name));
      if (entry != nullptr && entry->fate == Entry::Fate::kBroken) continue;
      if (std::ranges::find(candidates, text_of(name)) == candidates.end()) {
        problems_.add(
            name.where,
            fmt::format("pass '{}': no pass '{}' provides functions of role '{}'", caller.name(), text_of(name), role),
            to_toml(name),
            candidates.empty() ? fmt::format("a pass of role '{}'", role) : "one of " + join_names(candidates),
            did_you_mean(text_of(name), candidates));
        continue;
      }
      if (entry->fate != Entry::Fate::kPresent) continue;
      if (std::ranges::find(binding.providers, entry->pass) != binding.providers.end()) {
        problems_.add(name.where,
                      fmt::format("pass '{}': '{}' is named twice for role '{}'", caller.name(), text_of(name), role),
                      to_toml(name));
        continue;
      }
      if (!provides(*entry, role)) {
        problems_.add(name.where,
                      fmt::format("pass '{}': technique '{}' of pass '{}' provides no function of role '{}'",
                                  caller.name(), entry->technique.technique->id, entry->name(), role),
                      to_toml(name));
        continue;
      }
      binding.providers.push_back(entry->pass);
    }
  }

  void read_output() {
    if (!written_.output && graph_.is_job) return;
    if (!written_.output) {
      std::vector<std::string> images;
      for (const Resource& resource : graph_.resources)
        if (resource.type == PortType::kImage) images.push_back(resource.name);
      problems_.add({written_.file, 0, 0}, "the graph says no output", {}, "output = \"pass.port\", an image",
                    images.empty() ? std::string{} : fmt::format("for instance output = \"{}\"", images.back()));
      return;
    }
    const Source source = named_source("'output'", *written_.output);
    if (source.kind == Source::Kind::kUnknown) return;
    const std::string found = "output = " + to_toml(*written_.output);
    if (source.kind == Source::Kind::kResource && graph_.resources[source.resource].history_of != kNoIndex) {
      problems_.add(written_.output->where, "the graph's output is what this frame makes", found,
                    fmt::format("\"{}\"", graph_.resources[graph_.resources[source.resource].history_of].name));
      return;
    }
    if (source.kind == Source::Kind::kAbsent) {
      problems_.add(written_.output->where, "nothing makes the graph's output", found,
                    "an image of a pass that is not left out");
      return;
    }
    const PortType type = graph_.resources[source.resource].type;
    if (type != PortType::kImage && !(graph_.is_job && lasts(type))) {
      problems_.add(
          written_.output->where,
          fmt::format("the graph's output '{}' is {}", graph_.resources[source.resource].name, type_word(type)), found,
          graph_.is_job ? "an artifact, a report or an image" : "an image");
      return;
    }
    graph_.output = source.resource;
  }

  /// Extent and format from the descriptor; a changed version is shaped as what it changes.
  void take_shape(ResourceIndex index) {
    Resource& resource = graph_.resources[index];
    const ResourceIndex shaped = resource.history_of != kNoIndex ? resource.history_of : index;
    if (graph_.resources[shaped].producer == kNoIndex || !has_memory(resource.type)) return;
    const ResourceIndex first = first_version(graph_, shaped);
    const Resource& made = graph_.resources[first];
    const Pass& pass = graph_.passes[made.producer];
    const Port& port = *pass.entry.technique->find_port(made.port);
    resource.byte_size = port.byte_size;
    if (port.is_list()) {
      resource.capacity = port.capacity;
      resource.element_bytes = port.element_bytes;
      resource.byte_size = list_bytes(port.capacity, port.element_bytes);
    }
    if (resource.type == PortType::kBuffer) return;
    const auto scaled = [&](std::uint32_t size) {
      // Rounded up; the small step back keeps exact products of float32 scales exact.
      if (size == 0) return std::int64_t{0};  // a job that says none: declare may
      const double scale = port.extent_scale > 0 ? static_cast<double>(port.extent_scale) : 1.0;
      return static_cast<std::int64_t>(std::max(1.0, std::ceil(size * scale - 1e-6)));
    };
    const std::int64_t width = port.extent_rule == HEDDLE_EXTENT_ABSOLUTE ? port.width : scaled(graph_.width);
    const std::int64_t height = port.extent_rule == HEDDLE_EXTENT_ABSOLUTE ? port.height : scaled(graph_.height);
    if (width > kLargestExtent || height > kLargestExtent) {
      if (first == index)
        problems_.add(pass.where, fmt::format("'{}' would be too large", resource.name),
                      fmt::format("{} x {} pixels", width, height), fmt::format("at most {0} x {0}", kLargestExtent),
                      "make 'extent' smaller");
      return;
    }
    resource.format = port.format;
    resource.width = static_cast<std::uint32_t>(width);
    resource.height = static_cast<std::uint32_t>(height);
    resource.layers = std::max(port.layers, 1U);
    resource.flags |= port.flags & HEDDLE_PORT_CUBE;
    std::uint32_t chain = 1;
    while ((std::max(resource.width, resource.height) >> chain) > 0) ++chain;
    resource.mips = std::clamp(port.mips, 1U, chain);
  }

  const WrittenGraph& written_;
  const Registry& registry_;
  Problems problems_;
  std::vector<std::pair<std::string, PortType>> scene_ports_;  // in the order of their resources
  ResolvedGraph graph_;
  std::vector<Entry> entries_;
  Presets presets_;
  std::set<std::string> broken_jobs_;
  std::map<std::string, Join, std::less<>> joins_;
  struct AskedHistory {
    ResourceIndex history = kNoIndex;
    Location where;
    std::string label, found;
  };
  std::vector<AskedHistory> histories_;
};

}  // namespace

ResolvedGraph resolve(const WrittenGraph& written, const Registry& registry) {
  return Resolver(written, registry).run();
}

ResourceIndex find_resource(const ResolvedGraph& graph, std::string_view name) {
  std::vector<std::string> names;
  for (ResourceIndex r = 0; r < graph.resources.size(); ++r) {
    if (graph.resources[r].name == name) return r;
    names.push_back(graph.resources[r].name);
  }
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                           {graph.file, 0, 0},
                                           fmt::format("the graph has no port '{}'", name),
                                           {},
                                           "one of " + join_names(names),
                                           did_you_mean(name, names)});
}

}  // namespace heddle::graph
