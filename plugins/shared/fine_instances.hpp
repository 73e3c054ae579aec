// SPDX-License-Identifier: Apache-2.0
// The scene's components mesh_detail.fine -> which instances are the finer shape of which.
#pragma once

#include <heddle/meshes.hpp>

#include <map>
#include <string>
#include <vector>

namespace fine_instances {

inline constexpr const char* kComponent = "mesh_detail.fine";

/// Fine ones by coarse one, ids of instances; `frame` NULL: in declare. Errors name the instance and what is wrong.
inline heddle_status read(const heddle::pass::PassHost& host, heddle_frame* frame,
                          std::map<std::uint32_t, std::vector<std::uint32_t>>& out) {
  out.clear();
  std::optional<heddle::pass::Components> table;
  if (const heddle_status status = heddle::pass::components(host, frame, kComponent, table); status != HEDDLE_OK)
    return status;
  const std::uint32_t count = heddle::pass::Meshes(host).content().instance_count;
  for (std::uint32_t row = 0; row < table->count(); ++row) {
    const std::uint32_t fine = table->owner(row);
    const auto coarse = static_cast<std::uint32_t>(table->values(row, "of")[0]);
    const auto fail = [&](const std::string& expected) {
      return host.fail(HEDDLE_BAD_INPUT, "instance " + std::to_string(fine) + ": " + kComponent + ".of is " +
                                             std::to_string(coarse) + "; expected: the id of " + expected);
    };
    if (coarse >= count) return fail("an instance, less than " + std::to_string(count));
    if (coarse == fine) return fail("another instance");
    if (table->find(HEDDLE_OWNER_INSTANCE, coarse)) return fail("a coarse instance, which this one is not itself");
    out[coarse].push_back(fine);
  }
  return HEDDLE_OK;
}

}  // namespace fine_instances
