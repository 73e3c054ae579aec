// SPDX-License-Identifier: Apache-2.0
// One wrapper for each function of the table, made from a template: finds the device, counts, calls the driver, and in
// check mode tells the recorder.
#include "vulkan/table.hpp"

#include "vulkan/classic_passes.hpp"
#include "vulkan/hazard_recorder.hpp"

#include <array>
#include <chrono>
#include <cstdlib>
#include <mutex>
#include <tuple>
#include <type_traits>
#include <unordered_map>

namespace heddle::vulkan {

struct Calls {
  using Count = std::atomic<std::uint64_t>;
  heddle_vulkan next{};  // what the driver offers
  Count commands{0}, draws{0}, dispatches{0}, barriers{0}, barrier_parts{0}, renderings{0}, submits{0};
  Count pipelines{0}, pipeline_ns{0}, live_pipelines{0}, live_images{0}, live_buffers{0};
  Count device_memory_bytes{0}, uploaded_bytes{0}, read_back_bytes{0};
  hazard::Recorder* recorder = nullptr;    // check mode alone
  std::unique_ptr<ClassicPasses> classic;  // check mode under validation alone

  std::mutex memory_mutex;
  std::unordered_map<VkDeviceMemory, VkDeviceSize> memory_sizes;  // vkFreeMemory does not tell the size
};

namespace {

void add(Calls::Count& count, std::uint64_t n = 1) {
  count.fetch_add(n, std::memory_order_relaxed);
}
void subtract(Calls::Count& count, std::uint64_t n = 1) {
  count.fetch_sub(n, std::memory_order_relaxed);
}

// ---- live devices by dispatch pointer ----

constexpr std::size_t kMostDevices = 64;  // at once in one process; lookup is a scan that mostly ends at the first

struct Slot {
  std::atomic<const void*> key{nullptr};  // published after `calls`; null: free
  Calls* calls = nullptr;
};
constinit std::array<Slot, kMostDevices> slots;
constinit std::mutex slots_mutex;  // for those who come and go; readers need none

const void* dispatch_key(const void* handle) {
  return *static_cast<const void* const*>(handle);
}

Calls& calls_of(const void* handle) {
  const void* const key = dispatch_key(handle);
  for (Slot& slot : slots) {
    if (slot.key.load(std::memory_order_acquire) == key) return *slot.calls;
  }
  std::abort();  // a handle of a device that is destroyed or was not made by this host
}

void enlist(const void* handle, Calls& calls) {
  const std::scoped_lock lock(slots_mutex);
  for (Slot& slot : slots) {
    if (slot.key.load(std::memory_order_relaxed) != nullptr) continue;
    slot.calls = &calls;
    slot.key.store(dispatch_key(handle), std::memory_order_release);
    return;
  }
  throw Error(HEDDLE_FAILED, "more than " + std::to_string(kMostDevices) + " devices in one process",
              "close hosts that are no longer needed");
}

void strike_off(const void* handle) {
  const std::scoped_lock lock(slots_mutex);
  for (Slot& slot : slots) {
    if (slot.key.load(std::memory_order_relaxed) == dispatch_key(handle)) {
      slot.key.store(nullptr, std::memory_order_release);
      return;
    }
  }
}

// ---- counting ----

template <auto Member>
struct Named {};  // a member pointer as a type, since pointers to members of different types do not compare

template <auto Member, auto... Others>
constexpr bool kIsOneOf = (std::is_same_v<Named<Member>, Named<Others>> || ...);

using Table = heddle_vulkan;

template <auto Function>
constexpr bool kMakesPipelines = kIsOneOf<Function, &Table::CreateComputePipelines, &Table::CreateGraphicsPipelines>;

/// Memory goes off the list before the driver may hand out the same handle again.
template <auto Function, typename... Args>
void count_before(Calls& calls, const std::tuple<Args...>& args) {
  if constexpr (kIsOneOf<Function, &Table::FreeMemory>) {
    const std::scoped_lock lock(calls.memory_mutex);
    const auto found = calls.memory_sizes.find(std::get<0>(args));
    if (found == calls.memory_sizes.end()) return;
    subtract(calls.device_memory_bytes, found->second);
    calls.memory_sizes.erase(found);
  }
  if constexpr (kIsOneOf<Function, &Table::DestroyPipeline>) {
    if (std::get<0>(args) != VK_NULL_HANDLE) subtract(calls.live_pipelines);
  }
  if constexpr (kIsOneOf<Function, &Table::DestroyImage>) {
    if (std::get<0>(args) != VK_NULL_HANDLE) subtract(calls.live_images);
  }
  if constexpr (kIsOneOf<Function, &Table::DestroyBuffer>) {
    if (std::get<0>(args) != VK_NULL_HANDLE) subtract(calls.live_buffers);
  }
}

template <auto Function, typename... Args>
void count_command(Calls& calls, const std::tuple<Args...>& args) {
  add(calls.commands);
  if constexpr (kIsOneOf<Function, &Table::CmdDraw, &Table::CmdDrawIndexed, &Table::CmdDrawIndirect,
                         &Table::CmdDrawIndexedIndirect, &Table::CmdDrawIndirectCount,
                         &Table::CmdDrawIndexedIndirectCount>) {
    add(calls.draws);
  }
  if constexpr (kIsOneOf<Function, &Table::CmdDispatch, &Table::CmdDispatchIndirect>) add(calls.dispatches);
  if constexpr (kIsOneOf<Function, &Table::CmdPipelineBarrier2>) {
    const VkDependencyInfo& dependency = *std::get<0>(args);
    add(calls.barriers);
    add(calls.barrier_parts, std::uint64_t{dependency.memoryBarrierCount} + dependency.bufferMemoryBarrierCount +
                                 dependency.imageMemoryBarrierCount);
  }
  if constexpr (kIsOneOf<Function, &Table::CmdBeginRendering>) add(calls.renderings);
}

/// Only what the driver really made counts.
template <auto Function, typename... Args>
void count_after(Calls& calls, VkResult result, const std::tuple<Args...>& args) {
  if constexpr (kMakesPipelines<Function>) {
    // Of several pipelines some may exist although the call failed.
    for (std::uint32_t i = 0; i < std::get<1>(args); ++i) {
      if (std::get<4>(args)[i] == VK_NULL_HANDLE) continue;
      add(calls.pipelines);
      add(calls.live_pipelines);
    }
  }
  if (result != VK_SUCCESS) return;
  if constexpr (kIsOneOf<Function, &Table::AllocateMemory>) {
    const VkDeviceSize size = std::get<0>(args)->allocationSize;
    const std::scoped_lock lock(calls.memory_mutex);
    calls.memory_sizes[*std::get<2>(args)] = size;
    add(calls.device_memory_bytes, size);
  }
  if constexpr (kIsOneOf<Function, &Table::CreateImage>) add(calls.live_images);
  if constexpr (kIsOneOf<Function, &Table::CreateBuffer>) add(calls.live_buffers);
  if constexpr (kIsOneOf<Function, &Table::QueueSubmit2>) add(calls.submits);
}

// ---- recording ----

// For each function: tells the recorder, if it has a function of that name.
#define HEDDLE_OBSERVE(name)                                                             \
  struct Observe##name {                                                                 \
    template <typename Listener, typename Handle, typename... Args>                      \
    static void call(Listener& recorder, [[maybe_unused]] Handle handle, Args... args) { \
      if constexpr (requires { recorder.name(handle, args...); }) {                      \
        recorder.name(handle, args...);                                                  \
      } else if constexpr (requires { recorder.name(args...); }) {                       \
        recorder.name(args...);                                                          \
      } else {                                                                           \
        static_assert(                                                                   \
            !requires { &Listener::name; }, "takes other arguments");                    \
      }                                                                                  \
    }                                                                                    \
  };
HEDDLE_VULKAN_FUNCTIONS(HEDDLE_OBSERVE)
#undef HEDDLE_OBSERVE

/// When a function counts and when it is recorded depends on its name.
struct Traits {
  bool is_command = false;
  bool ends_something = false;  // recorded before: the handle may be given out again
};
constexpr Traits traits_of(std::string_view name) {
  return {name.starts_with("Cmd"), name.starts_with("Destroy")};
}

template <auto Function, typename Observe, Traits kTraits, typename Pfn>
struct Counted;

template <auto Function, typename Observe, Traits kTraits, typename Result, typename Handle, typename... Args>
struct Counted<Function, Observe, kTraits, Result(VKAPI_PTR*)(Handle, Args...)> {
  static VKAPI_ATTR Result VKAPI_CALL call(Handle handle, Args... args) {
    Calls& calls = calls_of(handle);
    const std::tuple<Args...> all(args...);
    if constexpr (kTraits.is_command) count_command<Function>(calls, all);
    count_before<Function>(calls, all);
    if (kTraits.ends_something && calls.recorder != nullptr) Observe::call(*calls.recorder, handle, args...);
    if constexpr (std::is_same_v<Result, VkResult>) {
      using Clock = std::chrono::steady_clock;
      [[maybe_unused]] const Clock::time_point start = kMakesPipelines<Function> ? Clock::now() : Clock::time_point{};
      const VkResult result = (calls.next.*Function)(handle, args...);
      if constexpr (kMakesPipelines<Function>) {
        const auto spent = std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start);
        add(calls.pipeline_ns, static_cast<std::uint64_t>(spent.count()));
      }
      count_after<Function>(calls, result, all);
      if (!kTraits.ends_something && calls.recorder != nullptr && result == VK_SUCCESS)
        Observe::call(*calls.recorder, handle, args...);
      return result;
    } else if constexpr (std::is_void_v<Result>) {
      (calls.next.*Function)(handle, args...);
      if (!kTraits.ends_something && calls.recorder != nullptr) Observe::call(*calls.recorder, handle, args...);
    } else {
      return (calls.next.*Function)(handle, args...);
    }
  }
};

}  // namespace

CountedTable::CountedTable(VkDevice device, VkPhysicalDevice physical_device, PFN_vkGetDeviceProcAddr get_proc_addr)
    : calls_(std::make_unique<Calls>()) {
  table_.struct_size = calls_->next.struct_size = sizeof(heddle_vulkan);
  table_.device = calls_->next.device = device;
  table_.physical_device = calls_->next.physical_device = physical_device;
#define HEDDLE_WRAP(name)                                                                             \
  calls_->next.name = reinterpret_cast<PFN_vk##name>(get_proc_addr(device, "vk" #name));              \
  if (calls_->next.name != nullptr) {                                                                 \
    table_.name = Counted<&heddle_vulkan::name, Observe##name, traits_of(#name), PFN_vk##name>::call; \
  }
  HEDDLE_VULKAN_FUNCTIONS(HEDDLE_WRAP)
#undef HEDDLE_WRAP
  enlist(device, *calls_);
}

CountedTable::~CountedTable() {
  strike_off(table_.device);
}

Counters CountedTable::counters() const {
  return {.commands = calls_->commands,
          .draws = calls_->draws,
          .dispatches = calls_->dispatches,
          .barriers = calls_->barriers,
          .renderings = calls_->renderings,
          .barrier_parts = calls_->barrier_parts,
          .submits = calls_->submits,
          .pipelines = calls_->pipelines,
          .pipeline_ns = calls_->pipeline_ns,
          .live_pipelines = calls_->live_pipelines,
          .live_images = calls_->live_images,
          .live_buffers = calls_->live_buffers,
          .device_memory_bytes = calls_->device_memory_bytes,
          .uploaded_bytes = calls_->uploaded_bytes,
          .read_back_bytes = calls_->read_back_bytes};
}

void CountedTable::use_classic_passes(PFN_vkGetDeviceProcAddr get_proc_addr) {
  heddle_vulkan& next = calls_->next;
  calls_->classic = std::make_unique<ClassicPasses>(next, get_proc_addr);
  next.CreateImageView = [](VkDevice device, const VkImageViewCreateInfo* info, const VkAllocationCallbacks* allocator,
                            VkImageView* view) {
    return calls_of(device).classic->CreateImageView(info, allocator, view);
  };
  next.DestroyImageView = [](VkDevice device, VkImageView view, const VkAllocationCallbacks* allocator) {
    calls_of(device).classic->DestroyImageView(view, allocator);
  };
  next.CreateGraphicsPipelines = [](VkDevice device, VkPipelineCache cache, std::uint32_t count,
                                    const VkGraphicsPipelineCreateInfo* infos, const VkAllocationCallbacks* allocator,
                                    VkPipeline* pipelines) {
    return calls_of(device).classic->CreateGraphicsPipelines(cache, count, infos, allocator, pipelines);
  };
  next.CmdBeginRendering = [](VkCommandBuffer commands, const VkRenderingInfo* info) {
    calls_of(commands).classic->CmdBeginRendering(commands, info);
  };
  next.CmdEndRendering = [](VkCommandBuffer commands) { calls_of(commands).classic->CmdEndRendering(commands); };
}
void CountedTable::set_recorder(hazard::Recorder* recorder) {
  calls_->recorder = recorder;
}
void CountedTable::count_upload(std::uint64_t bytes) {
  add(calls_->uploaded_bytes, bytes);
}
void CountedTable::count_read_back(std::uint64_t bytes) {
  add(calls_->read_back_bytes, bytes);
}

}  // namespace heddle::vulkan
