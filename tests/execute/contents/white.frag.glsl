// SPDX-License-Identifier: Apache-2.0
// A surface -> 1 in both images.
#include "pass.glsl"

void main() { image = other = vec4(1.0); }
