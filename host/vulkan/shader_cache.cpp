// SPDX-License-Identifier: Apache-2.0
// Compiled shaders on disk, one file each, named by the hash of everything that went in. A damaged file is no entry.
#include "vulkan/shader_source.hpp"

#include <array>
#include <atomic>
#include <bit>
#include <cstring>
#include <fstream>

#include <fmt/format.h>
#include <unistd.h>

namespace heddle::vulkan::shader {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kMagic = "heddle-shader 1\n";

class Writer {
 public:
  void number(std::uint32_t value) { bytes_.append(reinterpret_cast<const char*>(&value), sizeof value); }
  void text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    bytes_ += value;
  }
  std::string bytes_;
};

class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  std::uint32_t number() {
    std::uint32_t value = 0;
    if (!has(sizeof value)) return 0;
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string text() {
    const std::uint32_t size = number();
    if (!has(size)) return {};
    at_ += size;
    return std::string(bytes_.substr(at_ - size, size));
  }
  /// A count of things that take at least `bytes` each, so that a damaged one cannot ask for all memory.
  std::uint32_t count(std::size_t bytes) {
    const std::uint32_t value = number();
    return has(value * bytes) ? value : 0;
  }
  [[nodiscard]] bool is_good() const { return is_good_ && at_ == bytes_.size(); }

 private:
  bool has(std::size_t size) {
    is_good_ = is_good_ && bytes_.size() - at_ >= size;
    return is_good_;
  }
  std::string_view bytes_;
  std::size_t at_ = 0;
  bool is_good_ = true;
};

std::string serialize(const CompiledShader& shader) {
  Writer out;
  out.number(static_cast<std::uint32_t>(shader.kind));
  out.number(static_cast<std::uint32_t>(shader.spirv.size()));
  for (const std::uint32_t word : shader.spirv) out.number(word);
  out.number(static_cast<std::uint32_t>(shader.bindings.size()));
  for (const Binding& binding : shader.bindings) {
    out.number(binding.set);
    out.number(binding.binding);
    out.number(static_cast<std::uint32_t>(binding.kind));
    out.number(binding.access);
    out.text(binding.pass);
    out.text(binding.port);
    out.text(binding.role);
  }
  for (const std::uint32_t size : shader.local_size) out.number(size);
  out.number(shader.push_bytes);
  out.number(shader.loops);
  out.number(shader.uses_materials ? 1 : 0);
  out.number(static_cast<std::uint32_t>(shader.warnings.size()));
  for (const std::string& warning : shader.warnings) out.text(warning);
  out.number(static_cast<std::uint32_t>(shader.constants.size()));
  for (const ConstantSlot& slot : shader.constants) {
    out.number(slot.id);
    out.number(slot.parameter);
    out.text(slot.pass);
  }
  return std::move(out.bytes_);
}

std::optional<CompiledShader> deserialize(std::string_view bytes) {
  Reader in(bytes);
  CompiledShader shader;
  shader.kind = static_cast<ShaderKind>(in.number());
  shader.spirv.resize(in.count(4));
  for (std::uint32_t& word : shader.spirv) word = in.number();
  shader.bindings.resize(in.count(28));
  for (Binding& binding : shader.bindings) {
    binding.set = in.number();
    binding.binding = in.number();
    binding.kind = static_cast<Binding::Kind>(in.number());
    binding.access = in.number();
    binding.pass = in.text();
    binding.port = in.text();
    binding.role = in.text();
  }
  for (std::uint32_t& size : shader.local_size) size = in.number();
  shader.push_bytes = in.number();
  shader.loops = in.number();
  shader.uses_materials = in.number() != 0;
  shader.warnings.resize(in.count(4));
  for (std::string& warning : shader.warnings) warning = in.text();
  shader.constants.resize(in.count(12));
  for (ConstantSlot& slot : shader.constants) {
    slot.id = in.number();
    slot.parameter = in.number();
    slot.pass = in.text();
  }
  if (!in.is_good()) return std::nullopt;
  return shader;
}

std::string checksum(std::string_view payload) {
  ContentHash hash;
  hash.add(payload);
  return hash.hexadecimal();
}

fs::path entry_file(const fs::path& folder, const std::string& key) {
  return folder / (key + ".shader");
}

}  // namespace

std::optional<CompiledShader> read_cache(const fs::path& folder, const std::string& key) {
  if (folder.empty()) return std::nullopt;
  const std::optional<std::string> file = read_file(entry_file(folder, key));
  if (!file) return std::nullopt;
  // Head: magic, key, checksum of the rest.
  const std::string_view bytes = *file;
  const std::size_t head = kMagic.size() + 2 * key.size();
  if (bytes.size() < head || !bytes.starts_with(kMagic) || bytes.substr(kMagic.size(), key.size()) != key) {
    return std::nullopt;
  }
  const std::string_view payload = bytes.substr(head);
  if (bytes.substr(kMagic.size() + key.size(), key.size()) != checksum(payload)) return std::nullopt;
  std::optional<CompiledShader> shader = deserialize(payload);
  if (shader) shader->is_from_cache = true;
  return shader;
}

std::string write_cache(const fs::path& folder, const std::string& key, const CompiledShader& shader) {
  if (folder.empty()) return {};
  static std::atomic<std::uint32_t> count = 0;
  const std::string payload = serialize(shader);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return fmt::format("the shader cache {} cannot be made: {}", folder.string(), error.message());
  const fs::path temporary = folder / fmt::format("{}.{}.{}.new", key, ::getpid(), count++);
  {
    std::ofstream stream(temporary, std::ios::binary);
    stream << kMagic << key << checksum(payload) << payload;
    stream.close();
    if (!stream) {
      fs::remove(temporary, error);
      return fmt::format("the shader cache {} cannot be written", folder.string());
    }
  }
  fs::rename(temporary, entry_file(folder, key), error);
  if (error) {
    const std::string why = error.message();
    fs::remove(temporary, error);
    return fmt::format("the shader cache {} cannot be written: {}", folder.string(), why);
  }
  return {};
}

}  // namespace heddle::vulkan::shader
