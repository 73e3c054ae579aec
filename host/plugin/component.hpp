// SPDX-License-Identifier: Apache-2.0
// Components: typed extras of a scene's things that some techniques interpret. A role declares them in role.toml; here
// are the declarations, how their values lie in memory, and the check of what a scene gives.
#pragma once

#include "diagnostics.hpp"
#include "json.hpp"

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace heddle {

/// What a component sits on; = HEDDLE_OWNER_*.
enum class Owner : std::uint32_t { kScene, kInstance, kMaterial, kLight };
inline constexpr std::array<std::string_view, 4> kOwnerWords{"scene", "instance", "material", "light"};
std::string_view to_word(Owner owner);

enum class PropertyType : std::uint32_t { kFloat, kInt, kBool, kChoice, kColor, kFloat3 };
inline constexpr std::array<std::string_view, 6> kPropertyWords{"float", "int", "bool", "choice", "color", "float3"};

struct ComponentProperty {
  std::string name;
  PropertyType type = PropertyType::kFloat;
  std::string unit;
  std::optional<std::array<double, 2>> range;  // of each number
  std::array<double, 3> default_value{0, 0, 0};
  bool has_default = false;  // false: what holds without it is the technique's business
  std::vector<std::string> choices;
  std::string help;
  [[nodiscard]] std::uint32_t count() const {
    return type == PropertyType::kColor || type == PropertyType::kFloat3 ? 3U : 1U;
  }
  bool operator==(const ComponentProperty&) const = default;
};

/// Most properties of one component: which were written is a mask of 32 bits in shaders.
inline constexpr std::size_t kMostProperties = 32;

struct ComponentType {
  std::string name;  // "shadow.settings": two identifiers and a dot
  std::vector<Owner> on;
  std::string title;
  std::vector<ComponentProperty> properties;
  [[nodiscard]] std::optional<std::size_t> find(std::string_view property) const;
  [[nodiscard]] bool sits_on(Owner owner) const;
  /// Numbers of one instance on the CPU, property after property.
  [[nodiscard]] std::uint32_t value_count() const;
  bool operator==(const ComponentType&) const = default;
};

/// Two identifiers and a dot.
bool is_component_name(std::string_view name);

/// "shadow_settings_light": the value port through which shaders see a component of one kind of owner.
std::string component_port(const ComponentType& type, Owner owner);

/// The std430 element of that port: uint is_present, uint written, then the properties.
struct ComponentLayout {
  std::vector<std::uint32_t> offsets;  // of each property, bytes
  std::uint32_t stride = 0;            // bytes
};
ComponentLayout component_layout(const ComponentType& type);
/// "HeddleShadowSettings": the element's type in GLSL.
std::string component_struct(const ComponentType& type);
/// Its declaration, a bit of `written` for each property, and the element that absent owners have.
std::string component_glsl(const ComponentType& type);

/// Every component that a registry's roles declare.
class ComponentCatalog {
 public:
  void add(const ComponentType& type) { types_.push_back(&type); }
  [[nodiscard]] const ComponentType* find(std::string_view name) const;
  [[nodiscard]] std::vector<std::string> names() const;
  struct PortOf {
    const ComponentType* type = nullptr;
    Owner owner = Owner::kScene;
  };
  [[nodiscard]] std::optional<PortOf> find_port(std::string_view port) const;

 private:
  std::vector<const ComponentType*> types_;  // of roles, which outlive the catalog
};

/// A component as a scene gives it: where each word stands is the giver's business.
struct GivenComponent {
  std::string name;
  Location where;
  std::string place;  // begins every message: "/nodes/3/extras/heddle/shadow.settings", "light 'lamp'"
  struct Property {
    std::string name;
    Json value;
    Location where;
    std::string place;
  };
  std::vector<Property> properties;
};

struct ComponentValues {
  const ComponentType* type = nullptr;
  std::vector<double> values;  // value_count(); defaults where nothing was given
  std::uint64_t written = 0;   // bit i: property i was given
};

/// Checks a component that is to sit on `owners` (any one of them will do). Every mistake goes to `problems`; nothing
/// is returned if there was one.
std::optional<ComponentValues> read_component(const ComponentCatalog* catalog, const GivenComponent& given,
                                              std::span<const Owner> owners, std::vector<Diagnostic>& problems);

}  // namespace heddle
