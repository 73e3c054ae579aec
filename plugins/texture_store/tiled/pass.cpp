// SPDX-License-Identifier: Apache-2.0
// texture_store/tiled: images of any size, or textures that are made, to tiles of all levels with their borders, in a
// store beside the artifact. Two passes through a scratch file, so that memory does not grow with the image.
#include "image_rows.hpp"
#include "pyramid.hpp"
#include "texture_store.hpp"

#include <heddle/images.h>
#include <heddle/parallel.h>
#include <heddle/stores.h>
#include <heddle/pass.hpp>

#include <bit>
#include <cmath>
#include <memory>
#include <string>
#include <unordered_map>

namespace {

using namespace heddle::pass;
using namespace heddle::texture_store;
namespace tiles = heddle::texture_tiles;
namespace blocks = heddle::block_compression;

constexpr heddle_port kPorts[] = {
    artifact_out("store", "what lies where; the tiles are in the store beside it"),
    report_out("report", "of each image: its size, that of the texture, how many tiles, what compression has cost"),
};

constexpr const char* kSources[] = {"terrain", "road", "ramp", "uvgrid", nullptr};  // as texture_tiles numbers them
constexpr const char* kEncodings[] = {"auto", "srgb", "linear", nullptr};
constexpr const char* kKernels[] = {"box2", "gauss4", "sharpen4", "gauss3", "gauss5", "sharpen5", nullptr};
constexpr const char* kAddresses[] = {"wrap", "mirror", "clamp", nullptr};
constexpr const char* kTiles[] = {"64", "128", "256", nullptr};
constexpr std::uint32_t kTileSizes[] = {64, 128, 256};
constexpr const char* kCompressions[] = {"none", "bc1", "bc7", nullptr};
constexpr double kCompressionLadder[] = {1, 2, 0};

constexpr heddle_parameter kParameters[] = {
    names("images", "files, in the order in which materials number them; none: a texture that is made"),
    choice("encoding", kEncodings, 0, "of the images' numbers; auto: floats are linear, integers sRGB"),
    choice("source", kSources, 0, "of a texture that is made: what texture_source.virtual calls so"),
    integer("extent", "px", 256, 262144, 4096, "of a texture that is made, along each side: a power of two"),
    integer("seed", "1", 0, 1'000'000, 0, "of what is random in a texture that is made"),
    choice("kernel", kKernels, 0,
           "level to coarser level: even ones (2, 4) as hardware has it; odd ones (3, 5) keep "
           "texel centres in place, and textures are looked up so"),
    choice("address", kAddresses, 0, "what borders hold beyond the texture's sides, as materials must have it"),
    choice("tile", kTiles, 1, "texels along each side of a tile, without its border"),
    toggle("shared", false,
           "tiles with equal bytes are kept once: for masks and other images with large parts of one colour; takes up "
           "to 40 "
           "bytes of memory a tile"),
    integer("border", "px", 0, 16, 4, "of each tile, its neighbours' texels; 0: seams show; compressed: even"),
    knob(choice("compression", kCompressions, 2, "of tiles on the disk and in the cache: 4, 1/2 or 1 byte a texel"),
         kCompressionLadder),
};
constexpr heddle_access kMakeAccesses[] = {value("store"), value("report")};
constexpr heddle_stage kStages[] = {cpu_stage("make", kMakeAccesses)};

constexpr std::uint32_t kLeastExtent = 256;  // the largest tile
constexpr std::uint32_t kMostExtent = 262144;
constexpr std::uint64_t kRegionBytes = 8U << 20U;  // of level 0, at a time
constexpr std::size_t kBatch = 16;                 // tiles that are compressed side by side

class Tiled {
 public:
  heddle_status execute(const Frame& frame) {
    try {
      make(frame);
      return HEDDLE_OK;
    } catch (const Failed& failed) {
      return failed.status;
    }
  }

 private:
  void make(const Frame& frame) {
    const PassHost host = frame.host();
    images_ = service<heddle_images_service>(host, HEDDLE_IMAGES_SERVICE);
    stores_ = service<heddle_stores_service>(host, HEDDLE_STORES_SERVICE);
    parallel_ = service<heddle_parallel_service>(host, HEDDLE_PARALLEL_SERVICE);
    store_ = {};
    StoreHeader& header = store_.header;
    header.tile = kTileSizes[host.choice("tile")];
    header.border = static_cast<std::uint32_t>(host.integer("border"));
    header.compression = host.choice("compression");
    header.kernel = host.choice("kernel");
    header.address = host.choice("address");
    if (header.compression != blocks::kNone && header.border % 2 != 0)
      require(host.fail(HEDDLE_BAD_INPUT,
                        "params.border is " + std::to_string(header.border) +
                            ", and two tiles share whole blocks of 4 texels only if it is even; expected: an even "
                            "number, or params.compression = \"none\""));
    const std::vector<std::string> files = find_files(host);
    require(stores_->make(host.raw(), frame.raw(), "store", &out_));
    require(stores_->make(host.raw(), frame.raw(), nullptr, &scratch_));
    const std::size_t count = std::max<std::size_t>(files.size(), 1);
    is_shared_ = host.toggle("shared");
    known_.clear();
    std::uint64_t tiles = 0;
    for (std::size_t i = 0; i < count; ++i) {
      done_ = 0;
      share_ = {static_cast<double>(i) / static_cast<double>(count), 1.0 / static_cast<double>(count)};
      StoredTexture texture;
      texture.first = tiles;
      if (!files.empty())
        add_image(frame, files[i], texture);
      else
        add_made(frame, texture);
      tiles += tile_count(levels_of(texture));
      store_.textures.push_back(texture);
    }
    stores_->close(host.raw(), scratch_);
    known_ = {};
    earlier_ = {};
    header.texture_count = static_cast<std::uint32_t>(store_.textures.size());
    // The last tile's cluster is whole.
    const std::byte none{};
    require(stores_->write(host.raw(), out_, header.kept * store_.stride() - 1, &none, 1));
    const std::vector<std::byte> artifact = artifact_of(store_);
    require(frame.set_value("store", std::span<const std::byte>(artifact)));
  }

  template <typename Service>
  static const Service* service(const PassHost& host, const char* id) {
    const auto* found = host.service<Service>(id);
    if (found == nullptr) require(host.fail(HEDDLE_UNSUPPORTED, std::string("this host has no service ") + id));
    return found;
  }

  static std::vector<std::string> find_files(const PassHost& host) {
    std::vector<std::string> files;
    for (std::uint32_t i = 0;; ++i) {
      const std::string file = host.text("images", i);
      if (file.empty()) break;
      files.push_back(file);
    }
    return files;
  }

  [[nodiscard]] std::uint32_t levels_of(const StoredTexture& texture) const {
    return static_cast<std::uint32_t>(std::countr_zero(texture.extent / store_.header.tile));
  }

  Pyramid begin(const Frame& frame, const StoredTexture& texture) {
    const heddle_pass_host* raw = frame.host().raw();
    const Disk disk{[this, raw](std::uint64_t offset, std::span<const std::byte> bytes) {
                      require(stores_->write(raw, scratch_, offset, bytes.data(), bytes.size()));
                    },
                    [this, raw](std::uint64_t offset, std::span<std::byte> bytes) {
                      require(stores_->read(raw, scratch_, offset, bytes.data(), bytes.size()));
                    }};
    const std::uint32_t last = levels_of(texture);
    // Level 0, the others, all tiles.
    work_ = 0;
    for (std::uint32_t level = 0; level <= last; ++level)
      work_ += 2.0 * static_cast<double>(texture.extent >> level) * (texture.extent >> level);
    return {texture.extent, last, store_.header.address, disk};
  }

  void step(const Frame& frame, std::uint64_t texels) {
    done_ += static_cast<double>(texels);
    require(frame.progress(share_.first + share_.second * std::min(done_ / work_, 1.0)));
  }

  void add_image(const Frame& frame, const std::string& file, StoredTexture& texture) {
    const PassHost host = frame.host();
    ImageRows image(host, *images_, file, host.choice("encoding"));
    texture.width = image.width();
    texture.height = image.height();
    const std::uint64_t extent = std::bit_ceil(std::uint64_t{std::max({texture.width, texture.height, kLeastExtent})});
    if (extent > kMostExtent)
      require(host.fail(HEDDLE_BAD_INPUT, "the image '" + file + "' has " + std::to_string(texture.width) + " x " +
                                              std::to_string(texture.height) + " pixels; expected: at most " +
                                              std::to_string(kMostExtent) + " along each side"));
    texture.extent = static_cast<std::uint32_t>(extent);
    Pyramid pyramid = begin(frame, texture);
    std::vector<Rgba8> texels;
    // Files with tiles block by block, others in bands of rows from top to bottom.
    const bool has_tiles = image.has_tiles();
    const auto band = static_cast<std::uint32_t>(std::clamp<std::uint64_t>(
        kRegionBytes / (sizeof(Rgba8) * std::max<std::uint64_t>(extent, texture.width)), 1, Pyramid::kBlock));
    const std::uint32_t wide = has_tiles ? std::min(Pyramid::kBlock, texture.extent) : texture.extent;
    const std::uint32_t high = has_tiles ? wide : band;
    for (std::uint32_t y = 0; y < texture.extent; y += high) {
      for (std::uint32_t x = 0; x < texture.extent; x += wide) {
        const std::uint32_t rows = std::min(high, texture.extent - y);
        image.texels(texture.extent, x, y, wide, rows, texels);
        pyramid.write(0, x, y, wide, rows, texels.data());
        step(frame, std::uint64_t{wide} * rows);
      }
    }
    finish(frame, pyramid, texture, file);
  }

  void add_made(const Frame& frame, StoredTexture& texture) {
    const PassHost host = frame.host();
    tiles::Texture made{host.choice("source"), static_cast<std::uint32_t>(host.integer("extent")),
                        static_cast<std::uint32_t>(host.integer("seed")), store_.header.address};
    if (!std::has_single_bit(made.extent))
      require(host.fail(HEDDLE_BAD_INPUT,
                        "params.extent is " + std::to_string(made.extent) + "; expected: a power of two"));
    texture.extent = texture.width = texture.height = made.extent;
    Pyramid pyramid = begin(frame, texture);
    std::vector<Rgba8> texels;
    const std::uint32_t side = std::min(Pyramid::kBlock, made.extent), across = made.extent / side;
    for (std::uint64_t code = 0; code < std::uint64_t{across} * across; ++code) {
      const std::uint32_t x = morton_x(code) * side, y = morton_y(code) * side;
      tiles::make_texels(made, 0, x, y, side, side, texels);
      pyramid.write(0, x, y, side, side, texels.data());
      step(frame, std::uint64_t{side} * side);
    }
    finish(frame, pyramid, texture, kSources[host.choice("source")]);
  }

  void finish(const Frame& frame, Pyramid& pyramid, const StoredTexture& texture, const std::string& what) {
    pyramid.build(store_.header.kernel, [&](std::uint64_t texels) { step(frame, texels); });
    const std::uint64_t before = store_.header.kept;
    const double squares = cut(frame, pyramid);
    const std::uint64_t count = tile_count(pyramid.last());
    const double of = 3.0 * static_cast<double>(texture.extent) * texture.extent;
    const double psnr = squares > 0 ? 10.0 * std::log10(255.0 * 255.0 * of / squares) : INFINITY;
    std::string message = "a texture is stored";
    if (texture.width != texture.extent || texture.height != texture.extent)
      message += ", stretched to a square whose side is a power of two";
    const std::uint64_t kept = store_.header.kept - before;
    if (std::isfinite(psnr))
      require(frame.add_row("report", HEDDLE_SEVERITY_INFO, message,
                            {{"image", what.c_str()},
                             {"width", static_cast<double>(texture.width)},
                             {"height", static_cast<double>(texture.height)},
                             {"extent", static_cast<double>(texture.extent)},
                             {"tiles", static_cast<double>(count)},
                             {"kept", static_cast<double>(kept)},
                             {"bytes", static_cast<double>(kept * store_.stride())},
                             {"psnr_db", psnr}}));
    else
      require(frame.add_row("report", HEDDLE_SEVERITY_INFO, message,
                            {{"image", what.c_str()},
                             {"width", static_cast<double>(texture.width)},
                             {"height", static_cast<double>(texture.height)},
                             {"extent", static_cast<double>(texture.extent)},
                             {"tiles", static_cast<double>(count)},
                             {"kept", static_cast<double>(kept)},
                             {"bytes", static_cast<double>(kept * store_.stride())}}));
  }

  struct Piece {
    std::uint64_t place = 0;
    std::vector<Rgba8> texels, back;
    std::vector<std::byte> bytes;
    double squares = 0;  // of what compression has changed, in codes, without the border
    bool is_measured = false;
  };

  /// Tiles with their borders, in the store's order. The sum of squared differences of level 0.
  double cut(const Frame& frame, Pyramid& pyramid) {
    const heddle_pass_host* raw = frame.host().raw();
    const std::uint32_t n = pyramid.last(), pitch = store_.pitch();
    const std::int64_t border = store_.header.border, tile = store_.header.tile;
    const auto number = static_cast<std::uint32_t>(store_.textures.size());
    std::vector<Piece> batch(kBatch);
    double squares = 0;
    for (std::uint32_t level = n + 1; level-- > 0;) {
      const std::uint64_t count = std::uint64_t{1} << (2 * (n - level));
      for (std::uint64_t first = 0; first < count; first += kBatch) {
        const std::uint64_t in_batch = std::min<std::uint64_t>(kBatch, count - first);
        for (std::uint64_t i = 0; i < in_batch; ++i) {
          Piece& piece = batch[i];
          const std::uint32_t x = morton_x(first + i), y = morton_y(first + i);
          piece.place = place_of(number, level, x, y);
          piece.is_measured = level == 0 && store_.header.compression != blocks::kNone;
          piece.texels.resize(std::size_t{pitch} * pitch);
          pyramid.read(level, x * tile - border, y * tile - border, pitch, pitch, piece.texels.data());
        }
        struct Work {
          const Tiled* self;
          std::vector<Piece>* batch;
        } work{this, &batch};
        require(parallel_->for_each(
            raw, 0, in_batch,
            [](void* user, std::uint64_t index, std::uint32_t) {
              const Work& given = *static_cast<Work*>(user);
              given.self->pack((*given.batch)[index]);
            },
            &work));
        for (std::uint64_t i = 0; i < in_batch; ++i) {
          Piece& piece = batch[i];
          const TileMark mark = keep(raw, piece);
          squares += piece.squares;
          store_.header.contents = hash_of(std::as_bytes(std::span(&mark, 1)), store_.header.contents);
        }
        step(frame, in_batch * static_cast<std::uint64_t>(tile * tile));
      }
    }
    return squares;
  }

  /// Into the store, if it is not there yet.
  TileMark keep(const heddle_pass_host* raw, Piece& piece) {
    std::uint64_t& kept = store_.header.kept;
    TileMark mark;
    std::byte* const at = piece.bytes.data() + store_.texel_bytes();
    std::memcpy(&mark, at, sizeof mark);
    if (is_shared_) {
      const auto [first, end] = known_.equal_range(mark.hash);
      for (auto same = first; same != end; ++same) {
        earlier_.resize(store_.texel_bytes());
        require(stores_->read(raw, out_, same->second * store_.stride(), earlier_.data(), earlier_.size()));
        if (std::memcmp(earlier_.data(), piece.bytes.data(), earlier_.size()) != 0) continue;
        store_.index.push_back(same->second);
        return mark;
      }
      mark.place = kept;
      std::memcpy(at, &mark, sizeof mark);
      known_.emplace(mark.hash, static_cast<std::uint32_t>(kept));
      store_.index.push_back(static_cast<std::uint32_t>(kept));
    }
    require(stores_->write(raw, out_, kept * store_.stride(), piece.bytes.data(), piece.bytes.size()));
    ++kept;
    return mark;
  }

  void pack(Piece& piece) const {
    const std::uint32_t pitch = store_.pitch(), border = store_.header.border;
    piece.bytes.resize(store_.tile_bytes());
    blocks::encode(store_.header.compression, first_byte(piece.texels), pitch, pitch, piece.bytes.data());
    const TileMark mark{piece.place, hash_of(std::span(piece.bytes).first(store_.texel_bytes()))};
    std::memcpy(piece.bytes.data() + store_.texel_bytes(), &mark, sizeof mark);
    piece.squares = 0;
    if (!piece.is_measured) return;
    piece.back.resize(piece.texels.size());
    blocks::decode(store_.header.compression, piece.bytes.data(), pitch, pitch, first_byte(piece.back));
    for (std::uint32_t y = border; y < pitch - border; ++y) {
      for (std::uint32_t x = border; x < pitch - border; ++x) {
        const Rgba8 &a = piece.texels[std::size_t{pitch} * y + x], &b = piece.back[std::size_t{pitch} * y + x];
        const int r = a.r - b.r, g = a.g - b.g, blue = a.b - b.b;
        piece.squares += r * r + g * g + blue * blue;
      }
    }
  }

  const heddle_images_service* images_ = nullptr;
  const heddle_stores_service* stores_ = nullptr;
  const heddle_parallel_service* parallel_ = nullptr;
  heddle_store *out_ = nullptr, *scratch_ = nullptr;
  bool is_shared_ = false;
  std::unordered_multimap<std::uint64_t, std::uint32_t> known_;  // tiles that are kept, by hash
  std::vector<std::byte> earlier_;
  Store store_;
  std::pair<double, double> share_;  // of this texture in the whole: where it begins, how much
  double done_ = 0, work_ = 1;       // texels
};

constexpr heddle_technique kTiled =
    technique<Tiled>("texture_store/tiled", "Images of any size, cut into tiles of all levels",
                     "Mittring 2008, Advanced Virtual Texture Topics", kPorts, kParameters, kStages);

}  // namespace

HEDDLE_PLUGIN(kTiled)
