// SPDX-License-Identifier: Apache-2.0
// The count of a list, as it stands on the GPU -> the work groups of a dispatch over its elements.
#include "vulkan/shader_source.hpp"

namespace heddle::vulkan {
namespace {

constexpr std::string_view kGroups = R"(#version 460
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 0) readonly buffer HeddleList { uint heddle_list[4]; };
layout(std430, set = 0, binding = 1) writeonly buffer HeddleGroups { uint groups[3]; };
layout(push_constant) uniform Push { uint capacity, local_size; } push;

void main() {
  uint count = min(heddle_list[0], push.capacity);
  groups[0] = count / push.local_size + (count % push.local_size == 0u ? 0u : 1u);
  groups[1] = 1u;
  groups[2] = 1u;
}
)";

}  // namespace

CompiledShader list_groups_shader(const std::filesystem::path& cache_folder) {
  CompiledShader shader;
  shader.kind = ShaderKind::kCompute;
  shader.spirv = shader::compile_own("list_groups.comp", kGroups, cache_folder, {});
  shader.bindings = {{0, 0, Binding::Kind::kStorageBuffer, "", "list", "", HEDDLE_ACCESS_STORAGE_READ},
                     {0, 1, Binding::Kind::kStorageBuffer, "", "groups", "", HEDDLE_ACCESS_STORAGE_WRITE}};
  shader.push_bytes = sizeof(ListGroups);
  return shader;
}

}  // namespace heddle::vulkan
