// SPDX-License-Identifier: Apache-2.0
// What graphs may read of a scene beside its components: the one list, which names, still frames and the keys of jobs
// all go by. Whoever adds to it is shown by the compiler what is missing: every switch over it names all of them.
#pragma once

#include "graph/stages.hpp"

#include <array>
#include <optional>

namespace heddle::graph {

enum class ScenePart : std::uint8_t { kCamera, kEnvironment, kLightTextures, kLights, kSurfaces };

struct ScenePort {
  ScenePart part;
  std::string_view name;  // "scene.NAME"
  PortType type;
  bool is_in_jobs;
};

inline constexpr std::array<ScenePort, 5> kScenePorts{{
    {ScenePart::kCamera, "camera", PortType::kValue, false},
    {ScenePart::kEnvironment, "environment", PortType::kValue, true},
    {ScenePart::kLightTextures, "light_textures", PortType::kValue, true},
    {ScenePart::kLights, "lights", PortType::kValue, true},
    {ScenePart::kSurfaces, "surfaces", PortType::kSurfaces, true},
}};

/// Nothing for the names of components.
inline std::optional<ScenePart> find_scene_part(std::string_view name) {
  for (const ScenePort& port : kScenePorts)
    if (port.name == name) return port.part;
  return std::nullopt;
}

}  // namespace heddle::graph
