// SPDX-License-Identifier: Apache-2.0
// Hand-made passes -> ResolvedGraph (see synthetic_graph.hpp).
#include "graph/synthetic_graph.hpp"

namespace heddle::graph::test_support {

Access touch(std::string port, std::uint32_t access, std::uint32_t load) {
  return {std::move(port), access, load, {}};
}

SyntheticGraph::SyntheticGraph() {
  role_.name = "test";
  graph.file = "synthetic.toml";
  graph.width = 64;
  graph.height = 32;
}

PassIndex SyntheticGraph::pass(const std::string& name) {
  Technique& made = techniques_.emplace_back();
  made.id = "test/" + name;
  Pass added;
  added.name = name;
  added.where = {graph.file, static_cast<std::uint32_t>(graph.passes.size() + 1), 1};
  added.role = &role_;
  added.entry.technique = &made;
  graph.passes.push_back(added);
  return static_cast<PassIndex>(graph.passes.size() - 1);
}

ResourceIndex SyntheticGraph::add(PassIndex pass, const std::string& port, PortType type, Direction direction,
                                  std::uint32_t flags) {
  Port made;
  made.name = port;
  made.type = type;
  made.direction = direction;
  made.flags = flags;
  technique(pass).ports.push_back(made);
  Resource resource;
  resource.name = graph.passes[pass].name + "." + port;
  resource.type = type;
  resource.producer = pass;
  resource.port = port;
  resource.is_kept = made.is_kept();
  resource.flags = flags;
  resource.format = type == PortType::kImage ? VK_FORMAT_R16G16B16A16_SFLOAT : 0;
  resource.width = type == PortType::kImage ? graph.width : 0;
  resource.height = type == PortType::kImage ? graph.height : 0;
  resource.byte_size = type == PortType::kImage ? 0 : 1024;
  graph.resources.push_back(resource);
  const auto index = static_cast<ResourceIndex>(graph.resources.size() - 1);
  graph.passes[pass].ports[port] = index;
  return index;
}

ResourceIndex SyntheticGraph::image(PassIndex pass, const std::string& port, std::uint32_t flags) {
  return add(pass, port, PortType::kImage, Direction::kOut, flags);
}
ResourceIndex SyntheticGraph::buffer(PassIndex pass, const std::string& port, std::uint32_t flags) {
  return add(pass, port, PortType::kBuffer, Direction::kOut, flags);
}
ResourceIndex SyntheticGraph::value(PassIndex pass, const std::string& port) {
  return add(pass, port, PortType::kValue, Direction::kOut, 0);
}

ResourceIndex SyntheticGraph::change(PassIndex pass, const std::string& port, ResourceIndex source) {
  const ResourceIndex made = add(pass, port, graph.resources[source].type, Direction::kInout, 0);
  graph.resources[made].previous_version = source;
  graph.passes[pass].inout_sources[port] = source;
  return made;
}

ResourceIndex SyntheticGraph::history(ResourceIndex newest) {
  Resource made = graph.resources[newest];
  made.name += "@previous";
  made.producer = kNoIndex;
  made.previous_version = kNoIndex;
  made.history_of = newest;
  graph.resources.push_back(made);
  return static_cast<ResourceIndex>(graph.resources.size() - 1);
}

void SyntheticGraph::input(PassIndex pass, const std::string& port, ResourceIndex source, bool is_optional) {
  Port made;
  made.name = port;
  made.type = graph.resources[source].type;
  made.flags = is_optional ? HEDDLE_PORT_OPTIONAL : 0;
  technique(pass).ports.push_back(made);
  graph.passes[pass].ports[port] = source;
}

void SyntheticGraph::gpu(PassIndex pass, const std::string& name, std::vector<Access> accesses,
                         std::optional<ShaderKind> kind, std::vector<std::string> calls) {
  technique(pass).stages.push_back({name, StageKind::kGpu, std::move(accesses), 0});
  if (!kind) return;
  Shader shader;
  shader.name = name;
  shader.kind = *kind;
  shader.stage = name;
  shader.calls = std::move(calls);
  technique(pass).shaders.push_back(shader);
}

void SyntheticGraph::cpu(PassIndex pass, const std::string& name, std::vector<Access> accesses, std::uint32_t latency) {
  technique(pass).stages.push_back({name, StageKind::kCpu, std::move(accesses), latency});
}

void SyntheticGraph::choose(PassIndex pass, std::vector<std::string> choices, std::size_t chosen) {
  Parameter mode;
  mode.name = "mode";
  mode.type = ParameterType::kChoice;
  mode.flags = HEDDLE_PARAMETER_REDECLARE;
  mode.choices = std::move(choices);
  technique(pass).parameters = {mode};
  graph.passes[pass].parameters.assign(1, {});
  graph.passes[pass].parameters[0].number[0] = static_cast<double>(chosen);
}

void SyntheticGraph::loop(PassIndex pass, const std::string& input, const std::string& output,
                          const std::string& gathered) {
  technique(pass).loop = Loop{{{input, output}}, {gathered}};
}

void SyntheticGraph::provide(PassIndex pass, const std::string& role, std::vector<Access> accesses,
                             std::vector<std::string> calls) {
  technique(pass).functions.push_back({role, role + ".glsl", std::move(accesses), std::move(calls), false});
}

void SyntheticGraph::bind(PassIndex caller, const std::string& role, std::vector<PassIndex> providers) {
  graph.passes[caller].functions.push_back({role, Join::kProduct, std::move(providers)});
}

void SyntheticGraph::need_feature(PassIndex pass, const std::string& feature) {
  technique(pass).features.push_back(feature);
}

std::string SyntheticGraph::text(const Order& order) const {
  std::string text;
  for (const ScheduledStage& stage : order.stages)
    text += (text.empty() ? "" : " ") + graph.passes[stage.pass].name + "." +
            graph.passes[stage.pass].entry.technique->stages[stage.stage].name;
  return text;
}

}  // namespace heddle::graph::test_support
