// SPDX-License-Identifier: Apache-2.0
// Rows of a report, as text that is kept: a line of JSON each.
#pragma once

#include "json.hpp"

#include <heddle/plugin.h>

#include <cstddef>
#include <span>

namespace heddle::graph {

/// {"level", "message", "values": {name: number or text}}, without the end of the line. Numbers that JSON lacks are
/// "nan", "inf", "-inf".
std::string report_line(const heddle_report_row& row);
/// The lines as an array.
Json report_rows(std::span<const std::byte> lines);
/// How many of the rows are errors.
std::size_t count_errors(const Json& rows);

}  // namespace heddle::graph
