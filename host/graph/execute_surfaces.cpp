// SPDX-License-Identifier: Apache-2.0
// Surfaces that techniques make: their batches, placed for a submission, and what snapshots need of their buffers.

#include "graph/execute_state.hpp"
#include "graph/uses.hpp"

#include <cstring>

namespace heddle::graph {

namespace {

template <typename Element>
std::span<const Element> elements(const vulkan::Buffer& copy, std::uint64_t head, std::uint64_t most) {
  if (!copy || copy.size() <= head) return {};
  const std::uint64_t count = std::min<std::uint64_t>((copy.size() - head) / sizeof(Element), most);
  return {reinterpret_cast<const Element*>(copy.data() + head), static_cast<std::size_t>(count)};
}

}  // namespace

void Executor::State::set_batches(ResourceIndex surfaces, std::vector<scene::MadeBatch> batches,
                                  std::uint64_t revision) {
  std::unique_ptr<SurfacesState>& made = resources[surfaces].made;
  if (!made) made = std::make_unique<SurfacesState>();
  // Draws of this submission that are recorded already read it.
  if (made->is_placed && made->instances) frame_buffers.push_back(std::move(made->instances));
  made->is_placed = false;
  made->surfaces.set(std::move(batches), revision);
}

const scene::PlacedBatches& Executor::State::place(SurfacesState& made) {
  if (made.is_placed) return made.placed;
  made.placed.update(*scene, *scene_buffers, made.surfaces, origin);
  made.is_placed = true;
  const auto bytes = std::as_bytes(made.placed.instances());
  if (bytes.empty()) return made.placed;
  if (!made.instances || made.instances.size() < bytes.size() || !in_flight.empty()) {
    if (made.instances) frame_buffers.push_back(std::move(made.instances));
    made.instances = device->make_buffer(bytes.size(), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true);
  }
  std::memcpy(made.instances.data(), bytes.data(), bytes.size());
  device->note_host_write(made.instances, 0, bytes.size());
  device->count_upload(bytes.size());
  return made.placed;
}

std::vector<ResourceIndex> Executor::State::made_versions(ResourceIndex surfaces) const {
  std::vector<ResourceIndex> versions;
  for (const ResourceIndex made : made_surfaces(graph, surfaces))
    if (resources[made].made && !resources[made].made->surfaces.batches.empty()) versions.push_back(made);
  return versions;
}

VkBuffer Executor::State::buffer_of(ResourceIndex buffer) const {
  return buffer == kNoIndex ? VK_NULL_HANDLE : resources[resources[buffer].root].buffer.handle();
}

/// Copies what a snapshot of the surfaces needs, if there is none of what they hold now, and what another port of the
/// stage had copied is not again. True if it recorded copies.
bool Executor::State::copy_contents(ResourceIndex surfaces, heddle_frame& frame) {
  const std::vector<ResourceIndex> versions = made_versions(surfaces);
  if (versions.empty()) return false;
  std::vector<const scene::MadeSurfaces*> made;
  made.reserve(versions.size());
  for (const ResourceIndex version : versions) made.push_back(&resources[version].made->surfaces);
  if (resources[versions.front()].made->snapshot.is_of(*scene, holds_scene(graph, surfaces), made, origin))
    return false;
  const std::size_t before = frame.contents.size();
  for (const ResourceIndex version : versions) {
    if (std::ranges::find(frame.contents, version, &heddle_frame::Contents::made) != frame.contents.end()) continue;
    heddle_frame::Contents contents;
    contents.made = version;
    const BatchBuffers buffers = batch_buffers_of(graph, version);
    const std::array all{buffers.vertices, buffers.indices, buffers.instances, buffers.commands};
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (i == 0 && evaluate_vertices(version, contents.copies[i])) continue;
      if (all[i] == kNoIndex) continue;
      contents.copies[i] = device->make_buffer(host_bytes(all[i]), VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
      copy_to_host(all[i], contents.copies[i]);
    }
    frame.contents.push_back(std::move(contents));
  }
  return frame.contents.size() > before;
}

const scene::Snapshot& Executor::State::take_snapshot(ResourceIndex surfaces, const heddle_frame& frame) {
  const std::vector<ResourceIndex> versions = made_versions(surfaces);
  if (versions.empty() && holds_scene(graph, surfaces)) {
    (void)snapshot.update(*scene);
    return snapshot;
  }
  std::vector<scene::MadeContents> all;
  for (const ResourceIndex version : versions) {
    scene::MadeContents made;
    made.surfaces = &resources[version].made->surfaces;
    const auto copied = std::ranges::find(frame.contents, version, &heddle_frame::Contents::made);
    if (copied != frame.contents.end()) {
      constexpr std::uint64_t kAll = ~0ULL;
      made.vertices = elements<HeddleVertex>(copied->copies[0], 0, kAll);
      made.indices = elements<std::uint32_t>(copied->copies[1], 0, kAll);
      made.instances = elements<HeddleInstance>(copied->copies[2], 0, kAll);
      const ResourceIndex commands_buffer = batch_buffers_of(graph, version).commands;
      const bool is_list = commands_buffer != kNoIndex && graph.resources[commands_buffer].is_list();
      std::uint32_t appended = ~0U;
      if (is_list) std::memcpy(&appended, copied->copies[3].data(), sizeof appended);
      made.commands = elements<VkDrawIndexedIndirectCommand>(copied->copies[3], is_list ? kListHead : 0, appended);
    }
    all.push_back(made);
  }
  // Surfaces that hold nothing at all have a snapshot too.
  scene::Snapshot& of = versions.empty() ? empty_snapshot : resources[versions.front()].made->snapshot;
  (void)of.update(*scene, holds_scene(graph, surfaces), all, origin);
  return of;
}

}  // namespace heddle::graph
