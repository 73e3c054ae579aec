// SPDX-License-Identifier: Apache-2.0
// What a job makes, by everything that it depends on, before anything is opened or run.
#pragma once

#include "graph/stages.hpp"
#include "scene/scene.hpp"

namespace heddle::graph {

/// What goes into the keys besides the graph.
struct KeyContext {
  const Registry& registry;
  const scene::Scene& scene;
  glm::dvec3 origin{0.0};  // of the frame
  double time = 0;
  std::uint64_t seed = 0;
  std::function<std::string()> device;                   // who runs gpu stages; asked only where there are some
  std::function<std::string(const Resource&)> artifact;  // key of what another job makes
};

/// One for each pass of a job: passes with the same key make the same. Reads files: libraries, shaders, and what
/// parameters name. Throws Error where passes need each other in a circle.
std::vector<std::string> artifact_keys(const ResolvedGraph& graph, const KeyContext& context);

/// One for each pass, of who does the work alone: technique, library, shaders, and the device where it has gpu stages.
std::vector<std::string> code_keys(const ResolvedGraph& graph, const KeyContext& context);

/// True where a pass sees where the frame's origin is.
bool sees_origin(const ResolvedGraph& graph, const Pass& pass);

}  // namespace heddle::graph
