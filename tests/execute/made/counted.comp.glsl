// SPDX-License-Identifier: Apache-2.0
// The field with its draws in an array: those that are not drawn have no instance.
#include "pass.glsl"
void put(uint i, uint instances) {
  commands[5u * i] = 6u;
  commands[5u * i + 1u] = instances;
  commands[5u * i + 2u] = 0u;
  commands[5u * i + 3u] = 0u;
  commands[5u * i + 4u] = i;
}
#include "field.glsl"
