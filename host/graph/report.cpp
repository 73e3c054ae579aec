// SPDX-License-Identifier: Apache-2.0
#include "graph/report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace heddle::graph {
namespace {

constexpr std::array<std::string_view, 3> kLevels{"error", "warning", "info"};  // = HEDDLE_SEVERITY_*

Json number_json(double number) {
  if (std::isnan(number)) return "nan";
  if (std::isinf(number)) return number > 0 ? "inf" : "-inf";
  // Counts are counts: 2442, not 2442.0. Beyond 2^53 a double does not tell whole numbers apart.
  if (std::trunc(number) == number && std::abs(number) <= 0x1p53) return static_cast<std::int64_t>(number);
  return number;
}

}  // namespace

std::string report_line(const heddle_report_row& row) {
  Json values = Json::object();
  for (std::uint32_t i = 0; i < row.value_count; ++i) {
    // By the size that their author knows: another minor version's may differ.
    const auto* at = reinterpret_cast<const std::byte*>(row.values) + std::size_t{i} * row.values->struct_size;
    heddle_report_value value{};
    std::memcpy(&value, at, std::min<std::size_t>(row.values->struct_size, sizeof value));
    if (value.name == nullptr) continue;
    values[value.name] = value.text != nullptr ? Json(value.text) : number_json(value.number);
  }
  return write_json(Json{{"level", kLevels.at(row.level)}, {"message", row.message}, {"values", std::move(values)}});
}

Json report_rows(std::span<const std::byte> lines) {
  Json rows = Json::array();
  std::string_view rest(reinterpret_cast<const char*>(lines.data()), lines.size());
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    rows.push_back(parse_json(rest.substr(0, end)));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return rows;
}

std::size_t count_errors(const Json& rows) {
  return static_cast<std::size_t>(
      std::ranges::count_if(rows, [](const Json& row) { return row["level"] == kLevels[HEDDLE_SEVERITY_ERROR]; }));
}

}  // namespace heddle::graph
