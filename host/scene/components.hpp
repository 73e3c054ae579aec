// SPDX-License-Identifier: Apache-2.0
// The components of a scene's things: where they are attached, and the tables that techniques and shaders read.
#pragma once

#include "plugin/component.hpp"

namespace heddle::scene {

/// A component on one thing.
struct Component {
  const ComponentType* type = nullptr;
  Owner owner = Owner::kScene;
  std::uint32_t id = 0;  // of the owner, in its kind
  std::vector<double> values;
  std::uint64_t written = 0;
};

/// All of a scene, sorted by name, kind of owner, and id.
class Components {
 public:
  /// What scenes may hold; null: nothing. Outlives this object.
  const ComponentCatalog* catalog = nullptr;

  /// Puts a component on a thing; on one that has it already, what was written replaces what was there.
  void attach(const ComponentValues& values, Owner owner, std::uint32_t id);
  [[nodiscard]] const std::vector<Component>& all() const { return all_; }
  [[nodiscard]] std::span<const Component> of(std::string_view name) const;
  /// Names of those that some thing has, sorted.
  [[nodiscard]] std::vector<std::string> names() const;
  /// Takes over what another scene has, ids moved up by how many things this one has of each kind.
  void merge(const Components& other, const std::array<std::uint32_t, 4>& first_ids);
  [[nodiscard]] std::uint64_t revision() const { return revision_; }

 private:
  std::vector<Component> all_;
  std::uint64_t revision_ = 1;
};

/// The std430 elements that shaders see: one for each owner up to the last that has the component.
std::vector<std::byte> component_elements(const Components& components, const ComponentType& type, Owner owner);

}  // namespace heddle::scene
