// SPDX-License-Identifier: Apache-2.0
// A surface -> its position relative to the drawing's origin.
#include "pass.glsl"

void main() { color = vec4(surface.position_rel, 1.0); }
