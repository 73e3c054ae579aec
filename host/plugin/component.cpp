// SPDX-License-Identifier: Apache-2.0
// Declared components -> layouts, GLSL, and checked values.
#include "plugin/component.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "plugin/rules.hpp"

namespace heddle {
namespace {

constexpr std::array<const char*, 6> kGlslTypes{"float", "int", "uint", "uint", "vec3", "vec3"};

const char* glsl_type(const ComponentProperty& property) {
  return kGlslTypes.at(static_cast<std::size_t>(property.type));
}

std::string underscored(std::string_view name) {
  std::string text(name);
  std::replace(text.begin(), text.end(), '.', '_');
  return text;
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& names) {
  const std::string nearest = nearest_name(name, names);
  return nearest.empty() ? std::string() : fmt::format("did you mean '{}'?", nearest);
}

std::string quoted_owners(std::span<const Owner> owners) {
  std::string text;
  for (const Owner owner : owners) text += fmt::format("{}{}", text.empty() ? "" : " or ", to_word(owner));
  return text;
}

/// "a number, m, 0 to 100".
std::string expected_of(const ComponentProperty& property) {
  switch (property.type) {
    case PropertyType::kBool:
      return "true or false";
    case PropertyType::kChoice:
      return "one of " + join_names(property.choices);
    default:
      break;
  }
  std::string text = property.type == PropertyType::kInt ? "an integer"
                     : property.count() == 3             ? "three numbers"
                                                         : "a number";
  if (!property.unit.empty() && property.unit != "1") text += ", " + property.unit;
  if (property.range) text += fmt::format(", {} to {}", (*property.range)[0], (*property.range)[1]);
  return text;
}

/// Numbers of a value, or nothing if it is of another type.
std::optional<std::array<double, 3>> numbers_of(const ComponentProperty& property, const Json& value) {
  std::array<double, 3> numbers{};
  switch (property.type) {
    case PropertyType::kBool:
      if (!value.is_boolean()) return std::nullopt;
      numbers[0] = value.get<bool>() ? 1.0 : 0.0;
      return numbers;
    case PropertyType::kChoice: {
      if (!value.is_string()) return std::nullopt;
      const auto found = std::find(property.choices.begin(), property.choices.end(), value.get<std::string>());
      if (found == property.choices.end()) return std::nullopt;
      numbers[0] = static_cast<double>(found - property.choices.begin());
      return numbers;
    }
    case PropertyType::kColor:
    case PropertyType::kFloat3:
      if (!value.is_array() || value.size() != 3) return std::nullopt;
      for (std::size_t i = 0; i < 3; ++i) {
        if (!value[i].is_number()) return std::nullopt;
        numbers[i] = value[i].get<double>();
      }
      return numbers;
    case PropertyType::kInt:
    case PropertyType::kFloat:
      break;
  }
  if (!value.is_number()) return std::nullopt;
  numbers[0] = value.get<double>();
  // glTF's JSON does not tell 2 from 2.0.
  if (property.type == PropertyType::kInt && numbers[0] != std::floor(numbers[0])) return std::nullopt;
  return numbers;
}

bool is_in_range(const ComponentProperty& property, double number) {
  // Shaders see float32 and int32.
  const double limit = property.type == PropertyType::kInt
                           ? static_cast<double>(std::numeric_limits<std::int32_t>::max())
                           : static_cast<double>(std::numeric_limits<float>::max());
  if (!(std::abs(number) <= limit)) return false;
  return !property.range || (number >= (*property.range)[0] && number <= (*property.range)[1]);
}

}  // namespace

std::string_view to_word(Owner owner) {
  return kOwnerWords.at(static_cast<std::size_t>(owner));
}

std::optional<std::size_t> ComponentType::find(std::string_view property) const {
  for (std::size_t i = 0; i < properties.size(); ++i) {
    if (properties[i].name == property) return i;
  }
  return std::nullopt;
}

bool ComponentType::sits_on(Owner owner) const {
  return std::find(on.begin(), on.end(), owner) != on.end();
}

std::uint32_t ComponentType::value_count() const {
  std::uint32_t count = 0;
  for (const ComponentProperty& property : properties) count += property.count();
  return count;
}

bool is_component_name(std::string_view name) {
  const std::size_t dot = name.find('.');
  return dot != std::string_view::npos && is_identifier(name.substr(0, dot)) && is_identifier(name.substr(dot + 1));
}

std::string component_port(const ComponentType& type, Owner owner) {
  return fmt::format("{}_{}", underscored(type.name), to_word(owner));
}

ComponentLayout component_layout(const ComponentType& type) {
  ComponentLayout layout;
  std::uint32_t at = 8;  // is_present, written
  std::uint32_t alignment = 4;
  for (const ComponentProperty& property : type.properties) {
    const std::uint32_t own = property.count() == 3 ? 16 : 4;
    at = (at + own - 1) / own * own;
    layout.offsets.push_back(at);
    at += 4 * property.count();
    alignment = std::max(alignment, own);
  }
  layout.stride = (at + alignment - 1) / alignment * alignment;
  return layout;
}

std::string component_struct(const ComponentType& type) {
  std::string text = "Heddle";
  bool is_first = true;
  for (const char c : type.name) {
    if (c == '.' || c == '_') {
      is_first = true;
      continue;
    }
    text += is_first ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    is_first = false;
  }
  return text;
}

std::string component_glsl(const ComponentType& type) {
  const std::string name = component_struct(type);
  std::string members, bits, absent;
  for (std::size_t i = 0; i < type.properties.size(); ++i) {
    const ComponentProperty& property = type.properties[i];
    members += fmt::format(" {} {};", glsl_type(property), property.name);
    bits += fmt::format("const uint {}_{} = {}u;\n", name, property.name, 1U << i);
    std::string number;
    for (std::uint32_t k = 0; k < property.count(); ++k) {
      const double value = property.default_value[k];
      number += k == 0 ? "" : ", ";
      number += property.type == PropertyType::kFloat || property.count() == 3
                    ? fmt::format("float({})", static_cast<float>(value))
                : property.type == PropertyType::kInt ? fmt::format("{}", static_cast<std::int32_t>(value))
                                                      : fmt::format("{}u", static_cast<std::uint32_t>(value));
    }
    absent += property.count() == 3 ? fmt::format(", vec3({})", number) : ", " + number;
  }
  return fmt::format(
      "#ifndef {0}_DECLARED\n#define {0}_DECLARED\nstruct {0} {{ uint is_present; uint written;{1} }};\n"
      "{2}{0} {0}_absent() {{ return {0}(0u, 0u{3}); }}\n#endif\n",
      name, members, bits, absent);
}

const ComponentType* ComponentCatalog::find(std::string_view name) const {
  const auto found = std::find_if(types_.begin(), types_.end(), [&](const auto* type) { return type->name == name; });
  return found == types_.end() ? nullptr : *found;
}

std::vector<std::string> ComponentCatalog::names() const {
  std::vector<std::string> names;
  for (const ComponentType* type : types_) names.push_back(type->name);
  return names;
}

std::optional<ComponentCatalog::PortOf> ComponentCatalog::find_port(std::string_view port) const {
  for (const ComponentType* type : types_) {
    for (const Owner owner : type->on) {
      if (component_port(*type, owner) == port) return PortOf{type, owner};
    }
  }
  return std::nullopt;
}

std::optional<ComponentValues> read_component(const ComponentCatalog* catalog, const GivenComponent& given,
                                              std::span<const Owner> owners, std::vector<Diagnostic>& problems) {
  const std::size_t before = problems.size();
  const auto complain = [&](const Location& where, std::string message, std::string found, std::string expected,
                            std::string help) {
    problems.push_back(
        {Severity::kError, where, std::move(message), std::move(found), std::move(expected), std::move(help)});
  };
  const ComponentType* type = catalog == nullptr ? nullptr : catalog->find(given.name);
  if (type == nullptr) {
    const std::vector<std::string> names = catalog == nullptr ? std::vector<std::string>{} : catalog->names();
    complain(given.where, fmt::format("{}: no role reads a component '{}'", given.place, given.name), {},
             names.empty() ? "no components: no role that is installed declares one" : "one of " + join_names(names),
             did_you_mean(given.name, names));
    return std::nullopt;
  }
  if (std::none_of(owners.begin(), owners.end(), [&](Owner owner) { return type->sits_on(owner); })) {
    complain(given.where, fmt::format("{}: the component '{}' cannot sit here", given.place, given.name),
             owners.empty() ? "what has neither a mesh nor a light" : quoted_owners(owners), quoted_owners(type->on),
             {});
  }
  ComponentValues out;
  out.type = type;
  std::vector<std::size_t> first;
  for (const ComponentProperty& property : type->properties) {
    first.push_back(out.values.size());
    for (std::uint32_t k = 0; k < property.count(); ++k) out.values.push_back(property.default_value[k]);
  }
  for (const GivenComponent::Property& one : given.properties) {
    const auto index = type->find(one.name);
    if (!index) {
      std::vector<std::string> names;
      for (const ComponentProperty& property : type->properties) names.push_back(property.name);
      complain(one.where, fmt::format("{}: the component '{}' has no property '{}'", one.place, type->name, one.name),
               {}, "one of " + join_names(names), did_you_mean(one.name, names));
      continue;
    }
    const ComponentProperty& property = type->properties[*index];
    constexpr std::size_t kLongestQuote = 60;
    const std::string found = write_json(one.value).substr(0, kLongestQuote);
    const auto numbers = numbers_of(property, one.value);
    if (!numbers) {
      const bool is_word = property.type == PropertyType::kChoice && one.value.is_string();
      complain(one.where, fmt::format("{}: '{}' has the wrong {}", one.place, one.name, is_word ? "word" : "type"),
               found, expected_of(property),
               is_word ? did_you_mean(one.value.get<std::string>(), property.choices) : std::string());
      continue;
    }
    bool is_good = true;
    for (std::uint32_t k = 0; k < property.count(); ++k) is_good &= is_in_range(property, (*numbers)[k]);
    if (!is_good) {
      complain(one.where, fmt::format("{}: '{}' is out of range", one.place, one.name), found, expected_of(property),
               {});
      continue;
    }
    std::copy_n(numbers->begin(), property.count(), out.values.begin() + static_cast<std::ptrdiff_t>(first[*index]));
    out.written |= std::uint64_t{1} << *index;
  }
  if (problems.size() != before) return std::nullopt;
  return out;
}

}  // namespace heddle
