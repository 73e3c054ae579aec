// SPDX-License-Identifier: Apache-2.0
// The field with its draws in a list, whose number stays on the GPU.
#include "pass.glsl"
void put(uint i, uint count) {
  if (count > 0u) append_commands(uint[5](6u, count, 0u, 0u, i));
}
#include "field.glsl"
