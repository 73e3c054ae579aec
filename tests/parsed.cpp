// SPDX-License-Identifier: Apache-2.0
#include "parsed.hpp"

namespace parsed {

nlohmann::json json(std::string_view text) {
  return nlohmann::json::parse(text);
}

}  // namespace parsed
