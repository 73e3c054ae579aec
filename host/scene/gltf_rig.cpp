// SPDX-License-Identifier: Apache-2.0
// glTF nodes, skins, animations -> a rig.
#include "scene/gltf_rig.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace heddle::scene::gltf {
namespace {

/// True if the property is there; fails if it has another length or a number that is not finite.
bool is_given(const Document& document, std::size_t index, const std::vector<double>& values, std::size_t size,
              const char* name) {
  const tinygltf::Node& node = document.model.nodes[index];
  if (!values.empty() && values.size() != size) {
    document.fail(fmt::format("node {} '{}': its {} has the wrong length", index, node.name, name),
                  fmt::format("{}", values.size()), fmt::format("{}", size));
  }
  if (!std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); })) {
    document.fail(fmt::format("node {} '{}': its {} is not finite", index, node.name, name));
  }
  return !values.empty();
}

RigNode import_node(const Document& document, std::size_t index) {
  const tinygltf::Node& source = document.model.nodes[index];
  RigNode node;
  node.name = source.name;
  node.has_matrix = is_given(document, index, source.matrix, 16, "matrix");
  if (node.has_matrix) {
    glm::dmat4& matrix = node.matrix;
    for (int i = 0; i < 16; ++i) {
      matrix[i / 4][i % 4] = source.matrix[static_cast<std::size_t>(i)];
    }
    if (matrix[0][3] != 0 || matrix[1][3] != 0 || matrix[2][3] != 0 || matrix[3][3] != 1) {
      document.fail(fmt::format("node {} '{}': its matrix is not affine", index, node.name),
                    fmt::format("last row {}, {}, {}, {}", matrix[0][3], matrix[1][3], matrix[2][3], matrix[3][3]),
                    "0, 0, 0, 1");
    }
  }
  if (is_given(document, index, source.rotation, 4, "rotation")) {
    node.rotation = {source.rotation[3], source.rotation[0], source.rotation[1], source.rotation[2]};
  }
  if (is_given(document, index, source.scale, 3, "scale")) {
    node.scale = {source.scale[0], source.scale[1], source.scale[2]};
  }
  if (is_given(document, index, source.translation, 3, "translation")) {
    node.translation = {source.translation[0], source.translation[1], source.translation[2]};
  }
  // Weights of the node count, else the mesh's.
  node.weights = source.weights;
  if (node.weights.empty() && source.mesh >= 0 &&
      static_cast<std::size_t>(source.mesh) < document.model.meshes.size()) {
    node.weights = document.model.meshes[static_cast<std::size_t>(source.mesh)].weights;
  }
  is_given(document, index, node.weights, node.weights.size(), "morph weights");
  return node;
}

void connect(const Document& document, Rig& rig) {
  const std::vector<tinygltf::Node>& nodes = document.model.nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (const int child : nodes[i].children) {
      if (child < 0 || static_cast<std::size_t>(child) >= nodes.size()) {
        document.fail(fmt::format("node {} '{}' has the child {}, which does not exist", i, nodes[i].name, child),
                      fmt::format("{} nodes", nodes.size()));
      }
      std::uint32_t& parent = rig.nodes[static_cast<std::size_t>(child)].parent;
      if (std::exchange(parent, static_cast<std::uint32_t>(i)) != HEDDLE_NONE) {
        document.fail(fmt::format("node {} '{}' has two parents", child, nodes[static_cast<std::size_t>(child)].name));
      }
    }
  }
  std::vector<std::uint32_t> pending;
  for (std::size_t i = nodes.size(); i-- > 0;) {
    if (rig.nodes[i].parent == HEDDLE_NONE) {
      pending.push_back(static_cast<std::uint32_t>(i));
    }
  }
  while (!pending.empty()) {
    const std::uint32_t node = pending.back();
    pending.pop_back();
    rig.order.push_back(node);
    for (const int child : nodes[node].children) {
      pending.push_back(static_cast<std::uint32_t>(child));
    }
  }
  // With one parent each, what no root reaches runs in a circle.
  if (rig.order.size() != nodes.size()) {
    document.fail("the nodes contain a cycle",
                  fmt::format("{} of {} nodes have a root", rig.order.size(), nodes.size()), "a tree");
  }
}

/// How many numbers a key of the channel has; 0: the channel moves nothing that is known here.
std::uint32_t width_of(Document& document, const tinygltf::AnimationChannel& channel, Channel::Path& path,
                       const std::string& what) {
  const tinygltf::Model& model = document.model;
  if (channel.target_node < 0) {
    document.warn(fmt::format("{}: a channel has no node to move and is left out", what));
    return 0;
  }
  if (static_cast<std::size_t>(channel.target_node) >= model.nodes.size()) {
    document.fail(fmt::format("{}: a channel moves node {}, which does not exist", what, channel.target_node),
                  fmt::format("{} nodes", model.nodes.size()));
  }
  const tinygltf::Node& node = model.nodes[static_cast<std::size_t>(channel.target_node)];
  if (channel.target_path == "weights") {
    path = Channel::Path::kWeights;
    std::size_t targets = 0;
    if (node.mesh >= 0 && static_cast<std::size_t>(node.mesh) < model.meshes.size()) {
      for (const tinygltf::Primitive& primitive : model.meshes[static_cast<std::size_t>(node.mesh)].primitives) {
        targets = std::max(targets, primitive.targets.size());
      }
    }
    if (targets == 0) {
      document.warn(fmt::format("{}: a channel weighs morph targets of node {} '{}', which has none", what,
                                channel.target_node, node.name));
    }
    return static_cast<std::uint32_t>(targets);
  }
  if (!node.matrix.empty()) {
    document.warn(
        fmt::format("{}: node {} '{}' has a matrix, which channels cannot move", what, channel.target_node, node.name));
    return 0;
  }
  if (channel.target_path == "translation" || channel.target_path == "scale") {
    path = channel.target_path == "scale" ? Channel::Path::kScale : Channel::Path::kTranslation;
    return 3;
  }
  if (channel.target_path == "rotation") {
    path = Channel::Path::kRotation;
    return 4;
  }
  document.warn(fmt::format("{}: a channel moves '{}', which is not known here", what, channel.target_path));
  return 0;
}

Channel import_channel(const Document& document, const tinygltf::Animation& animation,
                       const tinygltf::AnimationChannel& source, Channel::Path path, std::uint32_t width,
                       const std::string& what) {
  if (source.sampler < 0 || static_cast<std::size_t>(source.sampler) >= animation.samplers.size()) {
    document.fail(fmt::format("{}: a channel uses sampler {}, which does not exist", what, source.sampler),
                  fmt::format("{} samplers", animation.samplers.size()));
  }
  const tinygltf::AnimationSampler& sampler = animation.samplers[static_cast<std::size_t>(source.sampler)];
  Channel channel;
  channel.node = static_cast<std::uint32_t>(source.target_node);
  channel.path = path;
  channel.width = width;
  if (sampler.interpolation == "STEP") {
    channel.interpolation = Channel::Interpolation::kStep;
  } else if (sampler.interpolation == "CUBICSPLINE") {
    channel.interpolation = Channel::Interpolation::kCubicSpline;
  } else if (sampler.interpolation != "LINEAR" && !sampler.interpolation.empty()) {
    document.fail(fmt::format("{}: sampler {} has an unknown interpolation", what, source.sampler),
                  sampler.interpolation, "LINEAR, STEP or CUBICSPLINE");
  }
  const std::string times = fmt::format("times of sampler {} of {}", source.sampler, what);
  const std::string values = fmt::format("values of sampler {} of {}", source.sampler, what);
  for (const float time : read_floats(document, sampler.input, 1, times)) {
    if (!channel.times.empty() && time < channel.times.back()) {
      document.fail(fmt::format("{}: key {} is earlier than the one before", times, channel.times.size()),
                    fmt::format("{} after {}", time, channel.times.back()));
    }
    channel.times.push_back(time);
  }
  // Weights are single numbers, as many a key as there are targets.
  const std::uint32_t components = path == Channel::Path::kWeights ? 1 : width;
  for (const float value : read_floats(document, sampler.output, components, values)) {
    channel.values.push_back(value);
  }
  const std::size_t parts = channel.interpolation == Channel::Interpolation::kCubicSpline ? 3 : 1;
  const std::size_t expected = channel.times.size() * parts * width;
  if (channel.times.empty()) {
    document.fail(fmt::format("{}: there are no keys", times));
  }
  if (channel.values.size() != expected) {
    document.fail(fmt::format("{}: there are not as many as its {} keys need", values, channel.times.size()),
                  fmt::format("{}", channel.values.size()), fmt::format("{}", expected));
  }
  return channel;
}

}  // namespace

Rig import_rig(Document& document) {
  Rig rig;
  rig.file = document.file;
  const tinygltf::Model& model = document.model;
  rig.nodes.reserve(model.nodes.size());
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    rig.nodes.push_back(import_node(document, i));
  }
  connect(document, rig);
  for (std::size_t i = 0; i < model.animations.size(); ++i) {
    const tinygltf::Animation& source = model.animations[i];
    const std::string what = fmt::format("animation {} '{}'", i, source.name);
    Animation animation;
    animation.name = source.name.empty() ? fmt::format("animation {}", i) : source.name;
    for (const tinygltf::AnimationChannel& channel : source.channels) {
      Channel::Path path = Channel::Path::kTranslation;
      if (const std::uint32_t width = width_of(document, channel, path, what); width > 0) {
        animation.channels.push_back(import_channel(document, source, channel, path, width, what));
        animation.duration = std::max(animation.duration, animation.channels.back().times.back());
      }
    }
    rig.animations.push_back(std::move(animation));
  }
  return rig;
}

std::uint32_t import_skin(const Document& document, int index, Rig& rig, std::vector<std::uint32_t>& skin_ids) {
  const tinygltf::Model& model = document.model;
  if (index < 0 || static_cast<std::size_t>(index) >= model.skins.size()) {
    document.fail(fmt::format("there is no skin {}", index), fmt::format("{} skins", model.skins.size()));
  }
  skin_ids.resize(model.skins.size(), HEDDLE_NONE);
  std::uint32_t& id = skin_ids[static_cast<std::size_t>(index)];
  if (id != HEDDLE_NONE) {
    return id;
  }
  const tinygltf::Skin& source = model.skins[static_cast<std::size_t>(index)];
  if (source.joints.empty()) {
    document.fail(fmt::format("skin {} '{}' has no joints", index, source.name));
  }
  Skin skin;
  for (std::size_t i = 0; i < source.joints.size(); ++i) {
    const int node = source.joints[i];
    if (node < 0 || static_cast<std::size_t>(node) >= model.nodes.size()) {
      document.fail(fmt::format("joint {} of skin {} is node {}, which does not exist", i, index, node),
                    fmt::format("{} nodes", model.nodes.size()));
    }
    skin.joints.push_back(static_cast<std::uint32_t>(node));
  }
  skin.joint_from_binding.assign(skin.joints.size(), glm::dmat4(1.0));
  if (source.inverseBindMatrices >= 0) {
    const std::string what = fmt::format("inverse bind matrices of skin {} '{}'", index, source.name);
    const std::vector<float> values = read_floats(document, source.inverseBindMatrices, 16, what);
    if (values.size() < skin.joints.size() * 16) {
      document.fail(fmt::format("{}: there are fewer than joints", what), fmt::format("{}", values.size() / 16),
                    fmt::format("{}", skin.joints.size()));
    }
    for (std::size_t i = 0; i < skin.joints.size() * 16; ++i) {
      const auto element = static_cast<int>(i % 16);
      skin.joint_from_binding[i / 16][element / 4][element % 4] = values[i];
    }
  }
  id = static_cast<std::uint32_t>(rig.skins.size());
  rig.skins.push_back(std::move(skin));
  return id;
}

}  // namespace heddle::scene::gltf
