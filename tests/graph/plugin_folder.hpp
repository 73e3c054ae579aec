// SPDX-License-Identifier: Apache-2.0
// A temporary plugin folder of manifests without libraries: the roles of this repository with hand-made techniques that
// have the ports, stages and functions of the shipped ones, and a role or two for what those do not show.
#pragma once

#include "graph/stages.hpp"

namespace heddle::graph::test_support {

class PluginFolder {
 public:
  /// Roles of the repository and their techniques.
  PluginFolder();
  ~PluginFolder();
  PluginFolder(const PluginFolder&) = delete;
  PluginFolder& operator=(const PluginFolder&) = delete;

  /// Writes <role>/role.toml.
  void add_role(const std::string& name, const std::string& text);
  /// Writes <role>/<technique>/<technique>.manifest.json.
  void add(const Technique& technique);
  /// Writes <role>/<technique>/left_out.txt.
  void leave_out(const std::string& id, const std::string& reason);
  [[nodiscard]] Registry registry() const { return Registry({folder_}); }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_; }

 private:
  std::filesystem::path folder_;
};

/// One folder and registry for all tests that do not add to it.
const Registry& shared_registry();

/// Parses, resolves; `text` stands in a file called "test.toml".
ResolvedGraph resolve_text(std::string_view text, const Registry& registry = shared_registry());
/// The whole message of what `action` throws; "" if it throws nothing.
template <typename Action>
std::string message_of(const Action& action) {
  try {
    action();
    return {};
  } catch (const Error& error) {
    return to_text(error.diagnostics());
  }
}

/// What stands in a file as a string.
inline const std::string& text(const Written& written) {
  return std::get<std::string>(written.value);
}

/// A graph of the roles that most tests need, without sky and shadows.
inline constexpr std::string_view kSmallGraph = R"(output = "display.color"
[[pass]]
role = "gbuffer"
technique = "raster"
[[pass]]
name = "ao"
role = "ambient_occlusion"
technique = "gtao"
[[pass]]
role = "lighting"
technique = "deferred"
[[pass]]
role = "display"
technique = "linear"
)";

}  // namespace heddle::graph::test_support
