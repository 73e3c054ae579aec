// SPDX-License-Identifier: Apache-2.0
// Lists that shaders append to: emptied by the host, dispatched over without the host's knowing how long they are, and
// counted when the frame is over.

#include "graph/execute_state.hpp"
#include "graph/uses.hpp"
#include "vulkan/hazard_recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace heddle::graph {

namespace {

constexpr std::uint64_t kCountsInBuffer = 256;
// A work group count stands alone in what a descriptor may begin at on every device.
constexpr std::uint64_t kGroupsStride = 256;

std::uint32_t read_count(const std::byte* head) {
  std::uint32_t count = 0;
  std::memcpy(&count, head, sizeof count);
  return count;
}

}  // namespace

/// What a stage does to a list, by all its versions.
AccessInfo Executor::State::list_access(const ScheduledStage& stage, ResourceIndex list) const {
  AccessInfo all;
  for (const ScheduledStage::Use& use : stage.uses) {
    if (resources[use.resource].root != list) continue;
    const AccessInfo one = use_info(use, PortType::kBuffer, 0);
    all.stages |= one.stages;
    all.access |= one.access;
  }
  return all;
}

/// The stage's barriers have been recorded; they cover the transfer.
void Executor::State::begin_lists(std::uint32_t stage, std::uint32_t activity) {
  const ScheduledStage& scheduled = order.stages[stage];
  for (const ResourceIndex list : lists.emptied[stage]) {
    ResourceState& state = resources[list];
    const Resource& resource = graph.resources[list];
    if (!state.buffer) continue;
    // Callers of a function that appends have a say in what they make themselves, not in the list.
    const bool is_makers = scheduled.pass == resource.producer;
    const bool is_left = activity == HEDDLE_KEEP && is_makers && is_kept(graph, list);
    const bool is_neutral = activity == HEDDLE_NOTHING && is_makers;
    const bool is_emptied = !is_left && (!lists.goes_on[list] || info.cut != 0 || is_neutral);
    // What had no room in the last frame is no part of this one's count.
    const bool is_over = lists.goes_on[list] && state.appended > resource.capacity;
    if (!is_emptied && !is_over) continue;
    state.appended = is_emptied ? 0 : resource.capacity;
    sorted_counts[list] = state.appended;
    device->table().CmdFillBuffer(commands, state.buffer.handle(), 0, sizeof state.appended, state.appended);
    const AccessInfo next = list_access(scheduled, list);
    Barrier barrier;
    barrier.resource = list;
    barrier.source_stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;  // a fill is a clear to some layers, a copy to others
    barrier.source_access = VK_ACCESS_2_TRANSFER_WRITE_BIT;
    barrier.target_stages = next.stages | VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
    barrier.target_access = next.access | VK_ACCESS_2_TRANSFER_READ_BIT;
    record_barriers({&barrier, 1});
  }
}

void Executor::State::copy_counts(std::uint32_t stage) {
  for (const ResourceIndex list : lists.counted[stage]) {
    const ResourceState& state = resources[list];
    if (!state.buffer) continue;
    const std::uint64_t buffer = count_slots.size() / kCountsInBuffer;
    const std::uint64_t slot = count_slots.size() % kCountsInBuffer;
    if (buffer == count_buffers.size()) {
      count_buffers.push_back(device->make_buffer(kCountsInBuffer * kListHead, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
    }
    const AccessInfo before = list_access(order.stages[stage], list);
    Barrier barrier;
    barrier.resource = list;
    barrier.source_stages = before.stages;
    barrier.source_access = before.access & (VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT | VK_ACCESS_2_TRANSFER_WRITE_BIT);
    barrier.target_stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
    barrier.target_access = VK_ACCESS_2_TRANSFER_READ_BIT;
    record_barriers({&barrier, 1});
    const VkBufferCopy region{0, slot * kListHead, kListHead};
    device->table().CmdCopyBuffer(commands, state.buffer.handle(), count_buffers[buffer].handle(), 1, &region);
    device->count_read_back(kListHead);
    count_slots.push_back(list);
  }
}

/// The last commands of the frame. The next frame's copies go where this one's did.
void Executor::State::publish_counts() {
  if (count_slots.empty()) return;
  barrier_between(device->table(), commands, VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT,
                  VK_PIPELINE_STAGE_2_HOST_BIT | VK_PIPELINE_STAGE_2_COPY_BIT,
                  VK_ACCESS_2_HOST_READ_BIT | VK_ACCESS_2_TRANSFER_WRITE_BIT);
}

/// What was appended in a frame that is done, for the frames after it.
void Executor::State::note_counts(const FrameMemory& memory) {
  for (std::size_t i = 0; i < memory.count_slots.size(); ++i) {
    const std::byte* heads = memory.count_buffers[i / kCountsInBuffer].data();
    resources[memory.count_slots[i]].appended = read_count(heads + i % kCountsInBuffer * kListHead);
  }
}

/// After the frame: what was appended, for the statistics and for the passes that make the lists.
void Executor::State::tell_counts(const FrameMemory& memory) {
  note_counts(memory);
  std::map<ResourceIndex, heddle_list_count> counts;
  for (std::size_t i = 0; i < memory.count_slots.size(); ++i) {
    const vulkan::Buffer& buffer = memory.count_buffers[i / kCountsInBuffer];
    const std::uint64_t at = i % kCountsInBuffer * kListHead;
    device->note_host_read(buffer, at, kListHead);
    const Resource& list = graph.resources[memory.count_slots[i]];
    const std::uint32_t appended = read_count(buffer.data() + at);
    heddle_list_count& count = counts[memory.count_slots[i]];
    count.struct_size = sizeof count;
    count.capacity = list.capacity;
    count.port = list.port.c_str();
    count.frame = memory.submitted_frame;
    count.count = std::min(appended, list.capacity);
    count.overflow = std::max(count.overflow, appended - count.count);
  }
  stats.lists.clear();
  for (const auto& [index, count] : counts) {
    const Resource& list = graph.resources[index];
    stats.lists.push_back({list.name, count.capacity, count.count, count.overflow});
    PassState& pass = *passes[list.producer];
    const bool has_counted =
        pass.descriptor->struct_size >= offsetof(heddle_technique, counted) + sizeof pass.descriptor->counted;
    if (has_counted && pass.descriptor->counted != nullptr) {
      pass.descriptor->counted(pass.object, &pass.api, &count);
      throw_if_failed(pass, HEDDLE_OK, "counted");
    }
    const bool is_new = count.overflow > 0 && overflowing.insert(list.name).second;
    if (count.overflow == 0) overflowing.erase(list.name);
    if (!is_new) continue;
    Diagnostic diagnostic;
    diagnostic.severity = Severity::kWarning;
    diagnostic.where = pass_of(pass).where;
    diagnostic.message =
        fmt::format("frame {}, pass '{}' ({}): the list '{}' has room for {} elements, and {} more were left out",
                    memory.submitted_frame, pass_of(pass).name, pass_of(pass).entry.technique->id, list.name,
                    count.capacity, count.overflow);
    diagnostic.help = pass.wants_redeclare ? "it is made larger for the next frame: render more than one"
                                           : "its technique keeps it as it is";
    services.log(Severity::kWarning, to_text(diagnostic));
  }
}

void Executor::State::make_groups_pipeline() {
  if (groups_pipeline) return;
  const bool has_lists = std::ranges::any_of(lists.emptied, [](const auto& emptied) { return !emptied.empty(); }) ||
                         std::ranges::any_of(lists.counted, [](const auto& counted) { return !counted.empty(); });
  if (has_lists) groups_pipeline = maker->compute(vulkan::list_groups_shader(services.cache_folder), {});
}

/// Work groups from the list's own count, then the dispatch. The stage's barriers let compute shaders read the list.
void Executor::State::dispatch_over_list(const PassState& pass, const ShaderState& shader, ResourceIndex list,
                                         const void* push, std::uint32_t push_bytes) {
  const heddle_vulkan& vk = device->table();
  const ResourceState& state = root(list);
  const Resource& resource = graph.resources[state.root];
  const std::uint32_t local = shader.compiled.local_size[0];
  const std::uint32_t most = device->limits().maxComputeWorkGroupCount[0];
  if ((std::uint64_t{resource.capacity} + local - 1) / local > most) {
    throw Error(HEDDLE_UNSUPPORTED,
                fmt::format("pass '{}': shader '{}' has {} invocations in a work group, and this device dispatches at "
                            "most {} of them: not over '{}' with its {} elements",
                            pass_of(pass).name, shader.shader->name, local, most, resource.name, resource.capacity),
                "a larger local_size_x, or a smaller capacity");
  }
  if (resource.capacity == 0) return;
  if (!group_commands || (group_command_count + 1) * kGroupsStride > group_commands.size()) {
    const std::uint64_t size = std::max(group_commands ? group_commands.size() * 2 : 0, 64 * kGroupsStride);
    if (group_commands) frame_buffers.push_back(std::move(group_commands));  // what was recorded reads it
    group_commands =
        device->make_buffer(size, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT, false);
    group_command_count = 0;
  }
  const std::uint64_t at = kGroupsStride * group_command_count++;
  const VkDescriptorSet set = allocate_set(groups_pipeline.set_layout(0));
  const std::array<VkDescriptorBufferInfo, 2> buffers{
      {{state.buffer.handle(), 0, VK_WHOLE_SIZE}, {group_commands.handle(), at, kGroupsStride}}};
  std::array<VkWriteDescriptorSet, 2> writes{};
  for (std::uint32_t i = 0; i < writes.size(); ++i) {
    writes[i] = {VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
    writes[i].dstSet = set;
    writes[i].dstBinding = i;
    writes[i].descriptorCount = 1;
    writes[i].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    writes[i].pBufferInfo = &buffers[i];
  }
  vk.UpdateDescriptorSets(vk.device, writes.size(), writes.data(), 0, nullptr);
  const vulkan::ListGroups groups{resource.capacity, local};
  vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, groups_pipeline.handle());
  vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, groups_pipeline.layout(), 0, 1, &set, 0, nullptr);
  vk.CmdPushConstants(commands, groups_pipeline.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof groups, &groups);
  vk.CmdDispatch(commands, 1, 1, 1);
  // The next submission's work groups go where these are.
  barrier_between(vk, commands, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT,
                  VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
                  VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT);
  bind(pass, shader, shader.pipeline, push, push_bytes);
  vk.CmdDispatchIndirect(commands, group_commands.handle(), at);
}

/// Executor::check: what a stage has appended is put into an order that no run of the stage would make by chance.
/// Nobody may see the difference.
void Executor::State::sort_appended(std::uint32_t stage) {
  if (!variant.list_order) return;
  for (const ScheduledStage::Use& use : order.stages[stage].uses) {
    if ((use.mask & (1U << HEDDLE_ACCESS_APPEND)) == 0) continue;
    const ResourceIndex list = resources[use.resource].root;
    const Resource& resource = graph.resources[list];
    const vulkan::Buffer& buffer = resources[list].buffer;
    if (!buffer || resource.capacity == 0) continue;
    const vulkan::hazard::Recorder::Pause pause(device->recorder());
    const heddle_vulkan& vk = device->table();
    const vulkan::Buffer staging =
        device->make_buffer(buffer.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
    const VkBufferCopy whole{0, 0, buffer.size()};
    const auto barrier = [&] {
      constexpr VkAccessFlags2 kAnything = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
      barrier_between(vk, commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, kAnything,
                      VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_2_HOST_BIT,
                      kAnything | VK_ACCESS_2_HOST_READ_BIT);
    };
    barrier();
    vk.CmdCopyBuffer(commands, buffer.handle(), staging.handle(), 1, &whole);
    barrier();
    submit_and_wait();
    const std::uint32_t count = std::min(read_count(staging.data()), resource.capacity);
    const std::uint32_t first = std::min(sorted_counts[list], count);
    std::vector<std::string> elements;
    for (std::uint32_t i = first; i < count; ++i) {
      const std::byte* element = staging.data() + kListHead + std::uint64_t{i} * resource.element_bytes;
      elements.emplace_back(reinterpret_cast<const char*>(element), resource.element_bytes);
    }
    std::ranges::sort(elements);
    if (*variant.list_order == ListOrder::kDescending) std::ranges::reverse(elements);
    std::byte* target = staging.data() + kListHead + std::uint64_t{first} * resource.element_bytes;
    for (const std::string& element : elements) {
      std::memcpy(target, element.data(), element.size());
      target += element.size();
    }
    sorted_counts[list] = count;
    begin_commands();
    vk.CmdCopyBuffer(commands, staging.handle(), buffer.handle(), 1, &whole);
    barrier();
    submit_and_wait();  // the staging memory ends here
    begin_commands();
  }
}

}  // namespace heddle::graph
