// SPDX-License-Identifier: Apache-2.0
// texture_source/virtual: what pixels asked for some frames ago to tiles in a cache, and the function that looks them
// up and asks for more. Nothing waits: what is not there yet shows its nearest ancestor that is.
#include "texture_materials.hpp"
#include "tile_reader.hpp"
#include "uv_tree.hpp"

#include <heddle/counters.h>
#include <heddle/meshes.hpp>
#include <heddle/pass.hpp>

#include <bit>
#include <cstring>
#include <limits>
#include <map>
#include <span>
#include <utility>

namespace {

using namespace heddle::pass;
namespace tiles = heddle::texture_tiles;
namespace blocks = heddle::block_compression;
using heddle::virtual_texture::Changes;
using heddle::virtual_texture::Looker;
using heddle::virtual_texture::Residency;
using heddle::virtual_texture::Tile;
using heddle::virtual_texture::TileReader;
using heddle::virtual_texture::UvTree;

constexpr const char* kFilters[] = {"nearest", "bilinear", "trilinear", nullptr};
constexpr const char* kTiles[] = {"64", "128", "256", nullptr};
constexpr std::uint32_t kTileSizes[] = {64, 128, 256};
constexpr const char* kSpacings[] = {"16", "8", "4", "2", nullptr};
constexpr std::uint32_t kSpacingLog2[] = {4, 3, 2, 1};
constexpr const char* kUploads[] = {"one_copy", "copy_each", nullptr};
constexpr const char* kTables[] = {"gpu", "cpu", nullptr};
constexpr const char* kQueries[] = {"view", "tree", "both", "draws", "map", nullptr};
enum : std::uint32_t { kView, kTree, kBoth, kDraws, kMap };
constexpr double kFilterLadder[] = {0, 1, 2};
constexpr double kAnisotropyLadder[] = {1, 2, 4, 8, 16};
constexpr double kUploadsLadder[] = {4, 8, 16, 32, 64};
constexpr double kSpacingLadder[] = {0, 1, 2, 3};

constexpr double kMostFade = 10;  // s

constexpr heddle_parameter kParameters[] = {
    knob(choice("filtering", kFilters, 1, "of texels, and between levels"), kFilterLadder),
    knob(integer("anisotropy", "1", 1, 16, 4, "taps along a pixel's long axis, at most; twice the border at most"),
         kAnisotropyLadder),
    parameter("bias", "1", 0, 1, 0, "levels are rounded up less it: 0 never finer than pixels, 1 never coarser"),
    choice("tile", kTiles, 1, "texels along each side of a tile, without its border", HEDDLE_PARAMETER_REDECLARE),
    integer("border", "px", 0, 16, 4, "of each tile, its neighbours' texels; 0: seams show",
            HEDDLE_PARAMETER_REDECLARE),
    integer("cache", "px", 128, 8192, 2048, "side of the image that tiles are in", HEDDLE_PARAMETER_REDECLARE),
    toggle("compressed", true, "tiles of a compressed store stay so in the cache; no: unpacked where they come",
           HEDDLE_PARAMETER_REDECLARE),
    knob(integer("uploads", "1", 1, 256, 16, "tiles that arrive in one frame, at most", HEDDLE_PARAMETER_REDECLARE),
         kUploadsLadder),
    knob(choice("spacing", kSpacings, 1, "of each square of so many pixels a side one asks in a frame"),
         kSpacingLadder),
    choice("copies", kUploads, 0, "of tiles into the cache: one command for all of a frame's, or one for each"),
    choice(
        "table", kTables, 0,
        "who edits it: gpu, a list of squares that shaders fill; cpu, a copy of it from which changed cells are sent",
        HEDDLE_PARAMETER_REDECLARE),
    choice("query", kQueries, 0,
           "what says which tiles are wanted: pixels that are drawn; a tree over the texture that knows where in the "
           "world it lies, for input eye; both; draws: all that an instance shows, by the distance of its nearest "
           "place; map: "
           "every texel of a map over the texture, by where it lies"),
    toggle("turning", false, "tree: also what lies around and behind, for a view that turns"),
    integer("window", "1", 1, 1024, 64, "frames for which a tile is wanted after a pixel has asked for it"),
    integer("read_frames", "1", 1, 16, 2, "from the wish for a stored tile to its arrival, at least"),
    parameter("fade", "s", 0, kMostFade, 0.25, "until a tile that has come hides its parent"),
};

constexpr std::uint32_t kLatency = 2;
constexpr std::uint32_t kFirstRequests = 4096;  // declare does not know how many pixels there are
constexpr std::uint32_t kMostRequests = 1U << 22U;
constexpr std::uint32_t kMostUpdate = 65536;                        // bytes of one update of a buffer
constexpr std::uint64_t kMostTableBytes = std::uint64_t{1} << 27U;  // that every device lets a shader see
constexpr std::uint32_t kFillThreads = 256;
constexpr std::uint32_t kGroupsInRow = 32768;   // as fill.comp.glsl has it
constexpr std::uint32_t kMostSlotsInRow = 256;  // entries have 8 bits
constexpr std::size_t kMostTimesSlots = 4;      // tiles that a tree names, for each slot that there is
constexpr std::uint32_t kTrilinear = 2;         // of kFilters
constexpr float kLongAgo = -1e9F;               // s

/// As virtual.glsl reads it.
struct State {
  std::uint32_t layout[4];  // tile, its logarithm, border, slots in a row
  std::uint32_t query[4];   // spacing, offset x, y
  float time[4];            // 1 / fade, the fade's clock
};

constexpr heddle_port kPorts[] = {
    value_in("eye", "the view that the tree looks from", HEDDLE_PORT_OPTIONAL),
    artifact_in("store", "textures on disk, for materials whose source is stored", HEDDLE_PORT_OPTIONAL),
    value_out("virtual_materials", 32, "which material shows what", "uvec4 virtual_materials[];"),
    value_out("virtual_state", sizeof(State), "layout of the cache, pixels that ask, time",
              "uvec4 virtual_layout; uvec4 virtual_query; vec4 virtual_time;"),
    value_out("tile_edits", 16, "tiles that came or went", "uvec4 tile_edits[];"),
    buffer_out("tile_staging", 4, "uint tile_staging[];", "texels of tiles on their way"),
    image_out_sized("tile_cache", VK_FORMAT_R8G8B8A8_SRGB, 1024, 1024, "resident tiles with their borders",
                    HEDDLE_PORT_KEPT),
    buffer_out("tile_table", 4, "uint tile_table[];", "slot and level for each tile of each level", HEDDLE_PORT_KEPT),
    buffer_out("slot_births", 4, "float slot_births[];", "when the tile of a slot came", HEDDLE_PORT_KEPT),
    list_out("requests", kFirstRequests, 8, "uvec2 requests[];", "tiles that pixels of this frame asked for"),
};

constexpr heddle_access kManageAccesses[] = {host_read("requests"),      value("store"),         value("eye"),
                                             value("virtual_materials"), value("virtual_state"), value("tile_edits")};
constexpr heddle_access kStageAccesses[] = {transfer_write("tile_staging")};
constexpr heddle_access kUploadAccesses[] = {transfer_read("tile_staging"), transfer_write("tile_cache")};
constexpr heddle_access kPublishAccesses[] = {value("tile_edits"), storage_write("tile_table"),
                                              transfer_write("slot_births")};
constexpr heddle_access kRewriteAccesses[] = {transfer_write("tile_table")};
constexpr heddle_access kFunctionAccesses[] = {
    value("virtual_materials"),   value("virtual_state"),      storage_read("tile_table"),
    sampled_linear("tile_cache"), storage_read("slot_births"), appended("requests"),
};

// Texels are in the cache before an entry of the table names them.
enum : std::uint32_t { kManage, kStage, kUpload, kPublish, kRewrite };
constexpr heddle_stage kStages[] = {
    late(kLatency, cpu_stage("manage", kManageAccesses)),
    gpu_stage("stage", kStageAccesses),
    gpu_stage("upload", kUploadAccesses),
    gpu_stage("publish", kPublishAccesses),
    gpu_stage("rewrite", kRewriteAccesses),
};
constexpr heddle_shader kShaders[] = {compute_shader("fill", "publish", "fill.comp.glsl")};
constexpr heddle_function kFunctions[] = {function("texture_source", "virtual.glsl", kFunctionAccesses)};

struct Push {
  std::uint32_t first;
};

class Virtual {
 public:
  heddle_status declare(const PassHost& host) {
    const Layout before = layout();
    heddle_status status = stored_.open(host);
    if (status != HEDDLE_OK) return status;
    status = tiles::scene_textures(host, nullptr, stored_.is_open() ? &stored_.store() : nullptr, scene_);
    if (status != HEDDLE_OK) return status;
    // Tiles of a store are as they are, and all others are as those.
    tile_ = stored_.is_open() ? stored_.store().header.tile : kTileSizes[host.choice("tile")];
    border_ = stored_.is_open() ? stored_.store().header.border : static_cast<std::uint32_t>(host.integer("border"));
    format_ = stored_.is_open() && host.toggle("compressed") ? stored_.store().header.compression : blocks::kNone;
    uploads_ = static_cast<std::uint32_t>(host.integer("uploads"));
    edits_by_ = host.choice("table");
    const auto side = static_cast<std::uint32_t>(host.integer("cache"));
    in_row_ = std::min(side / pitch(), kMostSlotsInRow);
    const std::uint32_t textures = static_cast<std::uint32_t>(scene_.textures.size());
    if (in_row_ * in_row_ < textures + 1)
      return host.fail(HEDDLE_BAD_INPUT,
                       "a cache of " + std::to_string(side) + " px has room for " + std::to_string(in_row_ * in_row_) +
                           " tiles of " + std::to_string(pitch()) + " px with borders, and " +
                           std::to_string(textures) + " textures need more than one each: raise params.cache");
    // What is kept stays where its shape and meaning do: a longer list of requests changes neither.
    if (layout() != before) {
      residency_.reset();
      status = read_roots(host);
      if (status != HEDDLE_OK) return status;
    }
    first_cells_.clear();
    std::uint64_t cells = 0;
    for (const tiles::Texture& texture : scene_.textures) {
      first_cells_.push_back(static_cast<std::uint32_t>(cells));
      cells += cells_below(tiles::tile_levels(texture.extent, tile_));
    }
    if (cells * 4 > kMostTableBytes)
      return host.fail(HEDDLE_BAD_INPUT, "the tables of " + std::to_string(textures) + " textures need " +
                                             std::to_string(cells * 4 >> 20U) + " MiB, and the most is " +
                                             std::to_string(kMostTableBytes >> 20U) + ": raise params.tile");
    heddle_shape cache{};
    cache.width = cache.height = in_row_ * pitch();
    cache.format = format_ == blocks::kBc1   ? VK_FORMAT_BC1_RGB_SRGB_BLOCK
                   : format_ == blocks::kBc7 ? VK_FORMAT_BC7_SRGB_BLOCK
                                             : VK_FORMAT_R8G8B8A8_SRGB;
    status = host.set_shape("tile_cache", cache);
    const std::pair<const char*, std::uint64_t> sizes[] = {
        {"virtual_materials", std::max(1U, tiles::material_end(scene_)) * std::uint64_t{32}},
        {"tile_edits", std::uint64_t{16} * edit_room()},
        {"tile_staging", tile_bytes() * (uploads_ + textures)},
        {"tile_table", std::max<std::uint64_t>(cells, 1) * 4},
        {"slot_births", std::uint64_t{4} * in_row_ * in_row_},
    };
    for (const auto& [port, bytes] : sizes) {
      heddle_shape shape{};
      shape.byte_size = bytes;
      if (status == HEDDLE_OK) status = host.set_shape(port, shape);
    }
    return status == HEDDLE_OK ? host.set_capacity("requests", requests_) : status;
  }

  heddle_status execute(const Frame& frame) {
    if (frame.info().cut != 0 || !residency_) reset(frame.host());
    heddle_mapped mapped{};
    heddle_status status = frame.map("requests", mapped);
    if (status != HEDDLE_OK) return status;
    asked_.clear();
    if (mapped.frame != HEDDLE_NO_FRAME) {
      const auto* words = static_cast<const std::uint32_t*>(mapped.data);
      for (std::uint32_t i = 0; i < mapped.count; ++i, words += 2)
        asked_.push_back({words[0] & 65535U, words[0] >> 16U, words[1] & 65535U, words[1] >> 16U});
    }
    const auto window = static_cast<std::uint32_t>(frame.host().integer("window"));
    if (frame.host().choice("query") != kView) {
      status = ask_trees(frame);
      if (status != HEDDLE_OK) return status;
    }
    changes_ = step(frame, window);
    if (reader_ && reader_->status() != HEDDLE_OK) return reader_->status();
    count(frame.host());
    const double fade = frame.host().parameter("fade");
    // Where time stands still, or runs back, nothing would ever be faded in.
    const bool is_fading = fade > 0.0 && frame.info().time_step > 0.0;
    // A clock of its own, for scene time may jump to before a tile came.
    clock_ = is_fading ? clock_ + frame.info().time_step : std::max(clock_, last_birth_ + kMostFade);
    const float now = static_cast<float>(clock_);
    birth_ = is_fading ? now : kLongAgo;
    if (is_fading && !changes_.uploads.empty()) last_birth_ = clock_;
    status = frame.set_value("virtual_materials", std::span<const std::uint32_t>(materials()));
    const State state = state_of(frame, is_fading ? static_cast<float>(1.0 / fade) : 1.0F, now);
    if (status == HEDDLE_OK) status = frame.set_value("virtual_state", std::span<const State>(&state, 1));
    if (status == HEDDLE_OK) status = frame.set_value("tile_edits", std::span<const std::uint32_t>(edits()));
    return status;
  }

  heddle_status record(const Frame& frame) {
    if (changes_.edits.empty()) return HEDDLE_OK;
    if (frame.stage() == kStage) return stage(frame);
    if (frame.stage() == kUpload) return upload(frame);
    return frame.stage() == kPublish ? publish(frame) : rewrite(frame);
  }

  /// The table is written by shaders or sent: what has nothing to do keeps it.
  [[nodiscard]] std::uint32_t activity(const Frame& frame) const {
    return frame.stage() == kRewrite && frame.host().choice("table") == 0 ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  void counted(const PassHost& host, const heddle_list_count& count) {
    if (count.overflow == 0 || count.capacity >= kMostRequests) return;
    requests_ = std::min(std::bit_ceil(count.count + count.overflow), kMostRequests);
    host.request_redeclare();
  }

 private:
  static std::uint64_t cells_below(std::uint32_t levels) { return ((std::uint64_t{4} << (2 * levels)) - 1) / 3; }
  [[nodiscard]] std::uint32_t pitch() const { return tile_ + 2 * border_; }
  [[nodiscard]] std::uint64_t tile_bytes() const { return blocks::bytes_of(format_, pitch(), pitch()); }
  struct Layout {
    std::vector<tiles::Texture> textures;
    std::uint32_t tile = 0, border = 0, in_row = 0, format = 0, table = 0;
    std::vector<std::byte> store;
    friend bool operator==(const Layout&, const Layout&) = default;
  };
  [[nodiscard]] Layout layout() const {
    return {scene_.textures, tile_, border_, in_row_, format_, edits_by_, stored_.artifact()};
  }
  /// An arrival and an eviction for each upload, and the roots.
  [[nodiscard]] std::uint32_t edit_room() const {
    return 2 * (uploads_ + static_cast<std::uint32_t>(scene_.textures.size()));
  }
  [[nodiscard]] std::uint32_t root_of(std::uint32_t texture) const {
    return tiles::tile_levels(scene_.textures[texture].extent, tile_);
  }

  /// Roots are never waited for: those of stored textures stay in memory.
  heddle_status read_roots(const PassHost& host) {
    root_bytes_.assign(scene_.textures.size(), {});
    for (std::uint32_t t = 0; t < scene_.textures.size(); ++t) {
      if (scene_.textures[t].source != tiles::kStored) continue;
      const heddle_status status = stored_.read(host, scene_.textures[t].image, root_of(t), 0, 0, root_bytes_[t]);
      if (status != HEDDLE_OK) return status;
    }
    return HEDDLE_OK;
  }

  /// Every instance whose material shows a texture, into that texture's tree.
  void plant(const PassHost& host, const heddle::pass::Meshes& meshes) {
    trees_.clear();
    const auto filtering = host.choice("filtering");
    const std::uint32_t taps = filtering == 0 ? 1 : static_cast<std::uint32_t>(host.integer("anisotropy"));
    for (std::uint32_t t = 0; t < scene_.textures.size(); ++t)
      trees_.emplace_back(t, scene_.textures[t].extent, tile_, scene_.textures[t].address, taps);
    for (std::uint32_t i = 0; i < meshes.content().instance_count; ++i) {
      const heddle_scene_instance instance = meshes.instance(i);
      const heddle_scene_mesh mesh = meshes.mesh(instance.mesh);
      const auto material = std::ranges::find(scene_.materials, mesh.material, &tiles::MaterialTexture::material);
      if (material == scene_.materials.end()) continue;
      const auto corner = [&](std::uint32_t index) {
        const HeddleVertex& vertex = mesh.vertices[mesh.indices[index]];
        heddle::virtual_texture::TexturedCorner out;
        const double* m = instance.scene_from_object;
        for (std::size_t c = 0; c < 3; ++c)
          out.position[c] = m[c] * static_cast<double>(vertex.position[0]) +
                            m[4 + c] * static_cast<double>(vertex.position[1]) +
                            m[8 + c] * static_cast<double>(vertex.position[2]) + m[12 + c];
        out.texel = {static_cast<double>(vertex.u0) * material->chart_size + material->chart_x,
                     static_cast<double>(vertex.v0) * material->chart_size + material->chart_y};
        return out;
      };
      for (std::uint32_t index = 0; index + 2 < mesh.index_count; index += 3)
        trees_[material->texture].add({corner(index), corner(index + 1), corner(index + 2)}, i);
    }
  }

  /// What this frame's view needs, before a pixel has asked.
  heddle_status ask_trees(const Frame& frame) {
    const PassHost host = frame.host();
    const auto eye = frame.value<HeddleView>("eye");
    if (eye.empty())
      return host.fail(HEDDLE_BAD_INPUT,
                       "params.query is \"" + std::string(kQueries[host.choice("query")]) +
                           "\", and input 'eye' is bound to nothing; expected: inputs.eye = \"scene.camera\"");
    const HeddleView& view = eye.front();
    if (view.is_orthographic != 0)
      return host.fail(
          HEDDLE_UNSUPPORTED,
          "the tree looks in perspective, and input 'eye' is orthographic; choose params.query = \"view\"");
    const heddle::pass::Meshes meshes(host);
    const Planted planted{meshes.content().revision, meshes.content().motion_revision, host.parameter("anisotropy"),
                          host.choice("filtering"), layout()};
    if (!planted_ || *planted_ != planted) {
      plant(host, meshes);
      planted_ = planted;
    }
    Looker looker;
    for (std::size_t c = 0; c < 3; ++c) {
      looker.origin[c] = frame.info().origin[c] + static_cast<double>(view.rel_from_view[12 + c]);
      for (std::size_t axis = 0; axis < 3; ++axis)
        looker.axes[axis][c] = static_cast<double>(view.rel_from_view[4 * axis + c]);
    }
    for (std::size_t c = 0; c < 2; ++c) looker.tangents[c] = static_cast<double>(view.half_size[c]);
    // Of the two the coarser pixels would ask for less: the finer ones count.
    // As if the image had as many pixels more as take textures finer.
    looker.focal_px = 0.5 * std::max(view.extent[0] / looker.tangents[0], view.extent[1] / looker.tangents[1]) *
                      std::exp2(-static_cast<double>(view.lod_bias));
    looker.near_plane = static_cast<double>(view.near_distance);
    looker.ignores_direction = host.toggle("turning");
    const double bias = host.choice("filtering") == kTrilinear ? 1.0 : host.parameter("bias");
    const std::size_t before = asked_.size();
    // More than there are slots would only be coarsened. All of it evenly, rather than a part of it: what is not named
    // keeps the levels of what happens to be there.
    const std::size_t most = std::size_t{in_row_} * in_row_ * kMostTimesSlots;
    const std::uint32_t asking = host.choice("query");
    std::uint64_t visited = 0;
    for (UvTree& tree : trees_) {
      constexpr double kMostCoarser = 64;  // beyond all levels that a view can want
      const std::size_t first = asked_.size();
      for (double coarser = 0;; ++coarser) {
        asked_.resize(first);
        if (asking == kMap)
          tree.query_map(looker, bias - coarser, most + 1, asked_);
        else
          tree.query(looker, bias - coarser, most + 1, asked_, asking == kDraws);
        visited += tree.visited();
        if (asked_.size() - first <= most || coarser >= kMostCoarser) break;
      }
    }
    tell(host, "places_asked", visited);
    tell(host, "tiles_named", asked_.size() - before);
    return HEDDLE_OK;
  }

  Changes step(const Frame& frame, std::uint32_t window) {
    const PassHost host = frame.host();
    const std::uint64_t index = frame.info().index;
    if (!reader_) return residency_->step(asked_, index, window, uploads_);
    const auto frames = static_cast<std::uint32_t>(host.integer("read_frames"));
    Changes changes = residency_->step(asked_, index, window, uploads_, [&](const Tile& tile) {
      const tiles::Texture& texture = scene_.textures[tile.texture];
      return texture.source != tiles::kStored || reader_->has(host, tile, texture.image, index, frames);
    });
    // What comes in this frame stays until its bytes are in the staging buffer.
    reader_->forget(host, index);
    return changes;
  }

  /// Nothing of the past is valid: the roots come again, and after them what is asked for.
  void reset(const PassHost& host) {
    if (reader_) reader_->forget_all(host);
    reader_.reset();
    // What one frame uploads, for each frame that it takes.
    if (stored_.is_open())
      reader_.emplace(stored_, std::size_t{uploads_} * (1 + static_cast<std::size_t>(host.integer("read_frames"))));
    std::vector<std::uint32_t> roots;
    for (std::uint32_t t = 0; t < scene_.textures.size(); ++t) roots.push_back(root_of(t));
    Residency::Content content;
    if (stored_.is_open() && !stored_.store().index.empty())
      content = [this](const Tile& tile) -> std::optional<std::uint64_t> {
        const tiles::Texture& texture = scene_.textures[tile.texture];
        if (texture.source != tiles::kStored) return std::nullopt;
        return stored_.store().kept_of(texture.image, tile.level, tile.x, tile.y);
      };
    residency_.emplace(in_row_ * in_row_, std::move(roots), std::move(content));
    std::size_t cells = 0;
    for (std::uint32_t t = 0; t < scene_.textures.size(); ++t) cells += cells_below(root_of(t));
    table_.assign(host.choice("table") == 0 ? 0 : cells, 0);
    clock_ = last_birth_ = 0;
  }

  static void tell(const PassHost& host, const char* name, std::uint64_t number) {
    if (const auto* counters = host.service<heddle_counters_service>(HEDDLE_COUNTERS_SERVICE); counters != nullptr)
      counters->add(host.raw(), name, number);
  }

  void count(const PassHost& host) {
    const auto shared = static_cast<std::uint64_t>(
        std::ranges::count_if(changes_.uploads, [](const Changes::Upload& one) { return one.is_there; }));
    const std::pair<const char*, std::uint64_t> counts[] = {
        {"tiles_uploaded", changes_.uploads.size() - shared},
        {"tiles_shared", shared},
        {"slots_in_use", residency_->slots_in_use()},
        {"tiles_evicted", changes_.evictions},
        {"tiles_missing", changes_.missing},
        {"tiles_wanted", changes_.wanted},
        {"tiles_resident", residency_->resident_count()},
        {"table_edits", changes_.edits.size()},
        {"level_bias", changes_.bias},
    };
    for (const auto& [name, number] : counts) tell(host, name, number);
    if (!reader_) return;
    heddle_store_counts read{};
    read.struct_size = sizeof read;
    stored_.service().counts(host.raw(), stored_.file(), &read);
    const std::pair<const char*, std::uint64_t> reads[] = {
        {"tiles_requested", reader_->take_requests()},
        {"tiles_in_flight", reader_->in_flight()},
        {"bytes_read", read.bytes_read - std::exchange(counted_.bytes_read, read.bytes_read)},
        {"bytes_used", read.bytes_used - std::exchange(counted_.bytes_used, read.bytes_used)},
        {"reads_waited_for", read.waits - std::exchange(counted_.waits, read.waits)},
    };
    for (const auto& [name, number] : reads) tell(host, name, number);
  }

  [[nodiscard]] bool is_vertex_centred(std::uint32_t texture) const {
    return scene_.textures[texture].source == tiles::kStored &&
           heddle::mip_kernels::is_vertex_centred(stored_.store().header.kernel);
  }

  [[nodiscard]] std::vector<std::uint32_t> materials() const {
    std::vector<std::uint32_t> words(std::size_t{8} * std::max(1U, tiles::material_end(scene_)), 0);
    for (const tiles::MaterialTexture& material : scene_.materials) {
      std::uint32_t* record = words.data() + std::size_t{8} * material.material;
      record[0] = first_cells_[material.texture];
      record[1] = root_of(material.texture) | scene_.textures[material.texture].address << 8U | material.texture << 16U;
      record[2] = std::bit_cast<std::uint32_t>(static_cast<float>(material.chart_size));
      record[3] = 1 | (is_vertex_centred(material.texture) ? 2U : 0U);
      record[4] = material.chart_x;
      record[5] = material.chart_y;
    }
    return words;
  }

  [[nodiscard]] State state_of(const Frame& frame, float per_fade, float now) const {
    const std::uint32_t bits = kSpacingLog2[frame.host().choice("spacing")];
    State state{{tile_, static_cast<std::uint32_t>(std::countr_zero(tile_)), border_, in_row_},
                {1U << bits, 0, 0, 0},
                {per_fade, now, 0, 0}};
    // All pixels of a square in turn, far from the last: the frame's bits, reversed, take turns for x and y.
    for (std::uint32_t bit = 0; bit < bits; ++bit) {
      state.query[1] |= static_cast<std::uint32_t>(frame.info().index >> (2 * bit) & 1U) << (bits - 1 - bit);
      state.query[2] |= static_cast<std::uint32_t>(frame.info().index >> (2 * bit + 1) & 1U) << (bits - 1 - bit);
    }
    // Where the tree alone asks no pixel does.
    const std::uint32_t asking = frame.host().choice("query");
    if (asking == kTree || asking == kDraws || asking == kMap)
      state.query[0] = 0, state.query[1] = state.query[2] = ~0U;
    return state;
  }

  [[nodiscard]] std::uint32_t entry(std::uint32_t slot, const Tile& shown) const {
    return slot % in_row_ | (slot / in_row_) << 8U | shown.level << 16U;
  }

  [[nodiscard]] std::vector<std::uint32_t> edits() const {
    std::vector<std::uint32_t> words;
    for (const Changes::Edit& edit : changes_.edits) {
      const std::uint32_t levels = root_of(edit.tile.texture) | edit.tile.level << 8U;
      for (const std::uint32_t word :
           {first_cells_[edit.tile.texture], levels, edit.tile.x | edit.tile.y << 16U, entry(edit.slot, edit.shown)})
        words.push_back(word);
    }
    if (words.empty()) words.resize(4);
    return words;
  }

  heddle_status stage(const Frame& frame) {
    std::uint64_t at = 0;
    for (const Changes::Upload& one : changes_.uploads) {
      if (one.is_there) continue;
      const std::span<const std::byte> bytes = bytes_of(one.tile);
      for (std::size_t begin = 0; begin < bytes.size(); begin += kMostUpdate) {
        const auto part = bytes.subspan(begin, std::min<std::size_t>(kMostUpdate, bytes.size() - begin));
        if (const heddle_status status = frame.update_buffer("tile_staging", at + begin, part); status != HEDDLE_OK)
          return status;
      }
      at += tile_bytes();
      const tiles::Texture& texture = scene_.textures[one.tile.texture];
      if (texture.source == tiles::kStored) reader_->release(frame.host(), one.tile, texture.image);
    }
    tell(frame.host(), "tile_bytes_staged", at);
    return HEDDLE_OK;
  }

  /// What goes into the tile's slot; until the next call.
  std::span<const std::byte> bytes_of(const Tile& tile) {
    const tiles::Texture& texture = scene_.textures[tile.texture];
    if (texture.source == tiles::kStored) {
      const bool is_root = tile.level == root_of(tile.texture);
      const std::span<const std::byte> stored =
          is_root ? std::span<const std::byte>(root_bytes_[tile.texture]) : reader_->bytes(tile, texture.image);
      if (stored_.store().header.compression == format_) return stored;
      texels_.resize(std::size_t{pitch()} * pitch());
      blocks::decode(stored_.store().header.compression, stored.data(), pitch(), pitch(), first_byte(texels_));
      return std::as_bytes(std::span(texels_));
    }
    const std::int64_t border = border_;
    tiles::make_texels(texture, tile.level, std::int64_t{tile.x} * tile_ - border,
                       std::int64_t{tile.y} * tile_ - border, pitch(), pitch(), texels_);
    if (format_ == blocks::kNone) return std::as_bytes(std::span(texels_));
    packed_.resize(tile_bytes());
    blocks::encode(format_, first_byte(texels_), pitch(), pitch(), packed_.data());
    return packed_;
  }

  heddle_status upload(const Frame& frame) const {
    std::vector<VkBufferImageCopy> regions;
    for (const Changes::Upload& one : changes_.uploads) {
      if (one.is_there) continue;
      VkBufferImageCopy region{};
      region.bufferOffset = tile_bytes() * regions.size();
      region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
      region.imageOffset = {static_cast<std::int32_t>(one.slot % in_row_ * pitch()),
                            static_cast<std::int32_t>(one.slot / in_row_ * pitch()), 0};
      region.imageExtent = {pitch(), pitch(), 1};
      regions.push_back(region);
    }
    const std::size_t at_once = frame.host().choice("copies") == 0 ? std::max<std::size_t>(regions.size(), 1) : 1;
    tell(frame.host(), "tile_copies", (regions.size() + at_once - 1) / at_once);
    for (std::size_t first = 0; first < regions.size(); first += at_once)
      frame.vulkan().CmdCopyBufferToImage(frame.command_buffer(), frame.buffer("tile_staging"),
                                          frame.image("tile_cache"), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                                          static_cast<std::uint32_t>(at_once), regions.data() + first);
    return HEDDLE_OK;
  }

  heddle_status publish(const Frame& frame) const {
    for (const Changes::Upload& one : changes_.uploads) {
      if (one.is_there) continue;
      // Roots have no parent to be seen meanwhile.
      const float birth = one.tile.level == root_of(one.tile.texture) ? kLongAgo : birth_;
      const heddle_status status =
          frame.update_buffer("slot_births", std::uint64_t{4} * one.slot, std::span<const float>(&birth, 1));
      if (status != HEDDLE_OK) return status;
    }
    if (frame.host().choice("table") != 0) return HEDDLE_OK;
    // Coarse tiles before fine ones, which write into the same cells.
    for (std::size_t first = 0; first < changes_.edits.size();) {
      const std::uint32_t level = changes_.edits[first].tile.level;
      std::size_t end = first;
      while (end < changes_.edits.size() && changes_.edits[end].tile.level == level) ++end;
      const auto groups = static_cast<std::uint32_t>((cells_below(level) + kFillThreads - 1) / kFillThreads);
      const std::uint32_t in_row = std::min(groups, kGroupsInRow);
      if (first > 0) frame.barrier();
      const heddle_status status =
          frame.dispatch("fill", in_row, static_cast<std::uint32_t>(end - first), (groups + in_row - 1) / in_row,
                         Push{static_cast<std::uint32_t>(first)});
      if (status != HEDDLE_OK) return status;
      first = end;
    }
    return HEDDLE_OK;
  }

  /// The same cells, set in a copy; of each level of each texture what lies between the first that changed and the last
  /// one is sent.
  heddle_status rewrite(const Frame& frame) {
    if (table_.empty()) return HEDDLE_OK;  // a frame in which every stage runs, whatever it answers
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::pair<std::size_t, std::size_t>> changed;
    for (const Changes::Edit& edit : changes_.edits) {
      const std::uint32_t n = root_of(edit.tile.texture);
      for (std::uint32_t depth = 0; depth <= edit.tile.level; ++depth) {
        const std::uint32_t level = edit.tile.level - depth, in_row = 1U << (n - level);
        const std::size_t side = std::size_t{1} << depth;
        const std::size_t begin = first_cells_[edit.tile.texture] + cells_below(n) - cells_below(n - level);
        const std::size_t first =
            begin + (std::size_t{edit.tile.y} << depth) * in_row + (std::size_t{edit.tile.x} << depth);
        for (std::size_t row = 0; row < side; ++row)
          std::fill_n(table_.begin() + static_cast<std::ptrdiff_t>(first + row * in_row), side,
                      entry(edit.slot, edit.shown));
        const std::size_t end = first + (side - 1) * in_row + side;
        const auto [found, is_new] = changed.try_emplace({edit.tile.texture, level}, first, end);
        if (!is_new) found->second = {std::min(found->second.first, first), std::max(found->second.second, end)};
      }
    }
    std::uint64_t sent = 0;
    for (const auto& [place, cells] : changed) {
      for (std::size_t at = cells.first; at < cells.second; at += kMostUpdate / 4) {
        const std::size_t count = std::min<std::size_t>(kMostUpdate / 4, cells.second - at);
        const heddle_status status = frame.update_buffer("tile_table", std::uint64_t{4} * at,
                                                         std::span<const std::uint32_t>(table_).subspan(at, count));
        if (status != HEDDLE_OK) return status;
        sent += 4 * count;
      }
    }
    tell(frame.host(), "table_bytes_sent", sent);
    return HEDDLE_OK;
  }

  tiles::SceneTextures scene_;
  std::uint32_t tile_ = 0, border_ = 0, uploads_ = 0, in_row_ = 0;
  std::uint32_t format_ = blocks::kNone;  // of the cache
  std::uint32_t edits_by_ = 0;            // of kTables
  std::uint32_t requests_ = kFirstRequests;
  std::vector<std::uint32_t> first_cells_;  // of each texture, in tile_table
  heddle::texture_store::StoredTextures stored_;
  std::vector<std::vector<std::byte>> root_bytes_;  // by texture; empty: it is made
  std::optional<TileReader> reader_;                // where a store is bound
  heddle_store_counts counted_{};                   // what counters were told of
  std::vector<UvTree> trees_;                       // by texture
  struct Planted {
    std::uint64_t revision = 0, motion_revision = 0;
    double anisotropy = 0;
    std::uint32_t filtering = 0;
    Layout layout;
    friend bool operator==(const Planted&, const Planted&) = default;
  };
  std::optional<Planted> planted_;    // what the trees were made of
  std::vector<std::uint32_t> table_;  // table cpu: what tile_table holds
  std::optional<Residency> residency_;
  Changes changes_;  // of this frame
  std::vector<Tile> asked_;
  std::vector<tiles::Rgba8> texels_;
  std::vector<std::byte> packed_;
  double clock_ = 0, last_birth_ = 0;  // s; of the last tile that is faded in
  float birth_ = kLongAgo;
};

constexpr heddle_technique kVirtual = [] {
  heddle_technique t = technique<Virtual>(
      "texture_source/virtual", "Tiles of a huge texture that pixels asked for, in a cache",
      "Mittring 2008, Advanced Virtual Texture Topics", kPorts, kParameters, kStages, kShaders, kFunctions);
  t.features = tiles::kComponent;
  t.components = tiles::kComponent;
  t.device_features = "fragmentStoresAndAtomics";
  t.fallback = "none: without it pixels cannot ask for tiles; choose texture_source.technique = \"resident\"";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kVirtual)
