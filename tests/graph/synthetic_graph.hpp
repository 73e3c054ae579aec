// SPDX-License-Identifier: Apache-2.0
// Resolved graphs made by hand, without files or registry, for the stages after resolve.
#pragma once

#include <deque>

#include "graph/stages.hpp"

namespace heddle::graph::test_support {

/// An image, buffer or value access by port name.
Access touch(std::string port, std::uint32_t access, std::uint32_t load = HEDDLE_LOAD_KEEP);

class SyntheticGraph {
 public:
  SyntheticGraph();
  PassIndex pass(const std::string& name);
  /// An output port and its resource.
  ResourceIndex image(PassIndex pass, const std::string& port, std::uint32_t flags = 0);
  ResourceIndex buffer(PassIndex pass, const std::string& port, std::uint32_t flags = 0);
  ResourceIndex value(PassIndex pass, const std::string& port);
  /// An inout port: a new version of `source`.
  ResourceIndex change(PassIndex pass, const std::string& port, ResourceIndex source);
  /// Last frame's version of a kept output.
  ResourceIndex history(ResourceIndex newest);
  void input(PassIndex pass, const std::string& port, ResourceIndex source, bool is_optional = false);
  /// A stage; gpu stages get one shader of the kind that calls `calls`, unless they have none (`kind` empty).
  void gpu(PassIndex pass, const std::string& name, std::vector<Access> accesses,
           std::optional<ShaderKind> kind = ShaderKind::kCompute, std::vector<std::string> calls = {});
  void cpu(PassIndex pass, const std::string& name, std::vector<Access> accesses, std::uint32_t latency = 0);
  void delay(PassIndex pass, std::uint32_t stage, std::uint32_t latency) {
    technique(pass).stages[stage].latency = latency;
  }
  /// A parameter "mode" of the pass, and which stage is there only with which of its choices.
  void choose(PassIndex pass, std::vector<std::string> choices, std::size_t chosen);
  void only_if(PassIndex pass, std::uint32_t stage, const std::string& choice) {
    technique(pass).stages[stage].only_if = {"mode", choice};
  }
  /// Makes the pass a loop; its stages are given their parts by `part`.
  void loop(PassIndex pass, const std::string& input, const std::string& output, const std::string& gathered);
  void part(PassIndex pass, std::uint32_t stage, std::uint32_t loop_part) {
    technique(pass).stages[stage].loop_part = loop_part;
  }
  void provide(PassIndex pass, const std::string& role, std::vector<Access> accesses,
               std::vector<std::string> calls = {});
  void bind(PassIndex caller, const std::string& role, std::vector<PassIndex> providers);
  void need_feature(PassIndex pass, const std::string& feature);
  void output(ResourceIndex resource) { graph.output = resource; }

  /// "a.main b.main": the order as text.
  [[nodiscard]] std::string text(const Order& order) const;

  ResolvedGraph graph;

 private:
  ResourceIndex add(PassIndex pass, const std::string& port, PortType type, Direction direction, std::uint32_t flags);
  Technique& technique(PassIndex pass) { return techniques_.at(pass); }
  std::deque<Technique> techniques_;
  Role role_;
};

}  // namespace heddle::graph::test_support
