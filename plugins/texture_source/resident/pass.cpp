// SPDX-License-Identifier: Apache-2.0
// texture_source/resident: whole textures with all of their levels in memory, made once: the reference.
#include "stored_textures.hpp"
#include "texture_materials.hpp"

#include <heddle/pass.hpp>

#include <bit>
#include <cstring>

namespace {

using namespace heddle::pass;
namespace tiles = heddle::texture_tiles;
namespace blocks = heddle::block_compression;

constexpr const char* kFilters[] = {"nearest", "bilinear", "trilinear", nullptr};
constexpr double kFilterLadder[] = {0, 1, 2};
constexpr double kAnisotropyLadder[] = {1, 2, 4, 8, 16};
constexpr heddle_parameter kParameters[] = {
    knob(choice("filtering", kFilters, 1, "of texels, and between levels"), kFilterLadder),
    knob(integer("anisotropy", "1", 1, 16, 4, "taps along a pixel's long axis, at most"), kAnisotropyLadder),
    parameter("bias", "1", 0, 1, 0, "levels are rounded up less it: 0 never finer than pixels, 1 never coarser"),
    integer("coarsest", "px", 1, 256, 128,
            "texels along each side of the last level: what the technique that is "
            "compared has as its tile",
            HEDDLE_PARAMETER_REDECLARE),
};

constexpr std::uint32_t kMostTextures = 4;
constexpr std::uint32_t kMostExtent = 8192;  // 358 MB with all levels
constexpr const char* kTextures[kMostTextures] = {"texture_0", "texture_1", "texture_2", "texture_3"};
constexpr const char* kHelp = "a texture with all of its levels";
constexpr heddle_port texture_out(const char* name) {
  return image_out_sized(name, VK_FORMAT_R8G8B8A8_SRGB, 1, 1, kHelp, HEDDLE_PORT_KEPT);
}
constexpr heddle_port kPorts[] = {
    artifact_in("store", "textures on disk, for materials whose source is stored", HEDDLE_PORT_OPTIONAL),
    value_out("resident_materials", 32, "which material shows what", "uvec4 resident_materials[];"),
    texture_out("texture_0"),
    texture_out("texture_1"),
    texture_out("texture_2"),
    texture_out("texture_3"),
};
constexpr heddle_access kMakeAccesses[] = {value("store"), host_write("texture_0"), host_write("texture_1"),
                                           host_write("texture_2"), host_write("texture_3")};
constexpr heddle_access kPlaceAccesses[] = {value("resident_materials")};
constexpr heddle_access kFunctionAccesses[] = {value("resident_materials"), sampled("texture_0"), sampled("texture_1"),
                                               sampled("texture_2"), sampled("texture_3")};
enum : std::uint32_t { kMake, kPlace };
constexpr heddle_stage kStages[] = {cpu_stage("make", kMakeAccesses), cpu_stage("place", kPlaceAccesses)};
constexpr heddle_function kFunctions[] = {function("texture_source", "resident.glsl", kFunctionAccesses)};

class Resident {
 public:
  heddle_status declare(const PassHost& host) {
    heddle_status status = stored_.open(host);
    if (status != HEDDLE_OK) return status;
    status = tiles::scene_textures(host, nullptr, stored_.is_open() ? &stored_.store() : nullptr, scene_);
    if (status != HEDDLE_OK) return status;
    const auto coarsest = std::bit_floor(static_cast<std::uint32_t>(host.integer("coarsest")));
    if (scene_.textures.size() > kMostTextures)
      return host.fail(HEDDLE_UNSUPPORTED, "the scene has " + std::to_string(scene_.textures.size()) +
                                               " textures, and this technique keeps " + std::to_string(kMostTextures) +
                                               " at most; texture_source/virtual has no such bound");
    levels_.clear();
    for (std::size_t i = 0; i < scene_.textures.size(); ++i) {
      const std::uint32_t extent = scene_.textures[i].extent;
      if (extent > kMostExtent)
        return host.fail(HEDDLE_UNSUPPORTED,
                         "a texture of " + std::to_string(extent) + " px is larger than " +
                             std::to_string(kMostExtent) +
                             ", the most that this technique keeps; texture_source/virtual shows it");
      heddle_shape shape{};
      shape.width = shape.height = extent;
      // A store's levels end at one tile.
      const bool is_stored = scene_.textures[i].source == tiles::kStored;
      const std::uint32_t last = is_stored ? std::max(coarsest, stored_.store().header.tile) : coarsest;
      shape.mips = static_cast<std::uint32_t>(std::countr_zero(std::max(extent / last, 1U))) + 1;
      levels_.push_back(shape.mips);
      if (status == HEDDLE_OK) status = host.set_shape(kTextures[i], shape);
    }
    heddle_shape materials{};
    materials.byte_size = std::max(1U, tiles::material_end(scene_)) * std::uint64_t{32};
    return status == HEDDLE_OK ? host.set_shape("resident_materials", materials) : status;
  }

  heddle_status prepare(const PassHost&) {
    is_made_ = false;
    return HEDDLE_OK;
  }

  std::uint32_t activity(const Frame& frame) const {
    return frame.stage() == kMake && is_made_ ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  heddle_status execute(const Frame& frame) { return frame.stage() == kMake ? make(frame) : place(frame); }

 private:
  heddle_status make(const Frame& frame) {
    std::vector<tiles::Rgba8> row;
    for (std::size_t i = 0; i < kMostTextures; ++i) {
      heddle_mapped mapped{};
      if (const heddle_status status = frame.map(kTextures[i], mapped); status != HEDDLE_OK) return status;
      auto* out = static_cast<std::byte*>(mapped.data);
      if (i >= scene_.textures.size()) {
        std::memset(out, 0, mapped.row_bytes);
        continue;
      }
      for (std::uint32_t level = 0; level < levels_[i]; ++level) {
        const std::uint32_t extent = scene_.textures[i].extent >> level;
        const bool is_stored = scene_.textures[i].source == tiles::kStored;
        const std::uint32_t at_a_time = is_stored ? stored_.store().header.tile : kRows;
        for (std::uint32_t y = 0; y < extent; y += at_a_time) {
          const std::uint32_t rows = std::min(at_a_time, extent - y);
          if (is_stored) {
            const heddle_status status =
                read_rows(frame.host(), scene_.textures[i].image, level, y / at_a_time, extent, row);
            if (status != HEDDLE_OK) return status;
          } else {
            tiles::make_texels(scene_.textures[i], level, 0, y, extent, rows, row);
          }
          std::memcpy(out, row.data(), row.size() * sizeof(tiles::Rgba8));
          out += row.size() * sizeof(tiles::Rgba8);
          const double done = static_cast<double>(y + rows) / extent;
          if (const heddle_status status = frame.progress(level == 0 ? 0.75 * done : 0.75); status != HEDDLE_OK)
            return status;
        }
      }
    }
    is_made_ = true;
    return HEDDLE_OK;
  }

  /// A row of tiles without their borders.
  heddle_status read_rows(const PassHost& host, std::uint32_t image, std::uint32_t level, std::uint32_t tile_y,
                          std::uint32_t extent, std::vector<tiles::Rgba8>& out) {
    const heddle::texture_store::Store& store = stored_.store();
    const std::uint32_t tile = store.header.tile, border = store.header.border, pitch = store.pitch();
    out.resize(std::size_t{extent} * tile);
    texels_.resize(std::size_t{pitch} * pitch);
    for (std::uint32_t tile_x = 0; tile_x < extent / tile; ++tile_x) {
      if (const heddle_status status = stored_.read(host, image, level, tile_x, tile_y, bytes_); status != HEDDLE_OK)
        return status;
      blocks::decode(store.header.compression, bytes_.data(), pitch, pitch, first_byte(texels_));
      for (std::uint32_t y = 0; y < tile; ++y)
        std::copy_n(texels_.begin() + std::size_t{pitch} * (y + border) + border, tile,
                    out.begin() + std::size_t{extent} * y + std::size_t{tile} * tile_x);
    }
    return HEDDLE_OK;
  }

  [[nodiscard]] heddle_status place(const Frame& frame) const {
    std::vector<std::uint32_t> words(std::size_t{8} * std::max(1U, tiles::material_end(scene_)), 0);
    for (const tiles::MaterialTexture& material : scene_.materials) {
      const tiles::Texture& texture = scene_.textures[material.texture];
      std::uint32_t* record = words.data() + std::size_t{8} * material.material;
      record[0] = material.texture;
      record[1] = static_cast<std::uint32_t>(std::countr_zero(texture.extent)) | texture.address << 8U;
      record[2] = std::bit_cast<std::uint32_t>(static_cast<float>(material.chart_size));
      const bool is_vertex_centred =
          texture.source == tiles::kStored && heddle::mip_kernels::is_vertex_centred(stored_.store().header.kernel);
      record[3] = 1 | (is_vertex_centred ? 2U : 0U);
      record[4] = material.chart_x;
      record[5] = material.chart_y;
      record[6] = levels_[material.texture] - 1;
    }
    return frame.set_value("resident_materials", std::span<const std::uint32_t>(words));
  }

  static constexpr std::uint32_t kRows = 16;  // at a time
  heddle::texture_store::StoredTextures stored_;
  std::vector<std::byte> bytes_;      // of a tile
  std::vector<tiles::Rgba8> texels_;  // of it, decoded
  tiles::SceneTextures scene_;
  std::vector<std::uint32_t> levels_;  // of each texture
  bool is_made_ = false;
};

constexpr heddle_technique kResident = [] {
  heddle_technique t =
      technique<Resident>("texture_source/resident", "Whole textures with all of their levels",
                          "Williams 1983, Pyramidal Parametrics", kPorts, kParameters, kStages, kFunctions);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  t.features = tiles::kComponent;
  t.components = tiles::kComponent;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kResident)
