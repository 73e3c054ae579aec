// SPDX-License-Identifier: Apache-2.0
// Vertices of meshes, or of a technique's own program, and HeddleInstance -> the block `surface` that every surface
// shader reads; and the fragment shader of depth-only drawings of alpha-masked materials.
#include "vulkan/shader_source.hpp"

#include <fmt/format.h>

namespace heddle::vulkan {
namespace {

// Set 3 of all programs but their vertices, and what fragments read.
constexpr std::string_view kVertexHead = R"(
layout(std430, set = 3, binding = 1) readonly buffer HeddleInstances { HeddleInstance instances[]; };
layout(std140, set = 3, binding = 3) uniform HeddleSurfaceView { HeddleView view; };

// The fragment side of this block is written in shader_generate.cpp: same order, same locations.
layout(location = 0) out HeddleSurface {
  vec3 position_rel, previous_position_rel;
  vec3 normal;
  vec4 tangent;
  vec2 uv0, uv1;
  vec4 color;
  flat uint material, object, flags;
} surface;

// Passes that draw the same triangles again must hit the same depths.
out gl_PerVertex { invariant vec4 gl_Position; };

// Unit vector, or zero. Scaled first: squares of small vectors would be flushed to zero here.
vec3 unit(vec3 v) {
  float largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
  return largest > 0.0 ? normalize(v / largest) : vec3(0.0);
}

void show(HeddleVertex vertex, vec3 previous_position, HeddleInstance instance) {
  precise vec4 position_rel = instance.rel_from_object * vec4(vertex.position, 1.0);
  precise vec4 previous_rel = instance.previous_rel_from_object * vec4(previous_position, 1.0);
  gl_Position = view.clip_from_rel * vec4(position_rel.xyz, 1.0);

  // Normals go by the inverse transpose: the cofactors, up to the sign of the determinant. Columns are brought to a
  // similar size first, for tiny and huge objects alike.
  mat3 m = mat3(instance.rel_from_object);
  float largest = max(max(dot(abs(m[0]), vec3(1.0)), dot(abs(m[1]), vec3(1.0))), dot(abs(m[2]), vec3(1.0)));
  m /= max(largest, 1e-30);
  mat3 cofactors = mat3(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1]));
  float mirror = instance.flip != 0u ? -1.0 : 1.0;

  surface.position_rel = position_rel.xyz;
  surface.previous_position_rel = previous_rel.xyz;
  surface.normal = mirror * unit(cofactors * vertex.normal);
  surface.tangent = vec4(unit(m * vertex.tangent.xyz), mirror * vertex.tangent.w);
  surface.uv0 = vec2(vertex.u0, vertex.v0);
  surface.uv1 = vec2(vertex.u1, vertex.v1);
  surface.color = unpackUnorm4x8(vertex.color);
  surface.material = instance.material;
  surface.object = instance.object;
  surface.flags = instance.flags;
}
)";

constexpr std::string_view kMeshVertices = R"(#version 460
#include <heddle/records.h>
layout(std430, set = 3, binding = 0) readonly buffer HeddleVertices { HeddleVertex vertices[]; };
)";
constexpr std::string_view kMeshMain = R"(
void main() {
  HeddleInstance instance = instances[gl_InstanceIndex];
  // What bends has its last shape elsewhere in the same buffer; for all else this is the same vertex.
  show(vertices[gl_VertexIndex], vertices[uint(gl_VertexIndex) + instance.previous_vertex].position, instance);
}
)";

constexpr std::string_view kProgramMain = R"(
void main() {
  vec3 previous_position;
  HeddleVertex vertex = surface_vertex(uint(gl_VertexIndex), previous_position);
  show(vertex, previous_position, instances[gl_InstanceIndex]);
}
)";

constexpr std::string_view kEvaluationMain = R"(
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint count; } push;
void main() {
  uint index = gl_GlobalInvocationID.x;
  if (index >= push.count) return;
  vec3 previous_position;
  evaluated[index] = surface_vertex(index, previous_position);
}
)";

// Holes must be where a technique's own fragment shader leaves them: the same lookup, product and comparison.
constexpr std::string_view kMaskedMain = R"(
void main() {
  HeddleMaterial material = materials[surface.material];
  vec4 color = material.base_color * surface.color;
  uint layer = material.texture_layer[HEDDLE_TEXTURE_BASE_COLOR];
  // As in plugins/shared/surface_sample.glsl: the footprint from the interpolated coordinates, because helper invocations
  // may load 0 from buffers, which leaves transformed ones without derivatives.
  float scale = view.lod_bias == 0.0 ? 1.0 : exp2(view.lod_bias);
  vec2 uv0_dx = scale * dFdx(surface.uv0), uv0_dy = scale * dFdy(surface.uv0);
  vec2 uv1_dx = scale * dFdx(surface.uv1), uv1_dy = scale * dFdy(surface.uv1);
  if (layer != HEDDLE_NO_TEXTURE) {
    bool uses_uv1 = (material.texture_uv_sets & (1u << HEDDLE_TEXTURE_BASE_COLOR)) != 0u;
    mat2 m = mat2(material.uv_rotation_scale.xy, material.uv_rotation_scale.zw);
    vec2 uv = m * (uses_uv1 ? surface.uv1 : surface.uv0) + material.uv_offset;
    color *= textureGrad(texture_base_color, vec3(uv, float(layer)), m * (uses_uv1 ? uv1_dx : uv0_dx),
                         m * (uses_uv1 ? uv1_dy : uv0_dy));
  }
  if (material.alpha_mode == HEDDLE_ALPHA_MASK && color.a < material.alpha_cutoff) discard;
}
)";

}  // namespace

namespace shader {

std::string program_main() {
  const std::string include = fmt::format("#include \"role/{}.glsl\"\n", kProgramRole);
  return include + std::string(kVertexHead) + std::string(kProgramMain);
}

std::string program_evaluation_main() {
  return fmt::format("#include \"role/{}.glsl\"\n", kProgramRole) + std::string(kEvaluationMain);
}

}  // namespace shader

SurfaceProgram mesh_program(const std::filesystem::path& cache_folder,
                            const std::vector<std::filesystem::path>& shared_folders) {
  SurfaceProgram program;
  const std::string vertex = std::string(kMeshVertices) + std::string(kVertexHead) + std::string(kMeshMain);
  program.vertex = shader::compile_own("mesh.vert", vertex, cache_folder, shared_folders);
  const std::string masked = "#version 460\n#include <heddle/records.h>\n" +
                             shader::declare_kind(ShaderKind::kSurfaces) + std::string(kMaskedMain);
  program.masked_fragment = shader::compile_own("mesh.frag", masked, cache_folder, shared_folders);
  return program;
}

}  // namespace heddle::vulkan
