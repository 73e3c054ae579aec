// SPDX-License-Identifier: Apache-2.0
// Any bytes as a glTF file: loaded or refused, never a crash, and what was loaded can be posed, asked and traced.
// With clang's libFuzzer this is its target (scripts/fuzz); replay_main.cpp runs it over a folder without.
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>

#include "scene/upload.hpp"

namespace {

namespace scene = heddle::scene;

/// Memory if there is such a folder: a file is written for every input.
const std::filesystem::path& folder() {
  static const std::filesystem::path made = [] {
    const std::filesystem::path parent =
        std::filesystem::is_directory("/dev/shm") ? "/dev/shm" : std::filesystem::temp_directory_path();
    std::filesystem::path own = parent / ("heddle_gltf_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directories(own);
    std::ofstream(own / "a.bin", std::ios::binary) << std::string(256, '\1');
    return own;
  }();
  return made;
}

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", what);
  std::abort();
}

/// What a loaded scene promises to everyone behind it.
void check(const scene::Scene& loaded) {
  for (const scene::Mesh& mesh : loaded.meshes) {
    require(mesh.indices.size() % 3 == 0, "whole triangles");
    require(mesh.material < loaded.materials.size(), "a mesh has a material");
    for (const std::uint32_t index : mesh.indices) require(index < mesh.vertices.size(), "indices are in range");
    for (const HeddleVertex& vertex : mesh.vertices) {
      float sum = 0;
      for (int i = 0; i < 3; ++i) {
        require(std::isfinite(vertex.position[i]), "positions are finite");
        sum += vertex.normal[i] * vertex.normal[i];
      }
      require(std::abs(sum - 1.0F) < 1e-3F, "normals have length 1");
    }
  }
  for (const scene::Instance& instance : loaded.instances) {
    require(instance.mesh < loaded.meshes.size(), "an instance has a mesh");
    for (int i = 0; i < 16; ++i) require(std::isfinite(instance.scene_from_object[i / 4][i % 4]), "places are finite");
  }
  for (const scene::Material& material : loaded.materials) {
    require(material.record.roughness >= 0 && material.record.roughness <= 1, "roughness is in range");
    require(material.record.metalness >= 0 && material.record.metalness <= 1, "metalness is in range");
    require(material.record.ior >= 1, "ior is in range");
    for (const std::uint32_t texture : material.textures)
      require(texture == HEDDLE_NONE || texture < loaded.textures.size(), "textures exist");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::filesystem::path file = folder() / "a.gltf";
  std::ofstream(file, std::ios::binary).write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  scene::Scene loaded;
  scene::LoadLimits limits;
  limits.bytes = 64ULL << 20;  // so that an input costs a fraction of a second at most
  try {
    scene::load_gltf(loaded, file, limits);
  } catch (const heddle::Error& error) {
    require(*error.what() != '\0', "an error says something");
    return 0;
  }
  check(loaded);
  (void)loaded.describe_json();
  (void)loaded.active_camera(64, 64);
  for (const double time : {0.4, 1e9, -3.0}) {
    try {
      loaded.set_time(time);
    } catch (const heddle::Error&) {  // what is moved beyond float64 is refused too
    }
    check(loaded);
  }
  for (std::uint32_t i = 0; i < loaded.animation_count(); ++i) {
    try {
      loaded.use_animation(i, true);
    } catch (const heddle::Error&) {
    }
  }
  scene::Snapshot snapshot;
  const heddle_snapshot& triangles = snapshot.update(loaded);
  for (std::uint32_t i = 0; i < triangles.triangle_count; i += 97) {
    (void)snapshot.alpha_test()(&triangles, i, 0.3F, 0.3F);
  }
  return 0;
}
