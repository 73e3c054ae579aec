// SPDX-License-Identifier: Apache-2.0
// SPIR-V words -> which bindings the code reads and writes. The access check compares them with what descriptors
// declare; the hazard checker takes them as what a dispatch or draw does.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace heddle::vulkan::shader {

/// A variable with a set and a binding, and what code that the entry point can reach does to what is bound there.
/// Only declared (or asked for its size): neither.
struct BoundVariable {
  std::uint32_t set = 0, binding = 0;
  std::string name;  // of the variable, or of its block's type; "" if the words have lost their names
  bool reads = false, writes = false;
  bool is_atomic = false;                            // it is touched, and by atomic operations alone
  bool reads_without_format = false;                 // a storage image whose type names no format is loaded from
  std::uint32_t element_bytes = 0, elements_at = 0;  // of the array without length that ends a block: stride, offset
  bool operator==(const BoundVariable&) const = default;
};

/// By set and binding. Code behind a condition that is always false counts: glslang keeps it. What the walk
/// does not know counts as a read and a write, so that it errs towards "used". Words that are no module: nothing.
std::vector<BoundVariable> find_accesses(std::span<const std::uint32_t> words);

}  // namespace heddle::vulkan::shader
