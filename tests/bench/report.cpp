// SPDX-License-Identifier: Apache-2.0
#include "report.hpp"

#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

namespace heddle::bench {

void Report::add_measured(std::string name, std::string unit, std::vector<double> samples,
                          std::optional<double> at_most) {
  const std::size_t runs = samples.size();
  entries_.push_back({std::move(name), std::move(unit), median_of(std::move(samples)), runs, at_most});
}

void Report::add_number(std::string name, std::string unit, double value) {
  Entry& entry = entries_.emplace_back();
  entry.name = std::move(name);
  entry.unit = std::move(unit);
  entry.estimate.value = value;
}

Json Report::to_json() const {
  Json json{{"machine", machine}, {"entries", Json::array()}};
  for (const Entry& entry : entries_) {
    Json one{{"name", entry.name}, {"value", entry.estimate.value}, {"unit", entry.unit}, {"runs", entry.runs}};
    if (entry.runs > 0) {
      one["low"] = entry.estimate.low;
      one["high"] = entry.estimate.high;
      one["confidence"] = entry.estimate.confidence;
      one["minimum"] = entry.estimate.minimum;
      one["maximum"] = entry.estimate.maximum;
    }
    if (entry.at_most) {
      one["at_most"] = *entry.at_most;
      if (!is_smoke_run) one["is_met"] = entry.estimate.value <= *entry.at_most;
    }
    json["entries"].push_back(std::move(one));
  }
  if (is_smoke_run) json["is_smoke_run"] = true;
  return json;
}

std::string Report::to_text() const {
  std::string text =
      fmt::format("{}, {} processors, {}; load {:.1f}\n{} ({} {})\n\n", machine["processor"].get<std::string>(),
                  machine["processors"].get<long>(), machine["system"].get<std::string>(),
                  machine["load_average"].get<double>(), machine["device"].get<std::string>(),
                  machine["driver"].get<std::string>(), machine["driver_version"].get<std::string>());
  if (is_smoke_run) text += "--small: everything runs, at sizes that say nothing about time; no target is judged\n\n";
  text += fmt::format("{:<46} {:>11}  {:<24} {:>5}\n", "median", "", "interval of it", "runs");
  for (const Entry& entry : entries_) {
    const Estimate& found = entry.estimate;
    text += fmt::format("{:<46} {:>11.5g}", entry.name, found.value);
    if (entry.runs > 0) {
      text += fmt::format("  {:<24} {:>5}", fmt::format("{:.5g} to {:.5g}", found.low, found.high), entry.runs);
    } else {
      text += fmt::format("  {:<24} {:>5}", "", "");
    }
    text += "  " + entry.unit;
    if (entry.at_most) text += fmt::format("; target at most {:g}", *entry.at_most);
    if (entry.at_most && !is_smoke_run) text += found.value <= *entry.at_most ? ": met" : ": missed";
    text += '\n';
  }
  return text;
}

Json describe_machine() {
  std::string processor = "unknown processor";
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (!line.starts_with("model name")) continue;
    processor = line.substr(std::min(line.find(": "), line.size() - 2) + 2);
    break;
  }
  utsname system{};
  uname(&system);
  double load = 0;
  (void)getloadavg(&load, 1);
  return {{"processor", processor},
          {"processors", sysconf(_SC_NPROCESSORS_ONLN)},
          {"system", fmt::format("{} {}", system.sysname, system.release)},
          {"load_average", load}};
}

}  // namespace heddle::bench
