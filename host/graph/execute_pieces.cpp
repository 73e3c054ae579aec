// SPDX-License-Identifier: Apache-2.0
// Pieces of artifacts, and what they are keyed by: the surfaces of a port, one item an instance, by content.
#include "graph/execute_calls.hpp"

#include "content_hash.hpp"
#include "graph/execute_keys.hpp"
#include "graph/uses.hpp"

#include <heddle/pieces.h>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace heddle::graph {

namespace {

/// Raised where a piece of before would be taken for what is made now.
constexpr std::string_view kPieceFormat = "heddle piece 1", kPackFormat = "heddle pieces 1";
/// Beside what a run has asked for, older pieces stay as long as a pack is not larger than this, or than twice as much.
constexpr std::uint64_t kRoomForOld = 64U << 20;
constexpr std::size_t kKeyDigits = 32;

void set_content(heddle_surface_item& item, const ContentHash& hash) {
  const std::string digits = hash.hexadecimal();
  for (std::size_t word = 0; word < 2; ++word)
    std::from_chars(digits.data() + 16 * word, digits.data() + 16 * (word + 1), item.content[word], 16);
}

/// Of a mesh's triangles, with what makes holes in them.
ContentHash hash_of_shape(const scene::Scene& scene, const scene::Mesh& mesh) {
  ContentHash hash;
  const HeddleMaterial& material = scene.materials.at(mesh.material).record;
  const std::uint32_t flags = scene::surface_flags(material);
  hash.add({reinterpret_cast<const char*>(&flags), sizeof flags});
  hash.add_long(std::as_bytes(std::span(mesh.indices)));
  if ((flags & HEDDLE_SURFACE_MASKED) == 0) {
    std::vector<float> positions;
    positions.reserve(3 * mesh.vertices.size());
    for (const HeddleVertex& vertex : mesh.vertices)
      positions.insert(positions.end(), std::begin(vertex.position), std::end(vertex.position));
    hash.add_long(std::as_bytes(std::span(positions)));
    return hash;
  }
  hash.add_long(std::as_bytes(std::span(mesh.vertices)));
  hash.add({reinterpret_cast<const char*>(&material), sizeof material});
  const std::uint32_t index = scene.materials[mesh.material].textures[HEDDLE_TEXTURE_BASE_COLOR];
  if (index >= scene.textures.size()) return hash;
  const scene::Texture& texture = scene.textures[index];
  for (const std::uint32_t number : {texture.width, texture.height, texture.wrap[0], texture.wrap[1], texture.filter})
    hash.add({reinterpret_cast<const char*>(&number), sizeof number});
  hash.add_long(std::as_bytes(std::span(texture.rgba)));
  return hash;
}

std::vector<heddle_surface_item> items_of(const scene::Scene& scene) {
  std::vector<std::string> shapes(scene.meshes.size());
  std::vector<heddle_surface_item> items;
  for (std::uint32_t i = 0; i < scene.instances.size(); ++i) {
    const scene::Instance& instance = scene.instances[i];
    const scene::Mesh& mesh = scene.meshes.at(instance.mesh);
    std::string& shape = shapes[instance.mesh];
    if (shape.empty()) shape = hash_of_shape(scene, mesh).hexadecimal();
    heddle_surface_item item{};
    item.struct_size = sizeof item;
    item.instance = i;
    item.flags = scene::surface_flags(scene.materials.at(mesh.material).record);
    std::fill_n(item.low, 3, HUGE_VAL);
    std::fill_n(item.high, 3, -HUGE_VAL);
    // As it is posed now: what a mesh kept of its bounds may be those of another pose.
    glm::dvec3 low(HUGE_VAL), high(-HUGE_VAL);
    for (const HeddleVertex& vertex : mesh.vertices) {
      const glm::dvec3 at(vertex.position[0], vertex.position[1], vertex.position[2]);
      low = glm::min(low, at);
      high = glm::max(high, at);
    }
    for (int corner = 0; corner < 8 && !mesh.vertices.empty(); ++corner) {
      const glm::dvec3 at(instance.scene_from_object * glm::dvec4((corner & 1) != 0 ? low.x : high.x,
                                                                  (corner & 2) != 0 ? low.y : high.y,
                                                                  (corner & 4) != 0 ? low.z : high.z, 1.0));
      for (int axis = 0; axis < 3; ++axis) {
        item.low[axis] = std::min(item.low[axis], at[axis]);
        item.high[axis] = std::max(item.high[axis], at[axis]);
      }
    }
    ContentHash hash;
    hash.add(shape);
    hash.add({reinterpret_cast<const char*>(&instance.scene_from_object), sizeof instance.scene_from_object});
    set_content(item, hash);
    items.push_back(item);
  }
  return items;
}

/// Whether the call is one of a job's pass that makes what lasts.
bool is_of_artifacts(const PassState& pass, std::string_view what) {
  const Executor::State& executor = executor_of(pass);
  if (executor.graph.is_job && makes_what_lasts(executor.technique_of(pass))) return true;
  wrong(pass, fmt::format("asks for {}, which only passes that make artifacts do", what));
  return false;
}

heddle_status surface_items(const heddle_pass_host* self, heddle_frame*, const char* port,
                            const heddle_surface_item** out, std::uint32_t* out_count) {
  PassState& pass = state_of(self);
  if (!is_of_artifacts(pass, "the items of a port")) return HEDDLE_BUG;
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    const Pass& asking = executor.pass_of(pass);
    const Port* declared = executor.technique_of(pass).find_port(port);
    if (declared == nullptr || declared->type != PortType::kSurfaces)
      return wrong(pass, fmt::format("asks for the items of '{}', which is no port of its of type surfaces", port));
    std::vector<heddle_surface_item>& items = executor.surface_items;
    items.clear();
    if (const auto bound = asking.ports.find(port); bound != asking.ports.end()) {
      if (holds_scene(executor.graph, bound->second)) items = items_of(*executor.scene);
      bool is_made = false;
      for (const ResourceIndex version : executor.made_versions(bound->second))
        for (const scene::MadeBatch& batch : executor.resources[version].made->surfaces.batches) {
          is_made = is_made || batch.record.index_count > 0 || batch.placed.empty();
          std::erase_if(items, [&](const heddle_surface_item& item) {
            return std::ranges::binary_search(batch.placed, item.instance);
          });
        }
      if (is_made) {
        // What a pass makes is known by what went into it alone, of which the asking pass's own key holds all.
        heddle_surface_item made{};
        made.struct_size = sizeof made;
        made.instance = HEDDLE_NO_INSTANCE;
        made.flags = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_MASKED | HEDDLE_SURFACE_BLENDED;
        std::fill_n(made.low, 3, -HUGE_VAL);
        std::fill_n(made.high, 3, HUGE_VAL);
        ContentHash hash;
        hash.add(executor.pass_keys[pass.index]);
        set_content(made, hash);
        items.push_back(made);
      }
    }
    *out = items.data();
    *out_count = static_cast<std::uint32_t>(items.size());
    return HEDDLE_OK;
  });
}

std::string piece_key(const void* key, std::uint64_t bytes) {
  ContentHash hash;
  hash.add(kPieceFormat);
  hash.add_long({static_cast<const std::byte*>(key), bytes});
  return hash.hexadecimal();
}

std::string pack_key(const std::string& code) {
  ContentHash hash;
  hash.add(kPackFormat);
  hash.add(code);
  return hash.hexadecimal();
}

heddle_status find_piece(const heddle_pass_host* self, heddle_frame*, const void* key, std::uint64_t key_bytes,
                         const void** out, std::uint64_t* out_bytes) {
  PassState& pass = state_of(self);
  *out = nullptr;
  *out_bytes = 0;
  if (!is_of_artifacts(pass, "a piece of its artifact")) return HEDDLE_BUG;
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    if (executor.services.remakes_artifacts || !executor.keeps_artifacts()) return HEDDLE_OK;
    auto& pieces = executor.pieces_of(pass.index).pieces;
    const auto found = pieces.find(piece_key(key, key_bytes));
    if (found == pieces.end()) return HEDDLE_OK;
    found->second.age = 0;
    *out = found->second.bytes.data();
    *out_bytes = found->second.bytes.size();
    return HEDDLE_OK;
  });
}

heddle_status keep_piece(const heddle_pass_host* self, heddle_frame*, const void* key, std::uint64_t key_bytes,
                         const void* data, std::uint64_t bytes) {
  PassState& pass = state_of(self);
  if (!is_of_artifacts(pass, "a piece of its artifact")) return HEDDLE_BUG;
  return guarded(pass, [&]() -> heddle_status {
    Executor::State& executor = executor_of(pass);
    if (!executor.keeps_artifacts()) return HEDDLE_OK;
    PiecePack& pack = executor.pieces_of(pass.index);
    const auto* first = static_cast<const std::byte*>(data);
    pack.pieces.insert_or_assign(piece_key(key, key_bytes), PiecePack::Piece{{first, first + bytes}, 0});
    pack.is_changed = true;
    return HEDDLE_OK;
  });
}

constexpr heddle_pieces_service kPiecesService{sizeof(heddle_pieces_service), 0, surface_items, find_piece, keep_piece};

}  // namespace

const void* pieces_service(std::string_view id) {
  return id == HEDDLE_PIECES_SERVICE ? &kPiecesService : nullptr;
}

/// What earlier runs of the pass's technique have kept, read when it is first asked for.
PiecePack& Executor::State::pieces_of(PassIndex index) {
  const auto [known, is_new] = piece_packs.try_emplace(pass_codes[index]);
  if (!is_new) return known->second;
  const std::string key = pack_key(pass_codes[index]);
  std::string damage;
  std::optional<ArtifactParts> parts = services.artifacts.read(key, damage);
  if (!damage.empty())
    warn(graph.passes[index], fmt::format("the pieces {} are damaged: {}; they are made again",
                                          services.artifacts.file(key).string(), damage));
  if (!parts) return known->second;
  for (auto& [name, bytes] : *parts) {  // the key's digits, then the age
    if (name.size() <= kKeyDigits) continue;
    PiecePack::Piece piece{std::move(bytes), 0};
    std::from_chars(name.data() + kKeyDigits, name.data() + name.size(), piece.age);
    ++piece.age;
    known->second.pieces.emplace(name.substr(0, kKeyDigits), std::move(piece));
  }
  return known->second;
}

/// What the run has asked for, and, as far as there is room, what earlier ones have, the latest first.
void Executor::State::keep_pieces(PassIndex index) {
  const auto known = piece_packs.find(pass_codes[index]);
  if (known == piece_packs.end() || !known->second.is_changed) return;
  std::vector<const std::pair<const std::string, PiecePack::Piece>*> all;
  for (const auto& one : known->second.pieces) all.push_back(&one);
  std::ranges::stable_sort(all, {}, [](const auto* one) { return one->second.age; });
  std::uint64_t used = 0, total = 0;
  for (const auto* one : all) used += one->second.age == 0 ? one->second.bytes.size() : 0;
  ArtifactViews parts;
  for (const auto* one : all) {
    total += one->second.bytes.size();
    if (one->second.age > 0 && total > std::max(kRoomForOld, 2 * used)) break;
    parts[fmt::format("{}{}", one->first, one->second.age)] = one->second.bytes;
  }
  // The artifact that the pieces are of comes after them, and makes room.
  const std::string problem = services.artifacts.write(pack_key(pass_codes[index]), parts, /*makes_room=*/false);
  if (!problem.empty()) warn(graph.passes[index], problem + "; pieces of what it makes will be made again next time");
}

}  // namespace heddle::graph
