// SPDX-License-Identifier: Apache-2.0
// Calls cpu stages. What those with cached_by make is taken from the artifact cache where it was made before.

#include "graph/execute_state.hpp"

#include "content_hash.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>

namespace heddle::graph {

namespace {

/// Raised where an artifact of before would be taken for what is made now.
constexpr std::string_view kKeyFormat = "heddle artifact key 1";

template <typename T>
void add_number(ContentHash& hash, const T& number) {
  static_assert(std::is_arithmetic_v<T>);
  hash.add({reinterpret_cast<const char*>(&number), sizeof number});
}

/// While it lives, a stage sees an environment whose place in the scene says nothing: that is no part of its key.
class UnplacedEnvironment {
 public:
  explicit UnplacedEnvironment(Value* value) : value_(value) {
    if (value_ == nullptr) return;
    std::memcpy(&placed_, value_->bytes.data(), sizeof placed_);
    HeddleEnvironment plain{};
    plain.rotation[3] = 1.0F;
    plain.scale = 1.0F;
    plain.width = placed_.width;
    plain.height = placed_.height;
    std::memcpy(value_->bytes.data(), &plain, sizeof plain);
  }
  ~UnplacedEnvironment() {
    if (value_ != nullptr) std::memcpy(value_->bytes.data(), &placed_, sizeof placed_);
  }
  UnplacedEnvironment(const UnplacedEnvironment&) = delete;
  UnplacedEnvironment& operator=(const UnplacedEnvironment&) = delete;

 private:
  Value* value_;
  HeddleEnvironment placed_{};
};

heddle_frame_info timeless() {
  heddle_frame_info info{};
  info.struct_size = sizeof info;
  info.cut = 1;
  return info;
}

}  // namespace

void Executor::State::warn(const Pass& pass, std::string_view message) const {
  Diagnostic diagnostic;
  diagnostic.severity = Severity::kWarning;
  diagnostic.where = pass.where;
  diagnostic.message = fmt::format("pass '{}' ({}): {}", pass.name, pass.entry.technique->id, message);
  services.log(Severity::kWarning, to_text(diagnostic));
}

std::string Executor::State::artifact_key(const PassState& state, const ScheduledStage& scheduled,
                                          const heddle_frame& frame) {
  const Pass& pass = pass_of(state);
  const Technique& technique = technique_of(state);
  const Stage& stage = technique.stages[scheduled.stage];
  ContentHash hash;
  hash.add(kKeyFormat);
  hash.add(technique.id);
  hash.add(state.library->content_hash());
  hash.add(stage.name);
  for (std::size_t i = 0; i < technique.parameters.size(); ++i) {
    const Parameter& parameter = technique.parameters[i];
    if (std::ranges::find(*stage.cached_by, parameter.name) == stage.cached_by->end()) continue;
    hash.add(parameter.name);
    for (const double number : pass.parameters[i].number) add_number(hash, number);
    add_number(hash, pass.parameters[i].names.size());
    for (const std::string& name : pass.parameters[i].names) hash.add(name);
  }
  for (const Access& access : stage.accesses) {
    hash.add(access.port);
    const auto bound = pass.ports.find(access.port);
    if (bound == pass.ports.end()) continue;
    const Resource& resource = graph.resources[bound->second];
    for (const std::uint32_t number : {resource.format, resource.width, resource.height, resource.layers, resource.mips,
                                       static_cast<std::uint32_t>(resource.type), access.access})
      add_number(hash, number);
    add_number(hash, resource.byte_size);
    if (technique.find_port(access.port)->direction != Direction::kIn) continue;
    if (resource.type == PortType::kValue || lasts(resource.type)) {
      hash.add_long(resources[bound->second].value.bytes);
    } else {
      const auto mapping = std::ranges::find(frame.mappings, access.port, &heddle_frame::Mapping::port);
      if (mapping != frame.mappings.end()) hash.add_long({mapping->staging.data(), mapping->staging.size()});
    }
  }
  return hash.hexadecimal();
}

bool Executor::State::take_artifact(const ArtifactParts& parts, PassState& state, const ScheduledStage& scheduled,
                                    heddle_frame& frame) {
  const Pass& pass = pass_of(state);
  // Sizes are part of the key; of values only the most that they hold.
  for (const heddle_frame::Mapping& mapping : frame.mappings) {
    const auto part = parts.find(mapping.port);
    if (mapping.is_written && (part == parts.end() || part->second.size() != mapping.staging.size())) return false;
  }
  for (const heddle_frame::Mapping& mapping : frame.mappings)
    if (mapping.is_written)
      std::memcpy(mapping.staging.data(), parts.find(mapping.port)->second.data(), mapping.staging.size());
  for (const Access& access : technique_of(state).stages[scheduled.stage].accesses) {
    const auto part = parts.find(access.port);
    if (access.access == HEDDLE_ACCESS_VALUE && part != parts.end())
      set_value(pass.ports.at(access.port), part->second);
  }
  return true;
}

ArtifactViews Executor::State::made_parts(const PassState& state, const ScheduledStage& scheduled,
                                          const heddle_frame& frame) {
  const Pass& pass = pass_of(state);
  const Technique& technique = technique_of(state);
  ArtifactViews parts;
  for (const heddle_frame::Mapping& mapping : frame.mappings)
    if (mapping.is_written) parts[mapping.port] = {mapping.staging.data(), mapping.staging.size()};
  for (const Access& access : technique.stages[scheduled.stage].accesses) {
    const auto bound = pass.ports.find(access.port);
    const bool is_out = technique.find_port(access.port)->direction == Direction::kOut;
    if (access.access == HEDDLE_ACCESS_VALUE && is_out && bound != pass.ports.end())
      parts[access.port] = resources[bound->second].value.bytes;
  }
  return parts;
}

void Executor::State::execute_stage(PassState& state, const ScheduledStage& scheduled, heddle_frame& frame) {
  const Pass& pass = pass_of(state);
  const Stage& stage = technique_of(state).stages[scheduled.stage];
  if (!stage.cached_by) {
    const bool is_lasting = keeps_artifacts() && makes_what_lasts(technique_of(state));
    run_slices(state, scheduled, frame, info_for(pass), is_lasting ? pass_keys[scheduled.pass] : std::string{});
    return;
  }
  Value* environment = nullptr;
  for (const Access& access : stage.accesses) {
    const auto bound = pass.ports.find(access.port);
    if (bound == pass.ports.end()) continue;
    Value& value = resources[bound->second].value;
    if (is_environment(graph.resources[bound->second]) && value.bytes.size() >= sizeof(HeddleEnvironment))
      environment = &value;
  }
  const UnplacedEnvironment unplaced(environment);
  struct Confine {  // to what the key is made of
    PassState& state;
    ~Confine() { state.cached_stage = nullptr; }
  } const confine{state};
  state.cached_stage = &stage;
  // Check mode proves what code does, poison what it leaves out: both need it to run, and keep nothing of it.
  if (!keeps_artifacts()) {
    run_slices(state, scheduled, frame, timeless(), {});
    return;
  }

  ArtifactUse use{pass.name, stage.name, artifact_key(state, scheduled, frame), {}, 0, false, {}, {}};
  const std::filesystem::path file = services.artifacts.file(use.key);
  std::string damage;
  std::optional<ArtifactParts> found;
  if (!services.remakes_artifacts) found = services.artifacts.read(use.key, damage);
  if (found && !take_artifact(*found, state, scheduled, frame)) damage = "it lacks a part, or one has another size";
  use.is_reused = found && damage.empty();
  if (!use.is_reused) {
    if (!damage.empty()) {
      warn(pass, fmt::format("the artifact {} is damaged: {}; it is made again", file.string(), damage));
    }
    begin_anew(state, scheduled, frame);
    run_slices(state, scheduled, frame, timeless(), use.key);
  }
  const ArtifactViews parts = made_parts(state, scheduled, frame);
  for (const auto& [name, bytes] : parts) use.bytes += bytes.size();
  std::string problem;
  if (!use.is_reused) problem = services.artifacts.write(use.key, parts);
  if (problem.empty()) {
    use.file = file.string();
  } else {
    warn(pass, problem + "; it will be made again next time");
  }
  const auto last = std::ranges::find_if(stats.artifacts, [&](const ArtifactUse& known) {
    return known.job.empty() && known.pass == use.pass && known.stage == use.stage;
  });
  if (last == stats.artifacts.end())
    stats.artifacts.push_back(std::move(use));
  else
    *last = std::move(use);
}

}  // namespace heddle::graph
