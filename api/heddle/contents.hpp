// SPDX-License-Identifier: Apache-2.0
// heddle/contents.h for authors in C++: beside pass.hpp.
#pragma once

#include <heddle/contents.h>
#include <heddle/pass.hpp>

namespace heddle::pass {

/// Every texel of an image that the stage declares is the port's neutral value: nothing of the scene is in it. False
/// where nobody knows, as on a host without the service.
inline bool is_neutral(const Frame& frame, const char* port) {
  const auto* service = frame.host().service<heddle_contents_service>(HEDDLE_CONTENTS_SERVICE);
  return service != nullptr && service->is_neutral(frame.host().raw(), frame.raw(), port) != 0;
}

}  // namespace heddle::pass
