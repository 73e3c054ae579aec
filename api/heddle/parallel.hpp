// SPDX-License-Identifier: Apache-2.0
// heddle/parallel.h for authors in C++: beside pass.hpp.
#pragma once

#include <heddle/parallel.h>
#include <heddle/pass.hpp>

namespace heddle::pass {

/// In execute: work(i) for each i below `count`, in any order, on as many threads as there are processors; on a host
/// without the service, one after the other. What it makes must not depend on the order, and it calls nothing of the
/// host but what is [any-thread] and throws nothing: on other threads nobody catches it.
template <typename Work>
heddle_status for_each_index(const PassHost& host, std::uint64_t count, const Work& work) {
  const auto* service = host.service<heddle_parallel_service>(HEDDLE_PARALLEL_SERVICE);
  if (service == nullptr) {
    for (std::uint64_t i = 0; i < count; ++i) work(i);
    return HEDDLE_OK;
  }
  const auto call = [](void* user, std::uint64_t index, std::uint32_t) { (*static_cast<const Work*>(user))(index); };
  return service->for_each(host.raw(), 0, count, call, const_cast<void*>(static_cast<const void*>(&work)));
}

}  // namespace heddle::pass
