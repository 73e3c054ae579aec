// SPDX-License-Identifier: Apache-2.0
// The stages of a frame in order; those in loops as often as the loops say, each iteration a submission of its own.

#include "graph/execute_parts.hpp"
#include "graph/execute_state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>

namespace heddle::graph {

namespace {

using Clock = std::chrono::steady_clock;

double process_cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

}  // namespace

/// Nothing that a technique could see has changed since the last frame.
bool Executor::State::is_still(const scene::Scene& rendered, const FrameOptions& options) {
  std::vector<std::byte> now = scene_state(rendered, graph.width, graph.height);
  add_bytes(now, options.time);
  add_bytes(now, options.time_step);
  add_bytes(now, options.seed);
  const bool is_same = info.cut == 0 && !options.anew && !is_changed && now == inputs;
  inputs = std::move(now);
  is_changed = false;
  return is_same;
}

/// Asks every loop what is due. False if the frame has nothing to do: loops that are complete, in a frame like the
/// last.
bool Executor::State::find_iterations() {
  iterations.clear();
  stats.loops.clear();
  is_continuing = false;
  bool is_due = order.loops.empty() || info.is_still == 0;
  for (const ScheduledLoop& loop : order.loops) {
    PassState& state = *passes[loop.pass];
    heddle_iterations due{};
    due.struct_size = sizeof due;
    info.iteration = info.iteration_count = 0;
    throw_if_failed(state, state.descriptor->iterations(state.object, &state.api, &info, &due), "iterations");
    if (due.total == 0 || due.first > due.total || due.count > due.total - due.first) {
      const Pass& pass = pass_of(state);
      throw Error(HEDDLE_BUG,
                  fmt::format("pass '{}': technique '{}' asks for iterations {} to {} of {}", pass.name,
                              pass.entry.technique->id, due.first, std::uint64_t{due.first} + due.count, due.total));
    }
    iterations.push_back(due);
    stats.loops.push_back({pass_of(state).name, due.first + due.count, due.total});
    is_due = is_due || due.count > 0;
    is_continuing = is_continuing || (info.is_still != 0 && due.first > 0 && due.count > 0);
  }
  return is_due;
}

/// Memory of a submission: command buffers, descriptor sets, staging. The device is done with what used it last.
void Executor::State::begin_frame_memory() {
  const heddle_vulkan& vk = device->table();
  vulkan::check(vk.ResetCommandPool(vk.device, command_pool, 0), "vkResetCommandPool");
  command_buffer_count = 0;
  for (VkDescriptorPool pool : descriptor_pools) (void)vk.ResetDescriptorPool(vk.device, pool, 0);
  descriptor_pool = 0;
  frame_buffers = std::move(outgrown_buffers);
  outgrown_buffers.clear();
  view_count = 0;
  draw_command_bytes = 0;
  group_command_count = 0;
  placings.clear();
  program_sets.clear();
  for (ResourceState& state : resources)
    if (state.made) state.made->is_placed = false;
}

void Executor::State::run_timed(std::uint32_t index, std::span<const Barrier> before, bool is_profiled,
                                bool stops_here) {
  const auto start = Clock::now();
  const double cpu_start = is_profiled ? process_cpu_ms() : 0;  // a system call
  if (stops_here) stop_if_cancelled();
  if (services.progress && !stop_reason) {
    const Pass& running = graph.passes[order.stages[index].pass];
    try {
      services.progress(fmt::format("stage '{}' of pass '{}'",
                                    running.entry.technique->stages[order.stages[index].stage].name, running.name),
                        static_cast<double>(index) / static_cast<double>(order.stages.size()));
    } catch (...) {
      if (stops_here) throw;
      stop_reason = std::current_exception();
    }
  }
  poison_around(index, true);
  run_stage(index, before);
  keep_lasting(index);
  sort_appended(index);
  copy_counts(index);
  scan_outputs(index);
  // Of a loop that is the last iteration, as what follows it sees.
  if (is_last_iteration || order.stages[index].runs_once) look_at_outputs(index);
  // What the next slice looks at again was not used for the last time.
  if (!passes[order.stages[index].pass]->again) poison_around(index, false);
  if (!is_profiled) return;
  submit_and_wait();
  begin_commands();
  const ScheduledStage& scheduled = order.stages[index];
  const Pass& pass = graph.passes[scheduled.pass];
  const std::string stage =
      pass.entry.technique->stages[scheduled.stage].name + (scheduled.is_read_back ? " (read back)" : "");
  auto time = std::ranges::find_if(
      stats.stages, [&](const StageTime& known) { return known.pass == pass.name && known.stage == stage; });
  if (time == stats.stages.end()) time = stats.stages.insert(time, {pass.name, stage, 0, 0});
  time->wall_ms += std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  time->cpu_ms += process_cpu_ms() - cpu_start;
}

void Executor::State::run_loop(std::size_t index, bool is_profiled) {
  const ScheduledLoop& loop = order.loops[index];
  const heddle_iterations& due = iterations[index];
  const Technique& technique = *graph.passes[loop.pass].entry.technique;
  // A complete loop in a frame that others need: its body makes the last iteration again for whoever reads that.
  const std::uint32_t first = due.count > 0 ? due.first : due.total - 1;
  const std::uint32_t count = std::max(due.count, 1U);
  const std::size_t scans_before = scans.size();
  info.iteration_count = due.total;
  for (std::uint32_t i = 0; i < count; ++i) {
    info.iteration = first + i;
    is_first_iteration = i == 0;
    is_last_iteration = i + 1 == count;
    for (std::uint32_t s = loop.begin; s < loop.end; ++s) {
      const ScheduledStage& scheduled = order.stages[s];
      if (i > 0 && scheduled.runs_once) continue;
      const std::vector<Barrier>& before = i == 0 ? barriers.before[s] : barriers.again[s];
      const bool gathers =
          scheduled.pass == loop.pass && technique.stages[scheduled.stage].loop_part == HEDDLE_LOOP_AFTER;
      if (gathers && due.count == 0) {
        label_commands(&scheduled);
        record_barriers(before);
      } else {
        run_timed(s, before, is_profiled);
      }
    }
    // Values are one memory each: what this iteration reads of them must be done before the next one sets them.
    submit_and_wait();
    if (!is_last_iteration) {  // Executor::check compares the copies of the last one
      search_scans(scans_before);
      scans.resize(scans_before);
    }
    begin_frame_memory();
    begin_commands();
  }
  info.iteration = info.iteration_count = 0;
  is_first_iteration = is_last_iteration = true;
}

void Executor::State::run_stages(bool is_profiled) {
  info.iteration = info.iteration_count = 0;
  std::size_t loop = 0;
  for (std::uint32_t s = 0; s < order.stages.size(); ++s) {
    if (loop < order.loops.size() && order.loops[loop].begin == s) {
      run_loop(loop, is_profiled);
      s = order.loops[loop++].end - 1;
    } else {
      run_timed(s, barriers.before[s], is_profiled);
      while (passes[order.stages[s].pass]->again) run_again(s, is_profiled);
    }
  }
}

}  // namespace heddle::graph
