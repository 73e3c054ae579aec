// SPDX-License-Identifier: Apache-2.0
// The services by which techniques read images and read and make stores.
#include "graph/execute_calls.hpp"

#include <heddle/images.h>
#include <heddle/stores.h>

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>

namespace heddle::graph {

namespace {

/// The one that a handle stands for, nullptr after a report: handles are addresses, and plugins make mistakes.
template <typename Object>
Object* find_open(PassState& pass, const std::vector<std::shared_ptr<Object>>& open, const void* handle,
                  std::string_view what) {
  const auto found = std::ranges::find(open, handle, [](const auto& one) -> const void* { return one.get(); });
  if (found != open.end()) return found->get();
  wrong(pass, fmt::format("uses {} that is not open", what));
  return nullptr;
}

template <typename Object>
void forget(std::vector<std::shared_ptr<Object>>& open, const void* handle) {
  std::erase_if(open, [&](const auto& one) { return one.get() == handle; });
}

heddle_status open_image(const heddle_pass_host* self, const char* path, heddle_image_file** out) {
  PassState& pass = state_of(self);
  *out = nullptr;
  return guarded(pass, [&]() -> heddle_status {
    if (!is_in_key(pass, false, fmt::format("the file '{}'", path))) return HEDDLE_BUG;
    const Executor::State& executor = executor_of(pass);
    if (executor.graph.is_job && !executor.is_key_file(executor.pass_of(pass), path))
      return wrong(
          pass,
          fmt::format("asks for the image '{}', which no parameter names: what a job reads is part of its key", path));
    auto image = std::make_shared<image::OpenImage>((executor.graph.folder / path).lexically_normal());
    *out = reinterpret_cast<heddle_image_file*>(image.get());
    pass.images.push_back(std::move(image));
    return HEDDLE_OK;
  });
}

heddle_status image_level(const heddle_pass_host* self, heddle_image_file* file, std::uint32_t level,
                          heddle_image_level* out) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    const image::OpenImage* image = find_open(pass, pass.images, file, "an image");
    if (image == nullptr) return HEDDLE_BUG;
    heddle_image_level found = image->level(level);
    found.struct_size = std::min<std::uint32_t>(out->struct_size, sizeof found);
    std::memcpy(out, &found, found.struct_size);
    return HEDDLE_OK;
  });
}

heddle_status read_image(const heddle_pass_host* self, heddle_image_file* file, const heddle_image_part* part,
                         void* out, std::uint64_t row_bytes) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    const image::OpenImage* image = find_open(pass, pass.images, file, "an image");
    if (image == nullptr) return HEDDLE_BUG;
    heddle_image_part given{};
    std::memcpy(&given, part, std::min<std::size_t>(part->struct_size, sizeof given));
    image->read(given, out, row_bytes);
    return HEDDLE_OK;
  });
}

void close_image(const heddle_pass_host* self, heddle_image_file* file) {
  forget(state_of(self).images, file);
}

constexpr heddle_images_service kImagesService{
    sizeof(heddle_images_service), 0, open_image, image_level, read_image, close_image};

heddle_status make_store(const heddle_pass_host* self, heddle_frame* frame, const char* artifact, heddle_store** out) {
  PassState& pass = state_of(self);
  *out = nullptr;
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    const Pass& declared = executor.pass_of(pass);
    if (!executor.graph.is_job || frame == nullptr || pass.cached_stage != nullptr)
      return wrong(pass, "makes a store outside of a job's stages");
    const std::string port = artifact == nullptr ? "scratch" : artifact;
    if (artifact != nullptr) {
      const Port* own = executor.technique_of(pass).find_port(port);
      if (own == nullptr || own->type != PortType::kArtifact || own->direction != Direction::kOut ||
          !declared.ports.contains(port))
        return wrong(pass, fmt::format("makes a store beside '{}', which is none of its artifacts", port));
    }
    auto store = std::make_shared<StoreFile>(executor.new_store_file(pass.index, port));
    // What is open outlives its name, and nothing is left behind by a process that ends.
    if (artifact == nullptr) std::filesystem::remove(store->name());
    *out = reinterpret_cast<heddle_store*>(store.get());
    pass.stores.push_back(store);
    if (artifact != nullptr) pass.made_stores[port] = std::move(store);
    return HEDDLE_OK;
  });
}

heddle_status open_store(const heddle_pass_host* self, const char* artifact, heddle_store** out) {
  PassState& pass = state_of(self);
  *out = nullptr;
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    const Port* own = executor.technique_of(pass).find_port(artifact);
    if (own == nullptr || own->type != PortType::kArtifact || own->direction != Direction::kIn ||
        !is_in_key(pass, false, fmt::format("the store of '{}'", artifact)))
      return wrong(pass, fmt::format("asks for the store of '{}', which is no artifact that comes in", artifact));
    const auto bound = executor.pass_of(pass).ports.find(std::string_view(artifact));
    if (bound == executor.pass_of(pass).ports.end()) return HEDDLE_OK;
    const auto made = executor.lasting.find(executor.graph.resources[bound->second].name);
    if (made == executor.lasting.end() || made->second.store == nullptr) return HEDDLE_OK;
    auto store = std::make_shared<StoreFile>(made->second.store);
    *out = reinterpret_cast<heddle_store*>(store.get());
    pass.stores.push_back(std::move(store));
    return HEDDLE_OK;
  });
}

/// Calls `body` with the store that a handle stands for.
template <typename Body>
heddle_status with_store(const heddle_pass_host* self, const heddle_store* handle, const Body& body) {
  PassState& pass = state_of(self);
  return guarded(pass, [&]() -> heddle_status {
    StoreFile* store = find_open(pass, pass.stores, handle, "a store");
    if (store == nullptr) return HEDDLE_BUG;
    body(*store);
    return HEDDLE_OK;
  });
}

std::uint64_t store_size(const heddle_pass_host* self, heddle_store* store) {
  std::uint64_t bytes = 0;
  (void)with_store(self, store, [&](const StoreFile& file) { bytes = file.size(); });
  return bytes;
}

heddle_status write_store(const heddle_pass_host* self, heddle_store* store, std::uint64_t offset, const void* data,
                          std::uint64_t bytes) {
  return with_store(self, store, [&](StoreFile& file) {
    file.write(offset, {static_cast<const std::byte*>(data), bytes});
  });
}

heddle_status read_store(const heddle_pass_host* self, heddle_store* store, std::uint64_t offset, void* out,
                         std::uint64_t bytes) {
  return with_store(self, store, [&](StoreFile& file) { file.read(offset, {static_cast<std::byte*>(out), bytes}); });
}

heddle_status request_store(const heddle_pass_host* self, heddle_store* store, std::uint64_t offset,
                            std::uint64_t bytes, std::uint64_t* out_ticket) {
  return with_store(self, store, [&](StoreFile& file) { *out_ticket = file.request(offset, bytes); });
}

heddle_status collect_store(const heddle_pass_host* self, heddle_store* store, std::uint64_t ticket,
                            std::uint32_t is_due, const void** out) {
  *out = nullptr;
  const bool is_live = executor_of(state_of(self)).services.is_live;
  if (!is_live && is_due == 0) return HEDDLE_OK;
  return with_store(self, store, [&](StoreFile& file) { *out = file.collect(ticket, !is_live); });
}

void release_store(const heddle_pass_host* self, heddle_store* store, std::uint64_t ticket) {
  (void)with_store(self, store, [&](StoreFile& file) { file.release(ticket); });
}

void store_counts(const heddle_pass_host* self, heddle_store* store, heddle_store_counts* out) {
  (void)with_store(self, store, [&](const StoreFile& file) {
    heddle_store_counts found = file.counts();
    found.struct_size = std::min<std::uint32_t>(out->struct_size, sizeof found);
    std::memcpy(out, &found, found.struct_size);
  });
}

const char* store_file(const heddle_pass_host* self, heddle_store* store) {
  const char* name = "";
  (void)with_store(self, store, [&](const StoreFile& file) { name = file.name(); });
  return name;
}

void close_store(const heddle_pass_host* self, heddle_store* store) {
  forget(state_of(self).stores, store);
}

constexpr heddle_stores_service kStoresService{sizeof(heddle_stores_service),
                                               0,
                                               make_store,
                                               open_store,
                                               store_size,
                                               write_store,
                                               read_store,
                                               request_store,
                                               collect_store,
                                               release_store,
                                               store_counts,
                                               store_file,
                                               close_store};

}  // namespace

const void* files_service(std::string_view id) {
  if (id == HEDDLE_IMAGES_SERVICE) return &kImagesService;
  if (id == HEDDLE_STORES_SERVICE) return &kStoresService;
  return nullptr;
}

/// Beside the artifacts, where it will stay; of what is not kept, where temporary files are.
std::filesystem::path Executor::State::new_store_file(PassIndex pass, std::string_view port) const {
  if (keeps_artifacts() && services.artifacts.keeps_anything())
    return services.artifacts.new_store(pass_keys[pass], port);
  static std::atomic<std::uint32_t> count = 0;
  return std::filesystem::temp_directory_path() / fmt::format("heddle.{}.{}.{}.store", ::getpid(), count++, port);
}

/// The stores that a pass has made take their places, and its artifact's parts say how large they are.
std::map<std::string, std::shared_ptr<StorePlace>, std::less<>> Executor::State::keep_stores(
    PassIndex pass, ArtifactViews& parts, std::deque<std::uint64_t>& sizes) {
  std::map<std::string, std::shared_ptr<StorePlace>, std::less<>> places;
  PassState& state = *passes[pass];
  for (const auto& [port, store] : state.made_stores) {
    const bool stays = keeps_artifacts() && services.artifacts.keeps_anything();
    const std::filesystem::path file = stays ? services.artifacts.store(pass_keys[pass], port) : store->name();
    store->keep_as(file);
    places[port] = std::make_shared<StorePlace>(file, store->size(), !stays);
    sizes.push_back(store->size());
    parts[port + std::string(kStorePart)] = std::as_bytes(std::span(&sizes.back(), 1));
    forget(state.stores, store.get());
  }
  state.made_stores.clear();
  return places;
}

}  // namespace heddle::graph
