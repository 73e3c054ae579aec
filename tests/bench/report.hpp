// SPDX-License-Identifier: Apache-2.0
// What benchmarks found -> text for people, JSON for programs.
#pragma once

#include "json.hpp"
#include "statistics.hpp"

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace heddle::bench {

struct Entry {
  std::string name;  // "graph_overhead.frame_ratio"
  std::string unit;
  Estimate estimate;
  std::size_t runs = 0;           // 0: counted or computed, not measured; no interval
  std::optional<double> at_most;  // the target
};

class Report {
 public:
  /// A median over runs.
  void add_measured(std::string name, std::string unit, std::vector<double> samples,
                    std::optional<double> at_most = {});
  /// A number without spread: a count, or the parameter of a fit.
  void add_number(std::string name, std::string unit, double value);

  Json machine;               // what it was measured on
  bool is_smoke_run = false;  // sizes that say nothing about time: targets are named, and nobody judges by them
  /// {"machine": {...}, "entries": [{"name", "value", "unit", "runs", "low", "high", "confidence", "minimum",
  /// "maximum", "at_most", "is_met"}]}; the last seven only where they apply. Of a smoke run {"is_smoke_run": true}
  /// too.
  [[nodiscard]] Json to_json() const;
  [[nodiscard]] std::string to_text() const;

 private:
  std::vector<Entry> entries_;
};

/// Model and number of processors, operating system, load average over a minute.
Json describe_machine();

}  // namespace heddle::bench
