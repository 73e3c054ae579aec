// SPDX-License-Identifier: Apache-2.0
// A glTF file -> tinygltf's model with every container checked, and accessors -> arrays with every index, range and
// number checked. The only headers that see tinygltf are this one and its users gltf*.cpp.
#pragma once

#include <tiny_gltf.h>

#include "scene/scene.hpp"

namespace heddle::scene::gltf {

struct Document {
  std::string file;  // as the user named it, for messages
  LoadLimits limits;
  tinygltf::Model model;
  std::vector<std::string> warnings;            // each once
  std::vector<std::string> ignored_extensions;  // used by the file, unknown here
  std::vector<std::filesystem::path> files;     // this one and those that it names

  void warn(std::string text);
  /// How far loading has come, 0 to 1; throws if the caller wants no more.
  void report(std::string_view activity, double fraction) const;
  /// Counts bytes that are about to be made for `what`, and fails beyond the limit. Every byte costs time, so the limit
  /// is one of time too; what is given back is not counted back.
  void spend(std::uint64_t bytes, std::string_view what) const;
  [[nodiscard]] std::uint64_t bytes_left() const { return limits.bytes - spent_; }
  /// Throws Error(HEDDLE_BAD_INPUT) at this file.
  [[noreturn]] void fail(std::string message, std::string found = {}, std::string expected = {},
                         std::string help = {}) const;

 private:
  mutable std::uint64_t spent_ = 0;
};

/// Reads .gltf or .glb (told apart by content), with its buffers and the encoded bytes of external images. Throws Error
/// for files that cannot be read, are cut off, are not glTF 2.0, require an unknown extension, or name files outside of
/// their folder.
Document open_document(const std::filesystem::path& file, const LoadLimits& limits);

/// Encoded bytes of an image, wherever they are.
std::span<const std::byte> image_bytes(const Document& document, std::size_t image);

/// Elements of an accessor as float, normalized integers mapped to 0..1 or -1..1, sparse substitution done, all finite.
/// `what` names the accessor's job in messages ("POSITION of mesh 'a'").
std::vector<float> read_floats(const Document& document, int accessor, std::uint32_t components, std::string_view what);
/// The same for unsigned integers, unconverted: indices and joints.
std::vector<std::uint32_t> read_unsigned(const Document& document, int accessor, std::uint32_t components,
                                         std::string_view what);

template <typename Vector>
std::vector<Vector> read_vectors(const Document& document, int accessor, std::string_view what) {
  const std::vector<float> values = read_floats(document, accessor, Vector::length(), what);
  std::vector<Vector> vectors(values.size() / static_cast<std::size_t>(Vector::length()));
  std::copy(values.begin(), values.end(), vectors.empty() ? nullptr : &vectors[0][0]);
  return vectors;
}

}  // namespace heddle::scene::gltf
