// SPDX-License-Identifier: Apache-2.0
// tinygltf's own code, alone: it brings a JSON parser and is compiled once. Images go through our one decoder.
#define TINYGLTF_IMPLEMENTATION
#include <tiny_gltf.h>
