// SPDX-License-Identifier: Apache-2.0
// A stage that works in slices: called until it is done, stopped only in between, and gone on with by another process
// where the technique can. A slice may begin with an earlier stage of the pass (service heddle.slices).

#include "graph/execute_state.hpp"

#include "content_hash.hpp"
#include "graph/execute_calls.hpp"

#include <heddle/slices.h>

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace heddle::graph {

namespace {

using Clock = std::chrono::steady_clock;

/// Of the time between two savings, what saving may take: then it costs a twentieth at most.
constexpr int kWorkToSaving = 20;
/// Parts beside ports, which have names.
constexpr std::string_view kStatePart = "#state", kSlicePart = "#slice", kFirstPart = "#first";

std::string unfinished_key(const std::string& key, const Stage& stage) {
  ContentHash hash;
  hash.add("heddle unfinished 1");
  hash.add(key);
  hash.add(stage.name);
  return hash.hexadecimal();
}

bool can_go_on(const heddle_technique& descriptor) {
  constexpr std::size_t kNeeded = offsetof(heddle_technique, load_state) + sizeof descriptor.load_state;
  return descriptor.struct_size >= kNeeded && descriptor.load_state != nullptr && descriptor.save_state != nullptr;
}

heddle_status begin_with(const heddle_pass_host* self, heddle_frame* frame, const char* stage) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    const Executor::State& executor = executor_of(pass);
    const std::vector<ScheduledStage>& stages = executor.order.stages;
    const auto current = static_cast<std::uint32_t>(frame->stage - stages.data());
    const bool is_in_loop = std::ranges::any_of(
        executor.order.loops, [&](const ScheduledLoop& loop) { return current >= loop.begin && current < loop.end; });
    if (!executor.graph.is_job || is_in_loop)
      return wrong(pass, "asks for slices of several stages, which only stages of jobs do, outside of loops");
    for (std::uint32_t s = 0; s < current; ++s) {
      if (stages[s].pass != pass.index || executor.technique_of(pass).stages[stages[s].stage].name != stage) continue;
      pass.again = s;
      return HEDDLE_OK;
    }
    return wrong(pass, fmt::format("begins a slice of stage '{}' with '{}', which is no earlier stage of it",
                                   executor.technique_of(pass).stages[stages[current].stage].name, stage));
  });
}

constexpr heddle_slices_service kSlicesService{sizeof(heddle_slices_service), 0, begin_with};

}  // namespace

const void* slices_service(std::string_view id) {
  return id == HEDDLE_SLICES_SERVICE ? &kSlicesService : nullptr;
}

bool Executor::State::is_stop_asked() const {
  return stop_reason || (services.is_cancelled != nullptr && services.is_cancelled->load());
}

/// Between two slices of a gpu stage the device is idle, and everything that the first wrote is there for the second.
void Executor::State::begin_slice(PassState& state, const ScheduledStage& scheduled, heddle_frame& frame) {
  submit_and_wait();
  begin_frame_memory();
  begin_commands();
  label_commands(&scheduled);
  frame.commands = commands;
  for (const std::string& port : device_outputs(state, scheduled)) {
    const ResourceIndex resource = pass_of(state).ports.at(port);
    record_barriers(std::array{full_barrier(resource, root(resource).layout, root(resource).layout)});
  }
}

void Executor::State::run_slices(PassState& state, const ScheduledStage& scheduled, heddle_frame& frame,
                                 const heddle_frame_info& seen, const std::string& key) {
  const bool is_gpu = scheduled.kind == StageKind::kGpu;
  const auto call = is_gpu ? state.descriptor->record : state.descriptor->execute;
  if (call == nullptr) return;
  const std::string_view what = is_gpu ? "record" : "execute";
  if (state.slice == 0) {
    state.began = state.told = state.saved = Clock::now();
    state.saving = {};
  }
  frame.began = state.began;
  frame.told = state.told;
  frame.slice = state.slice;
  frame.stops_at_slices = can_go_on(*state.descriptor);
  const Stage& stage = technique_of(state).stages[scheduled.stage];
  const bool is_kept = frame.stops_at_slices && !key.empty() && services.artifacts.keeps_anything();
  const std::string unfinished = is_kept ? unfinished_key(key, stage) : std::string{};
  if (is_kept && frame.slice == 0) load_unfinished(state, scheduled, frame, unfinished);
  if (state.again) {  // the stages before this one have not seen that slice
    state.slice = frame.slice;
    return;
  }
  heddle_frame_info info_now = seen;
  for (;;) {
    info_now.slice = frame.slice;
    state.again.reset();
    const heddle_status status = call(state.object, &state.api, scheduled.stage, &frame, &info_now);
    state.told = frame.told;
    if (status == HEDDLE_CANCELLED) stop_if_cancelled();
    if (status != HEDDLE_MORE || !errors.empty()) {
      state.again.reset();
      const bool asked_too_much = status == HEDDLE_OK && state.cached_stage != nullptr && !errors.empty();
      // What led to a failure is no place to go on from.
      if (is_kept) services.artifacts.remove(unfinished);
      throw_if_failed(state, asked_too_much ? HEDDLE_BUG : status == HEDDLE_MORE ? HEDDLE_FAILED : status, what);
      return;
    }
    ++frame.slice;
    if (is_gpu) begin_slice(state, scheduled, frame);
    const bool is_stopping = is_stop_asked();
    if (is_kept && (is_stopping || Clock::now() - state.saved >= kWorkToSaving * state.saving)) {
      const Clock::time_point start = Clock::now();
      save_unfinished(state, scheduled, frame, unfinished);
      state.saved = Clock::now();
      state.saving = state.saved - start;
    }
    if (is_stopping) {
      if (is_kept)
        services.log(Severity::kInfo,
                     fmt::format("pass '{}': what stage '{}' has done is kept; the next run goes on there",
                                 pass_of(state).name, stage.name));
      stop_if_cancelled();
    }
    if (state.again) {
      state.slice = frame.slice;
      return;
    }
  }
}

/// What a stage of an earlier slice has left, to what the stage expects: in the order of this repetition nobody has
/// planned barriers. Where it keeps nothing of a resource the first time, it keeps nothing now.
std::vector<Barrier> Executor::State::barriers_again(std::uint32_t stage) const {
  std::vector<Barrier> all;
  for (const ScheduledStage::Use& use : order.stages[stage].uses) {
    const Resource& resource = graph.resources[use.resource];
    const ResourceIndex first = resources[use.resource].root;
    if ((!resources[first].image && !resources[first].buffer) ||
        std::ranges::find(all, first, &Barrier::resource) != all.end())
      continue;
    const std::vector<Barrier>& planned = barriers.before[stage];
    const auto known = std::ranges::find(planned, first, &Barrier::resource);
    const bool is_fresh_again = known != planned.end() && known->old_layout == VK_IMAGE_LAYOUT_UNDEFINED;
    all.push_back(full_barrier(first, is_fresh_again ? VK_IMAGE_LAYOUT_UNDEFINED : resources[first].layout,
                               use_info(use, resource.type, resource.format).layout));
  }
  return all;
}

/// The next slice of stage `last`, from the stage that it has asked for.
void Executor::State::run_again(std::uint32_t last, bool is_profiled) {
  const PassIndex pass = order.stages[last].pass;
  PassState& state = *passes[pass];
  const std::uint32_t first = *state.again;
  state.again.reset();
  submit_and_wait();
  begin_frame_memory();
  begin_commands();
  // What can go on stops behind `last`, which keeps what is done: stopped before it, the slices since the last saving
  // would be lost.
  const bool stops_here = !can_go_on(*state.descriptor);
  for (std::uint32_t s = first; s <= last; ++s)
    if (order.stages[s].pass == pass && !order.stages[s].is_read_back)
      run_timed(s, barriers_again(s), is_profiled, stops_here);
  if (!state.again) state.slice = 0;
}

/// Ports of images and buffers that a gpu stage writes.
std::vector<std::string> Executor::State::device_outputs(const PassState& state,
                                                         const ScheduledStage& scheduled) const {
  std::vector<std::string> ports;
  if (scheduled.kind != StageKind::kGpu) return ports;
  const Pass& pass = pass_of(state);
  for (const Access& access : technique_of(state).stages[scheduled.stage].accesses) {
    const auto bound = pass.ports.find(access.port);
    if (bound == pass.ports.end()) continue;
    const Resource& resource = graph.resources[bound->second];
    if (resource.type != PortType::kImage && resource.type != PortType::kBuffer) continue;
    if (!access_info(access.access, resource.type, resource.format).writes) continue;
    if (std::ranges::find(ports, access.port) == ports.end()) ports.push_back(access.port);
  }
  return ports;
}

/// What the stage has made so far, and what the technique needs to go on.
void Executor::State::save_unfinished(PassState& state, const ScheduledStage& scheduled, heddle_frame& frame,
                                      const std::string& key) {
  frame.state.clear();
  frame.is_saving = true;
  const heddle_status status = state.descriptor->save_state(state.object, &state.api, scheduled.stage, &frame);
  frame.is_saving = false;
  throw_if_failed(state, status, "save_state");
  ArtifactViews parts = made_parts(state, scheduled, frame);
  parts[std::string(kStatePart)] = frame.state;
  parts[std::string(kSlicePart)] = std::as_bytes(std::span(&frame.slice, 1));
  std::string first;
  if (state.again) first = technique_of(state).stages[order.stages[*state.again].stage].name;
  parts[std::string(kFirstPart)] = std::as_bytes(std::span(first));
  std::vector<vulkan::Buffer> copies;
  for (const std::string& port : device_outputs(state, scheduled)) {
    const ResourceIndex resource = pass_of(state).ports.at(port);
    const VkImageLayout layout = root(resource).layout;
    copies.push_back(device->make_buffer(host_bytes(resource), VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
    if (root(resource).image)
      record_barriers(std::array{full_barrier(resource, layout, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL)});
    copy_to_host(resource, copies.back());
    if (root(resource).image)
      record_barriers(std::array{full_barrier(resource, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, layout)});
    parts[port] = {copies.back().data(), copies.back().size()};
  }
  if (!copies.empty()) {
    show_copies_to_host(device->table(), commands);
    begin_slice(state, scheduled, frame);
  }
  if (const std::string problem = services.artifacts.write(key, parts); !problem.empty())
    warn(pass_of(state), problem + "; what is done so far is not kept");
}

void Executor::State::load_unfinished(PassState& state, const ScheduledStage& scheduled, heddle_frame& frame,
                                      const std::string& key) {
  if (services.remakes_artifacts) return;
  std::string damage;
  const std::optional<ArtifactParts> parts = services.artifacts.read(key, damage);
  if (!damage.empty())
    warn(pass_of(state), fmt::format("what an earlier run had done, {}, is damaged: {}; the stage begins anew",
                                     services.artifacts.file(key).string(), damage));
  if (!parts) return;
  const auto slice = parts->find(kSlicePart);
  const auto kept = parts->find(kStatePart);
  if (slice == parts->end() || slice->second.size() != sizeof frame.slice || kept == parts->end()) return;
  std::uint32_t slices = 0;
  std::memcpy(&slices, slice->second.data(), sizeof slices);
  put_back(state, scheduled, frame, *parts);
  const heddle_status status = state.descriptor->load_state(state.object, &state.api, scheduled.stage, &frame,
                                                            kept->second.data(), kept->second.size());
  if (status == HEDDLE_OK && errors.empty()) {
    frame.slice = slices;
    state.again = first_of(state, scheduled, *parts);
    services.log(Severity::kInfo, fmt::format("pass '{}': stage '{}' goes on where an earlier run was stopped",
                                              pass_of(state).name, technique_of(state).stages[scheduled.stage].name));
    return;
  }
  errors.clear();
  warn(pass_of(state), fmt::format("stage '{}' has no use for what an earlier run had done, and begins anew",
                                   technique_of(state).stages[scheduled.stage].name));
  begin_anew(state, scheduled, frame);
}

/// The scheduled stage that the slice of an earlier run was to begin with; nothing: with this one.
std::optional<std::uint32_t> Executor::State::first_of(const PassState& state, const ScheduledStage& scheduled,
                                                       const ArtifactParts& parts) const {
  const auto kept = parts.find(kFirstPart);
  if (kept == parts.end() || kept->second.empty()) return {};
  const std::string_view name{reinterpret_cast<const char*>(kept->second.data()), kept->second.size()};
  for (std::uint32_t s = 0; &order.stages[s] != &scheduled; ++s)
    if (order.stages[s].pass == state.index && technique_of(state).stages[order.stages[s].stage].name == name) return s;
  return {};
}

/// Contents of an earlier run into the stage's ports; those of other sizes are not its.
void Executor::State::put_back(PassState& state, const ScheduledStage& scheduled, heddle_frame& frame,
                               const ArtifactParts& parts) {
  (void)take_artifact(parts, state, scheduled, frame);
  for (const std::string& port : device_outputs(state, scheduled)) {
    const ResourceIndex resource = pass_of(state).ports.at(port);
    const auto part = parts.find(port);
    if (part == parts.end() || part->second.size() != host_bytes(resource)) continue;
    const ResourceState& target = root(resource);
    vulkan::Buffer staging = device->make_buffer(part->second.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, true);
    std::memcpy(staging.data(), part->second.data(), part->second.size());
    device->note_host_write(staging);
    const VkImageLayout layout = target.layout;
    if (target.image) {
      record_barriers(std::array{full_barrier(resource, layout, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL)});
      const std::vector<VkBufferImageCopy> regions = all_mips(graph.resources[target.root]);
      device->table().CmdCopyBufferToImage(commands, staging.handle(), target.image.handle(), target.layout,
                                           static_cast<std::uint32_t>(regions.size()), regions.data());
    } else {
      record_barriers(std::array{full_barrier(resource, layout, layout)});
      const VkBufferCopy region{0, 0, staging.size()};
      device->table().CmdCopyBuffer(commands, staging.handle(), target.buffer.handle(), 1, &region);
    }
    record_barriers(std::array{full_barrier(resource, target.layout, layout)});
    device->count_upload(staging.size());
    frame_buffers.push_back(std::move(staging));
  }
}

/// What is not written must be the same each time.
void Executor::State::begin_anew(const PassState& state, const ScheduledStage& scheduled, heddle_frame& frame) {
  const Pass& pass = pass_of(state);
  frame.slice = 0;
  for (const heddle_frame::Mapping& mapping : frame.mappings)
    if (mapping.is_written) std::memset(mapping.staging.data(), 0, mapping.staging.size());
  for (const Access& access : technique_of(state).stages[scheduled.stage].accesses)
    if (access.access == HEDDLE_ACCESS_VALUE &&
        technique_of(state).find_port(access.port)->direction == Direction::kOut)
      set_value(pass.ports.at(access.port), {});
}

}  // namespace heddle::graph
