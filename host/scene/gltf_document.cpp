// SPDX-License-Identifier: Apache-2.0
// The bytes of a glTF file -> a checked model, and accessors -> numbers. tinygltf parses; what it does not check about
// containers, ranges and nesting is checked here.

#include "scene/gltf_document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

namespace heddle::scene::gltf {
namespace {

constexpr std::array<std::string_view, 9> kKnownExtensions = {
    "HEDDLE_components",     "KHR_lights_punctual",        "KHR_materials_emissive_strength",
    "KHR_materials_ior",     "KHR_materials_transmission", "KHR_materials_unlit",
    "KHR_mesh_quantization", "KHR_texture_transform",      "FB_ngon_encoding"};

// tinygltf walks `extras` and `extensions` by recursion; real files nest less than ten deep.
constexpr std::uint32_t kMaximumNesting = 64;
// Accessors without a view are zeros that cost no bytes in the file: 2^26 of them are no honest mesh.
constexpr std::size_t kMaximumZeros = 1U << 26;

bool is_known(std::string_view extension) {
  return std::find(kKnownExtensions.begin(), kKnownExtensions.end(), extension) != kKnownExtensions.end();
}

// What tinygltf makes of an object and of a value in the JSON, at most: a node is the largest.
constexpr std::uint64_t kObjectBytes = 1024, kValueBytes = 64;

std::vector<unsigned char> read_whole(const std::filesystem::path& file) {
  std::error_code error_code;
  const auto fail = [&](std::string_view message, heddle_status status = HEDDLE_BAD_INPUT) {
    throw Error(status, Diagnostic{Severity::kError, {file.string(), 0, 0}, std::string(message), "", "", ""});
  };
  if (!std::filesystem::is_regular_file(file, error_code)) {
    fail("there is no such file");
  }
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  if (!stream) {
    fail("the file cannot be opened");
  }
  const std::streamoff size = stream.tellg();
  if (size > std::numeric_limits<std::int32_t>::max()) {
    fail("the file is larger than 2 GiB, more than the parser takes", HEDDLE_UNSUPPORTED);
  }
  std::vector<unsigned char> bytes(static_cast<std::size_t>(std::max<std::streamoff>(size, 0)));
  stream.seekg(0);
  if (!bytes.empty() && !stream.read(reinterpret_cast<char*>(bytes.data()), size)) {
    fail("the file cannot be read");
  }
  return bytes;
}

/// Names of strangers in messages, and what tinygltf quotes of them: a data URI has millions of characters.
std::string shortened(std::string text) {
  constexpr std::size_t kLongest = 160;
  if (text.size() > kLongest) {
    text.resize(kLongest);
    text += "...";
  }
  return text;
}

std::uint32_t word_at(std::span<const unsigned char> bytes, std::size_t offset) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

/// The JSON text of a binary file, after its header and chunks were found whole.
std::string_view check_container(const Document& document, std::span<const unsigned char> bytes) {
  constexpr std::size_t kHeader = 12, kChunkHeader = 8;
  constexpr std::uint32_t kJson = 0x4E4F534A, kBinary = 0x004E4942;
  if (bytes.size() < kHeader + kChunkHeader) {
    document.fail("the binary glTF file is cut off", fmt::format("{} bytes", bytes.size()),
                  "a header and a chunk, at least 20 bytes");
  }
  if (const std::uint32_t version = word_at(bytes, 4); version != 2) {
    document.fail("the binary glTF file has another version", fmt::format("{}", version), "2");
  }
  const std::size_t length = word_at(bytes, 8);
  if (length > bytes.size()) {
    document.fail("the binary glTF file is cut off", fmt::format("{} bytes", bytes.size()),
                  fmt::format("{} bytes, as its header says", length));
  }
  std::string_view json;
  std::size_t offset = kHeader;
  for (std::uint32_t chunk = 0; offset < length; ++chunk) {
    if (length - offset < kChunkHeader || word_at(bytes, offset) > length - offset - kChunkHeader) {
      document.fail(fmt::format("chunk {} of the binary glTF file reaches beyond its end", chunk));
    }
    const std::size_t size = word_at(bytes, offset);
    const std::uint32_t kind = word_at(bytes, offset + 4);
    if ((chunk == 0 && kind != kJson) || (chunk == 1 && kind != kBinary)) {
      document.fail(fmt::format("chunk {} of the binary glTF file is of the wrong kind", chunk),
                    fmt::format("{:#010x}", kind), chunk == 0 ? "JSON" : "BIN");
    }
    if (chunk == 0) {
      json = {reinterpret_cast<const char*>(bytes.data()) + offset + kChunkHeader, size};
    }
    offset += kChunkHeader + size;
  }
  return json;
}

/// Refuses JSON that would take more than the parser's stack, or more memory than the file may.
void check_json(const Document& document, std::string_view json) {
  std::uint32_t depth = 0;
  std::uint64_t objects = 0, values = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_string) {
      i += c == '\\' ? 1 : 0;
      in_string = c != '"';
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      ++objects;
      if (++depth > kMaximumNesting) {
        document.fail("the JSON is nested too deeply", "", fmt::format("at most {} levels", kMaximumNesting));
      }
    } else if ((c == '}' || c == ']') && depth > 0) {
      --depth;
    } else if (c == ',') {
      ++values;
    }
  }
  document.spend(json.size() + objects * kObjectBytes + values * kValueBytes, "the JSON");
}

/// What tinygltf asks of the file system, answered for the file's own folder alone.
struct Folder {
  Document* document = nullptr;
  std::filesystem::path path;  // of the file; empty: the working directory
  std::string missing;         // the last file that was named and is not there

  static Folder& of(void* user) { return *static_cast<Folder*>(user); }

  /// tinygltf tries the folder, then the working directory, which is none of the file's business.
  static bool exists(const std::string& tried, void* user) {
    Folder& folder = of(user);
    const std::string prefix = folder.path.empty() ? "" : folder.path.string();
    if (!tried.starts_with(prefix) || (prefix.empty() && tried.starts_with("./"))) {
      return false;
    }
    std::string name = tried.substr(prefix.size());
    name.erase(0, name.find_first_not_of('/'));
    const std::filesystem::path file = folder.path / name;
    std::error_code error_code;
    const std::filesystem::path real = std::filesystem::weakly_canonical(file, error_code);
    const std::filesystem::path home =
        std::filesystem::weakly_canonical(folder.path.empty() ? "." : folder.path, error_code);
    const bool is_inside = std::mismatch(home.begin(), home.end(), real.begin(), real.end()).first == home.end();
    if (!is_inside && !folder.document->limits.leaves_folder) {
      folder.document->fail(fmt::format("the file names a file outside of its folder: '{}'", shortened(name)), "",
                            "files beside it or below",
                            "if you trust it, load it with HEDDLE_LOAD_TRUSTED, or with --trust-files on the command");
    }
    if (!std::filesystem::is_regular_file(file, error_code)) {
      folder.missing = shortened(name);
      return false;
    }
    return true;
  }
  static std::string expand(const std::string& path, void* /*user*/) { return path; }
  static bool read(std::vector<unsigned char>* bytes, std::string* error, const std::string& path, void* user) {
    std::error_code error_code;
    const std::uintmax_t size = std::filesystem::file_size(path, error_code);
    of(user).document->spend(error_code ? 0 : size, fmt::format("'{}'", shortened(path)));
    try {
      *bytes = read_whole(path);
      of(user).document->files.emplace_back(path);
    } catch (const Error& thrown) {
      *error = thrown.what();
      return false;
    }
    return true;
  }
};

/// Keeps the encoded bytes of images that are not in a buffer view: tinygltf takes the address of those that are
/// without looking whether the view lies in its buffer (image_bytes does).
bool keep_encoded(tinygltf::Image* image, const int /*index*/, std::string* /*error*/, std::string* /*warning*/,
                  int /*width*/, int /*height*/, const unsigned char* bytes, int size, void* /*user*/) {
  if (image->bufferView < 0) {
    image->image.assign(bytes, bytes + size);
  }
  return true;
}

/// tinygltf ends most messages with a line break, and joins several.
std::string one_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ' || text.back() == '.')) {
    text.pop_back();
  }
  std::replace(text.begin(), text.end(), '\n', ' ');
  return shortened(std::move(text));
}

/// Bytes of `size` at `offset` in a buffer view; fails unless they lie in it, and it in its buffer.
const unsigned char* view_bytes(const Document& document, int view_index, std::size_t offset, std::size_t size,
                                std::string_view what) {
  const tinygltf::Model& model = document.model;
  if (view_index < 0 || static_cast<std::size_t>(view_index) >= model.bufferViews.size()) {
    document.fail(fmt::format("{}: there is no buffer view {}", what, view_index),
                  fmt::format("{} buffer views", model.bufferViews.size()));
  }
  const tinygltf::BufferView& view = model.bufferViews[static_cast<std::size_t>(view_index)];
  if (view.buffer < 0 || static_cast<std::size_t>(view.buffer) >= model.buffers.size()) {
    document.fail(
        fmt::format("{}: buffer view {} is in buffer {}, which does not exist", what, view_index, view.buffer),
        fmt::format("{} buffers", model.buffers.size()));
  }
  const std::vector<unsigned char>& data = model.buffers[static_cast<std::size_t>(view.buffer)].data;
  if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset) {
    document.fail(fmt::format("{}: buffer view {} reaches beyond its buffer", what, view_index),
                  fmt::format("{} bytes at {} of {}", view.byteLength, view.byteOffset, data.size()));
  }
  if (offset > view.byteLength || size > view.byteLength - offset) {
    document.fail(fmt::format("{}: the accessor reaches beyond buffer view {}", what, view_index),
                  fmt::format("{} bytes at {} of {}", size, offset, view.byteLength));
  }
  return data.data() + view.byteOffset + offset;
}

std::size_t component_bytes(const Document& document, int component_type, std::string_view what) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      document.fail(fmt::format("{}: unknown component type", what), fmt::format("{}", component_type),
                    "5120, 5121, 5122, 5123, 5125 or 5126");
  }
}

std::size_t checked_product(const Document& document, std::size_t a, std::size_t b, std::string_view what) {
  if (b != 0 && a > std::numeric_limits<std::uint32_t>::max() / b) {
    document.fail(fmt::format("{}: the accessor has more elements than memory can hold", what), fmt::format("{}", a));
  }
  return a * b;
}

const tinygltf::Accessor& accessor_at(const Document& document, int index, std::uint32_t components,
                                      std::string_view what) {
  if (index < 0 || static_cast<std::size_t>(index) >= document.model.accessors.size()) {
    document.fail(fmt::format("{}: there is no accessor {}", what, index),
                  fmt::format("{} accessors", document.model.accessors.size()));
  }
  const tinygltf::Accessor& accessor = document.model.accessors[static_cast<std::size_t>(index)];
  const int found = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
  if (found != static_cast<int>(components)) {
    document.fail(fmt::format("{}: accessor {} has the wrong number of components", what, index),
                  fmt::format("{}", found), fmt::format("{}", components));
  }
  return accessor;
}

float as_float(const unsigned char* from, int component_type, bool normalized) {
  const auto load = [from]<typename T>(T value) {
    std::memcpy(&value, from, sizeof value);
    return value;
  };
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: {
      const auto value = static_cast<float>(load(std::int8_t{}));
      return normalized ? std::max(value / 127.0F, -1.0F) : value;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: {
      const auto value = static_cast<float>(load(std::uint8_t{}));
      return normalized ? value / 255.0F : value;
    }
    case TINYGLTF_COMPONENT_TYPE_SHORT: {
      const auto value = static_cast<float>(load(std::int16_t{}));
      return normalized ? std::max(value / 32767.0F, -1.0F) : value;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      const auto value = static_cast<float>(load(std::uint16_t{}));
      return normalized ? value / 65535.0F : value;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT: {
      const auto value = static_cast<double>(load(std::uint32_t{}));
      return static_cast<float>(normalized ? value / 4294967295.0 : value);
    }
    default:
      return load(float{});
  }
}

std::uint32_t as_unsigned(const unsigned char* from, int component_type) {
  std::uint32_t value = 0;
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return *from;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      std::uint16_t small = 0;
      std::memcpy(&small, from, sizeof small);
      return small;
    }
    default:
      std::memcpy(&value, from, sizeof value);
      return value;
  }
}

bool is_unsigned(int component_type) {
  return component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

/// Runs over all elements of an accessor and the ones that a sparse part puts in their place. Components of the type
/// `native` are stored as Value is, and need no conversion.
template <typename Value, typename Convert>
std::vector<Value> read_elements(const Document& document, const tinygltf::Accessor& accessor, std::size_t components,
                                 std::string_view what, int native, const Convert& convert) {
  const std::size_t bytes = component_bytes(document, accessor.componentType, what);
  const std::size_t element = bytes * components;
  std::size_t stride = element;
  const unsigned char* data = nullptr;
  if (accessor.bufferView >= 0) {
    if (static_cast<std::size_t>(accessor.bufferView) < document.model.bufferViews.size()) {
      const std::size_t given = document.model.bufferViews[static_cast<std::size_t>(accessor.bufferView)].byteStride;
      stride = given != 0 ? given : element;
    }
    const std::size_t span =
        accessor.count == 0 ? 0 : checked_product(document, accessor.count, stride, what) - stride + element;
    data = view_bytes(document, accessor.bufferView, accessor.byteOffset, span, what);
  } else if (accessor.count > kMaximumZeros) {
    document.fail(fmt::format("{}: an accessor without data claims too many elements", what),
                  fmt::format("{}", accessor.count), fmt::format("at most {}", kMaximumZeros));
  }
  document.spend(checked_product(document, accessor.count, components, what) * sizeof(Value), what);
  std::vector<Value> values(accessor.count * components);
  if (data != nullptr && accessor.componentType == native && stride == element && !values.empty()) {
    std::memcpy(values.data(), data, values.size() * sizeof(Value));
  } else if (data != nullptr) {
    for (std::size_t i = 0; i < accessor.count; ++i) {
      for (std::size_t c = 0; c < components; ++c) {
        values[i * components + c] = convert(data + i * stride + c * bytes);
      }
    }
  }
  if (!accessor.sparse.isSparse) {
    return values;
  }
  const auto& sparse = accessor.sparse;
  if (sparse.count < 0 || sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0 ||
      !is_unsigned(sparse.indices.componentType)) {
    document.fail(fmt::format("{}: the sparse part of the accessor is not valid", what));
  }
  const auto count = static_cast<std::size_t>(sparse.count);
  document.spend(count * element, what);
  const std::size_t index_bytes = component_bytes(document, sparse.indices.componentType, what);
  const unsigned char* places =
      view_bytes(document, sparse.indices.bufferView, static_cast<std::size_t>(sparse.indices.byteOffset),
                 checked_product(document, count, index_bytes, what), what);
  const unsigned char* replacements =
      view_bytes(document, sparse.values.bufferView, static_cast<std::size_t>(sparse.values.byteOffset),
                 checked_product(document, count, element, what), what);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t place = as_unsigned(places + i * index_bytes, sparse.indices.componentType);
    if (place >= accessor.count) {
      document.fail(fmt::format("{}: a sparse index of the accessor is out of range", what), fmt::format("{}", place),
                    fmt::format("less than {}", accessor.count));
    }
    for (std::size_t c = 0; c < components; ++c) {
      values[place * components + c] = convert(replacements + i * element + c * bytes);
    }
  }
  return values;
}

}  // namespace

void Document::spend(std::uint64_t bytes, std::string_view what) const {
  if (bytes > bytes_left()) {
    fail(fmt::format("{}: the file needs more memory than it may", what), "",
         fmt::format("at most {} MiB in all", limits.bytes >> 20),
         "if you trust it, load it with HEDDLE_LOAD_TRUSTED, or with --trust-files on the command");
  }
  spent_ += bytes;
}

void Document::report(std::string_view activity, double fraction) const {
  if (limits.progress) {
    limits.progress(fmt::format("{}: {}", file, activity), fraction);
  }
}

void Document::warn(std::string text) {
  // Beyond that many nobody reads them, and a hostile file has millions.
  constexpr std::size_t kMaximumWarnings = 100;
  if (warnings.size() == kMaximumWarnings) {
    warnings.emplace_back("there are more warnings, which are left out");
  }
  if (warnings.size() > kMaximumWarnings) {
    return;
  }
  if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) {
    warnings.push_back(std::move(text));
  }
}

void Document::fail(std::string message, std::string found, std::string expected, std::string help) const {
  throw Error(
      HEDDLE_BAD_INPUT,
      Diagnostic{
          Severity::kError, {file, 0, 0}, std::move(message), std::move(found), std::move(expected), std::move(help)});
}

Document open_document(const std::filesystem::path& file, const LoadLimits& limits) {
  Document document;
  document.file = file.string();
  document.files.push_back(file);
  document.limits = limits;
  std::error_code error_code;
  if (const std::uintmax_t size = std::filesystem::file_size(file, error_code); !error_code) {
    document.spend(size, "the file");
  }
  const std::vector<unsigned char> bytes = read_whole(file);
  const auto size = static_cast<unsigned int>(bytes.size());
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const bool is_binary = text.starts_with("glTF");
  check_json(document, is_binary ? check_container(document, bytes) : text);

  tinygltf::TinyGLTF parser;
  parser.SetImageLoader(keep_encoded, nullptr);
  // Its own values drop empty objects, and a component may have no properties.
  parser.SetStoreOriginalJSONForExtrasAndExtensions(true);
  Folder names{&document, file.parent_path(), {}};
  parser.SetFsCallbacks({Folder::exists, Folder::expand, Folder::read, nullptr, &names});
  std::string error, warning;
  const std::string folder = names.path.string();
  bool is_parsed = false;
  try {
    is_parsed = is_binary ? parser.LoadBinaryFromMemory(&document.model, &error, &warning, bytes.data(), size, folder)
                          : parser.LoadASCIIFromString(&document.model, &error, &warning, text.data(), size, folder);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  if (!is_parsed && !names.missing.empty() && error.find("File not found") != std::string::npos) {
    document.fail(fmt::format("the file names '{}', which is not there", names.missing), "",
                  fmt::format("a file beside {}", document.file));
  }
  if (!is_parsed) {
    document.fail("the file is no valid glTF", one_line(error));
  }
  if (!document.model.asset.version.starts_with("2.")) {
    document.fail("the file is of another version of glTF", document.model.asset.version, "2.0");
  }
  for (const std::string& extension : document.model.extensionsRequired) {
    if (!is_known(extension)) {
      throw Error(HEDDLE_UNSUPPORTED, Diagnostic{Severity::kError,
                                                 {document.file, 0, 0},
                                                 fmt::format("the file requires the extension '{}'", extension),
                                                 "",
                                                 fmt::format("none but {}", fmt::join(kKnownExtensions, ", ")),
                                                 "export the file without it"});
    }
  }
  for (const std::string& extension : document.model.extensionsUsed) {
    if (!is_known(extension)) {
      document.ignored_extensions.push_back(extension);
    }
  }
  return document;
}

std::span<const std::byte> image_bytes(const Document& document, std::size_t index) {
  const tinygltf::Image& image = document.model.images.at(index);
  const std::string what = fmt::format("image {} '{}'", index, image.name.empty() ? image.uri : image.name);
  if (image.bufferView < 0) {
    if (image.image.empty()) {
      document.fail(fmt::format("{} cannot be read", what), "", fmt::format("a file beside {}", document.file));
    }
    return std::as_bytes(std::span(image.image));
  }
  const auto view = static_cast<std::size_t>(image.bufferView);  // tinygltf has checked that it exists
  const std::size_t size = document.model.bufferViews.at(view).byteLength;
  return std::as_bytes(std::span(view_bytes(document, image.bufferView, 0, size, what), size));
}

std::vector<float> read_floats(const Document& document, int index, std::uint32_t components, std::string_view what) {
  const tinygltf::Accessor& accessor = accessor_at(document, index, components, what);
  std::vector<float> values = read_elements<float>(
      document, accessor, components, what, TINYGLTF_COMPONENT_TYPE_FLOAT,
      [&](const unsigned char* from) { return as_float(from, accessor.componentType, accessor.normalized); });
  const auto bad = std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
  if (bad != values.end()) {
    document.fail(fmt::format("{}: a number is not finite", what),
                  fmt::format("{} in element {} of accessor {}", *bad, (bad - values.begin()) / components, index));
  }
  return values;
}

std::vector<std::uint32_t> read_unsigned(const Document& document, int index, std::uint32_t components,
                                         std::string_view what) {
  const tinygltf::Accessor& accessor = accessor_at(document, index, components, what);
  if (!is_unsigned(accessor.componentType)) {
    document.fail(fmt::format("{}: accessor {} holds no unsigned integers", what, index),
                  fmt::format("component type {}", accessor.componentType), "5121, 5123 or 5125");
  }
  return read_elements<std::uint32_t>(
      document, accessor, components, what, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
      [&](const unsigned char* from) { return as_unsigned(from, accessor.componentType); });
}

}  // namespace heddle::scene::gltf
