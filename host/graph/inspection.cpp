// SPDX-License-Identifier: Apache-2.0
// The JSON of Executor::inspect -> a table for each pixel.
#include "graph/inspection.hpp"

#include <fmt/format.h>

#include "graph/explain.hpp"

namespace heddle::graph {
namespace {

/// The fewest digits that give the float32 back.
std::string value_text(const Json& value) {
  return value.is_string() ? value.get<std::string>() : fmt::format("{}", value.get<float>());
}

std::string values_text(const Json& layer) {
  std::string text;
  for (const Json& value : layer["values"]) text += (text.empty() ? "" : " ") + value_text(value);
  for (const Json& problem : layer["problems"])
    text += fmt::format("   <- channel {}: {}", problem["channel"].get<int>(), problem["problem"].get<std::string>());
  return text;
}

std::string extent_text(const Json& extent) {
  return fmt::format("{} x {}", extent[0].get<int>(), extent[1].get<int>());
}

}  // namespace

std::string inspection_text(const Json& seen) {
  std::string text;
  for (const Json& looked : seen["pixels"]) {
    text += fmt::format("{}pixel {},{} of {}, frame {}\n", text.empty() ? "" : "\n", looked["pixel"][0].get<int>(),
                        looked["pixel"][1].get<int>(), extent_text(seen["extent"]), seen["frame"].get<int>());
    std::vector<std::vector<std::string>> rows{{"stage", "port", "format", "unit", "value"}};
    for (const Json& port : looked["ports"]) {
      const std::vector<std::string> head{
          fmt::format("{:>2} {}", port["place"].get<int>(),
                      port["pass"].get<std::string>() + "." + port["stage"].get<std::string>()),
          port["name"].get<std::string>(), port["format"].get<std::string>(), port.value("unit", "")};
      const auto add = [&](std::string value) {
        rows.push_back(head);
        rows.back().push_back(std::move(value));
      };
      if (port["texel"].is_null()) {
        add(fmt::format("({}: an extent of its own, no pixel of the frame's)", extent_text(port["extent"])));
        continue;
      }
      std::string place;
      if (port["extent"] != seen["extent"])
        place = fmt::format("   (texel {},{} of {})", port["texel"][0].get<int>(), port["texel"][1].get<int>(),
                            extent_text(port["extent"]));
      if (port.contains("encoding")) place += "   (as stored, sRGB-encoded)";
      if (port.contains("changes")) place += fmt::format("   (changes '{}')", port["changes"].get<std::string>());
      const Json& layers = port["layers"];
      for (std::size_t layer = 0; layer < layers.size(); ++layer)
        add(fmt::format("{}{}{}", layers.size() > 1 ? fmt::format("layer {}: ", layer) : "", values_text(layers[layer]),
                        place));
    }
    text += table_text(rows);
  }
  return text;
}

}  // namespace heddle::graph
