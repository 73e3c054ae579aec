// SPDX-License-Identifier: Apache-2.0
// Importing a glTF file against the parser and the image decoder alone, which nobody can do without. What the host adds
// because the file lacks it, or because a device needs it, is measured apart: tangents, mips, upload.
#include "image/image.hpp"
#include "scene/geometry.hpp"
#include "scene/mips.hpp"
#include "session.hpp"

#include <tiny_gltf.h>

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <fstream>

namespace heddle::bench {
namespace {

struct Size {
  std::uint32_t meshes = 1, row = 8, texture = 16;  // row: vertices along a side of each mesh
};

/// A bumpy patch with everything that a vertex has.
scene::Attributes make_patch(const Size& size, std::uint32_t mesh, bool has_tangents) {
  scene::Attributes patch;
  const auto last = static_cast<float>(size.row - 1);
  for (std::uint32_t j = 0; j < size.row; ++j) {
    for (std::uint32_t i = 0; i < size.row; ++i) {
      const float x = static_cast<float>(i) / last, y = static_cast<float>(j) / last;
      const float slope = 0.2F * std::cos(8.0F * x);
      patch.positions.emplace_back(x + static_cast<float>(mesh), 0.025F * std::sin(8.0F * x), y);
      patch.normals.push_back(glm::normalize(glm::vec3(-slope, 1.0F, 0.0F)));
      if (has_tangents) patch.tangents.emplace_back(glm::normalize(glm::vec3(1.0F, slope, 0.0F)), 1.0F);
      patch.uvs[0].emplace_back(x, y);
      if (i + 1 == size.row || j + 1 == size.row) continue;
      const std::uint32_t a = j * size.row + i;
      for (const std::uint32_t corner : {a, a + size.row, a + 1, a + 1, a + size.row, a + size.row + 1})
        patch.indices.push_back(corner);
    }
  }
  return patch;
}

/// model.glb and its three images in a folder that is removed again.
class File {
 public:
  explicit File(const Size& size) {
    std::string pattern = (std::filesystem::temp_directory_path() / "heddle-bench-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw Error(HEDDLE_FAILED, "no temporary folder can be made");
    folder_ = pattern;
    for (std::uint32_t i = 0; i < 3; ++i) write_image(size, i);
    write_model(size);
  }
  ~File() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  [[nodiscard]] std::filesystem::path model() const { return folder_ / "model.glb"; }
  [[nodiscard]] std::uint64_t bytes() const {
    std::uint64_t sum = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) sum += entry.file_size();
    return sum;
  }

 private:
  void write_image(const Size& size, std::uint32_t which) const {
    image::Image image{size.texture, size.texture, 3, {}};
    for (std::uint32_t y = 0; y < size.texture; ++y) {
      for (std::uint32_t x = 0; x < size.texture; ++x) {
        // Noise over a pattern: neither one colour nor impossible to compress.
        const std::uint32_t hash = (x * 73856093U) ^ (y * 19349663U) ^ (which * 83492791U);
        const float noise = 0.05F * static_cast<float>(hash % 16U) / 16.0F;
        const float wave = 0.4F + 0.4F * std::sin(0.05F * static_cast<float>(x + y * (which + 1U)));
        const bool is_normal_map = which == 2;
        image.pixels.insert(image.pixels.end(), {is_normal_map ? 0.5F : wave + noise, is_normal_map ? 0.5F : wave,
                                                 is_normal_map ? 1.0F : noise});
      }
    }
    image::write(folder_ / fmt::format("{}.png", which), image);
  }

  void write_model(const Size& size) const {
    Json json{{"asset", {{"version", "2.0"}}}, {"scene", 0}};
    std::string data;
    const auto add = [&]<typename Element>(const std::vector<Element>& elements, int component, const char* type,
                                           std::size_t components) {
      json["bufferViews"].push_back(
          {{"buffer", 0}, {"byteOffset", data.size()}, {"byteLength", elements.size() * sizeof(Element)}});
      data.append(reinterpret_cast<const char*>(elements.data()), elements.size() * sizeof(Element));
      json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                                   {"componentType", component},
                                   {"type", type},
                                   {"count", elements.size() * sizeof(Element) / 4 / components}});
      return json["accessors"].size() - 1;
    };
    for (std::uint32_t mesh = 0; mesh < size.meshes; ++mesh) {
      const scene::Attributes patch = make_patch(size, mesh, true);
      Json primitive{{"material", 0}};
      primitive["attributes"]["POSITION"] = add(patch.positions, TINYGLTF_COMPONENT_TYPE_FLOAT, "VEC3", 3);
      primitive["attributes"]["NORMAL"] = add(patch.normals, TINYGLTF_COMPONENT_TYPE_FLOAT, "VEC3", 3);
      primitive["attributes"]["TANGENT"] = add(patch.tangents, TINYGLTF_COMPONENT_TYPE_FLOAT, "VEC4", 4);
      primitive["attributes"]["TEXCOORD_0"] = add(patch.uvs[0], TINYGLTF_COMPONENT_TYPE_FLOAT, "VEC2", 2);
      primitive["indices"] = add(patch.indices, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, "SCALAR", 1);
      Json made = Json::object();
      made["primitives"] = Json::array({primitive});
      json["meshes"].push_back(made);
      json["nodes"].push_back({{"mesh", mesh}});
    }
    std::vector<std::uint32_t> nodes;
    for (std::uint32_t mesh = 0; mesh < size.meshes; ++mesh) nodes.push_back(mesh);
    Json shown = Json::object();
    shown["nodes"] = nodes;
    json["scenes"] = Json::array({shown});
    for (int i = 0; i < 3; ++i) {
      json["images"].push_back({{"uri", fmt::format("{}.png", i)}});
      json["textures"].push_back({{"source", i}});
    }
    Json material = Json::object();
    material["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
    material["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"] = 1;
    material["normalTexture"]["index"] = 2;
    json["materials"] = Json::array({material});
    Json buffer = Json::object();
    buffer["byteLength"] = data.size();
    json["buffers"] = Json::array({buffer});
    std::string text = write_json(json);
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::ofstream file(model(), std::ios::binary);
    const auto word = [&](std::size_t value) {
      const auto narrow = static_cast<std::uint32_t>(value);
      file.write(reinterpret_cast<const char*>(&narrow), 4);
    };
    word(0x46546C67);
    word(2);
    word(12 + 8 + text.size() + 8 + data.size());
    word(text.size());
    word(0x4E4F534A);
    file << text;
    word(data.size());
    word(0x004E4942);
    file << data;
    if (!file) throw Error(HEDDLE_FAILED, fmt::format("{} cannot be written", model().string()));
  }

  std::filesystem::path folder_;
};

/// What is decoded counts: the decoder must not be left out by a compiler that sees that nobody looks.
struct Decoded {
  std::uint64_t texels = 0;
};

bool decode(tinygltf::Image* image, const int /*index*/, std::string* /*error*/, std::string* /*warning*/,
            int /*width*/, int /*height*/, const unsigned char* bytes, int size, void* user) {
  image::Image8 decoded =
      image::decode8({reinterpret_cast<const std::byte*>(bytes), static_cast<std::size_t>(size)}, image->uri);
  static_cast<Decoded*>(user)->texels += std::uint64_t{decoded.width} * decoded.height;
  image->image = std::move(decoded.rgba);
  return true;
}

std::uint64_t parse_and_decode(const std::filesystem::path& file) {
  tinygltf::TinyGLTF parser;
  tinygltf::Model model;
  Decoded decoded;
  parser.SetImageLoader(decode, &decoded);
  std::string error, warning;
  if (!parser.LoadBinaryFromFile(&model, &error, &warning, file.string())) throw Error(HEDDLE_BUG, error);
  return decoded.texels;
}

}  // namespace

void measure_gltf_import(Session& session) {
  const bool is_small = session.options().is_small;
  const Size size = is_small ? Size{} : Size{16, 128, 1024};
  const File file(size);
  vulkan::Device& device = session.device();
  const VkDescriptorSetLayout layout = scene::make_materials_layout(device);
  std::vector<double> reference, import, tangents, mips, upload;
  std::uint64_t texels = 0, vertices = 0, uploaded = 0, mip_texels = 0;
  const int runs = session.runs(15);
  for (int run = -1; run < runs; ++run) {  // the first one reads files for the first time, and does not count
    double reference_ms = 0, import_ms = 0;
    const auto run_reference = [&] {
      const double start = now_ms();
      texels = parse_and_decode(file.model());
      reference_ms = now_ms() - start;
    };
    scene::Scene loaded;
    const auto run_import = [&] {
      const double start = now_ms();
      scene::load_gltf(loaded, file.model());
      import_ms = now_ms() - start;
    };
    if (run % 2 == 0) {
      run_reference();
      run_import();
    } else {
      run_import();
      run_reference();
    }
    vertices = 0;
    double tangents_ms = 0;
    for (std::uint32_t mesh = 0; mesh < size.meshes; ++mesh) {
      scene::Attributes patch = make_patch(size, mesh, false);
      const double begun = now_ms();
      scene::complete(patch, 0);
      tangents_ms += now_ms() - begun;
      vertices += patch.positions.size();
    }
    double start = now_ms();
    mip_texels = 0;
    for (const scene::Texture& texture : loaded.textures)
      for (const scene::MipLevel& level : scene::make_mips(texture)) mip_texels += level.rgba.size() / 4;
    const double mips_ms = now_ms() - start;
    const vulkan::Counters before = device.counters();
    start = now_ms();
    scene::SceneBuffers(device, layout).update(loaded, glm::dvec3(0.0));
    const double update_ms = now_ms() - start;
    uploaded = device.counters().uploaded_bytes - before.uploaded_bytes;
    if (run < 0) continue;
    reference.push_back(reference_ms);
    import.push_back(import_ms);
    tangents.push_back(tangents_ms);
    mips.push_back(mips_ms);
    upload.push_back(update_ms - mips_ms);
  }
  Report& report = session.report;
  report.add_measured("gltf_import.ratio", "1", ratios(import, reference), 1.3);
  report.add_measured("gltf_import.import", "ms", import);
  report.add_measured("gltf_import.parser_and_decoder", "ms", reference);
  report.add_measured("gltf_import.tangents", "ms", tangents);
  report.add_measured("gltf_import.mips", "ms", mips);
  report.add_measured("gltf_import.upload", "ms", upload);
  report.add_number("gltf_import.file", "bytes", static_cast<double>(file.bytes()));
  report.add_number("gltf_import.vertices", "1", static_cast<double>(vertices));
  report.add_number("gltf_import.texels", "1", static_cast<double>(texels));
  report.add_number("gltf_import.mip_texels", "1", static_cast<double>(mip_texels));
  report.add_number("gltf_import.uploaded", "bytes", static_cast<double>(uploaded));
}

}  // namespace heddle::bench
