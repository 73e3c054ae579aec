// SPDX-License-Identifier: Apache-2.0
#include "json.hpp"

namespace heddle {

Json parse_json(std::string_view text) {
  return Json::parse(text);
}

std::string write_json(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

std::string text_of(const Json& object, const char* key) {
  return object[key].get<std::string>();
}

}  // namespace heddle
