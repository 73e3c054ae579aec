// SPDX-License-Identifier: Apache-2.0
// A field of squares that stand in rows of eight, 1 m apart, facing +Z: all but every third one is drawn.
// out vertices, indices  one square
//     instances          as many as there are squares
//     put()              the draw of square i, with one instance or none
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { float x, y, z; uint count; } push;  // where the field begins, relative to the view

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < 4u) {
    HeddleVertex vertex;
    vertex.position = vec3(i == 1u || i == 2u ? 0.4 : -0.4, i >= 2u ? 0.4 : -0.4, 0.0);
    vertex.u0 = 0.0;
    vertex.normal = vec3(0.0, 0.0, 1.0);
    vertex.v0 = 0.0;
    vertex.tangent = vec4(1.0, 0.0, 0.0, 1.0);
    vertex.color = 0xffffffffu;
    vertex.u1 = 0.0;
    vertex.v1 = 0.0;
    vertex.reserved_ = 0.0;
    vertices[i] = vertex;
  }
  if (i < 6u) indices[i] = i < 3u ? i : i == 3u ? 0u : i - 2u;
  if (i >= push.count) return;
  HeddleInstance instance;
  mat4 place = mat4(1.0);
  place[3].xyz = vec3(push.x + float(i % 8u), push.y + float(i / 8u), push.z);
  instance.rel_from_object = place;
  instance.previous_rel_from_object = place;
  instance.material = 0u;
  instance.object = i;
  instance.flags = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_CASTS_SHADOW;
  instance.flip = 0u;
  instance.previous_vertex = 0u;
  instance.reserved0_ = 0u;
  instance.reserved1_ = 0u;
  instance.reserved2_ = 0u;
  instances[i] = instance;
  put(i, i % 3u == 2u ? 0u : 1u);
}
