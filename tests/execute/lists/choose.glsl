// SPDX-License-Identifier: Apache-2.0
// Which pixels are worth work: a hash of the pixel and a salt. tests/execute/lists_test.cpp has the same.

uint hash(uvec2 pixel, uint salt) {
  uint state = (pixel.x + 4096u * pixel.y + 77u * salt) * 747796405u + 2891336453u;
  uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
  return (word >> 22u) ^ word;
}

bool is_chosen(uint value, int share) { return value % 1000u < uint(share); }
