// SPDX-License-Identifier: Apache-2.0
#include "scene/components.hpp"

#include <algorithm>
#include <cstring>
#include <tuple>

namespace heddle::scene {
namespace {

auto key_of(const Component& component) {
  return std::tuple<std::string_view, Owner, std::uint32_t>(component.type->name, component.owner, component.id);
}

bool is_before(const Component& a, const Component& b) {
  return key_of(a) < key_of(b);
}

template <typename T>
void store(std::vector<std::byte>& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

void store_property(std::vector<std::byte>& bytes, std::size_t at, const ComponentProperty& property,
                    const double* values) {
  switch (property.type) {
    case PropertyType::kInt:
      store(bytes, at, static_cast<std::int32_t>(values[0]));
      break;
    case PropertyType::kBool:
    case PropertyType::kChoice:
      store(bytes, at, static_cast<std::uint32_t>(values[0]));
      break;
    case PropertyType::kFloat:
    case PropertyType::kColor:
    case PropertyType::kFloat3:
      for (std::uint32_t k = 0; k < property.count(); ++k) store(bytes, at + 4 * k, static_cast<float>(values[k]));
      break;
  }
}

}  // namespace

void Components::attach(const ComponentValues& values, Owner owner, std::uint32_t id) {
  Component made{values.type, owner, id, values.values, values.written};
  const auto place = std::lower_bound(all_.begin(), all_.end(), made, is_before);
  ++revision_;
  if (place == all_.end() || is_before(made, *place)) {
    all_.insert(place, std::move(made));
    return;
  }
  std::size_t first = 0;
  for (std::size_t i = 0; i < values.type->properties.size(); ++i) {
    const std::size_t count = values.type->properties[i].count();
    if ((values.written >> i & 1U) != 0) std::copy_n(&values.values[first], count, &place->values[first]);
    first += count;
  }
  place->written |= values.written;
}

std::span<const Component> Components::of(std::string_view name) const {
  const auto low = std::lower_bound(all_.begin(), all_.end(), name,
                                    [](const Component& c, std::string_view n) { return c.type->name < n; });
  const auto high =
      std::upper_bound(low, all_.end(), name, [](std::string_view n, const Component& c) { return n < c.type->name; });
  return {low, high};
}

std::vector<std::string> Components::names() const {
  std::vector<std::string> names;
  for (const Component& component : all_) {
    if (names.empty() || names.back() != component.type->name) names.push_back(component.type->name);
  }
  return names;
}

void Components::merge(const Components& other, const std::array<std::uint32_t, 4>& first_ids) {
  for (const Component& component : other.all_) {
    attach({component.type, component.values, component.written}, component.owner,
           component.id + first_ids.at(static_cast<std::size_t>(component.owner)));
  }
}

std::vector<std::byte> component_elements(const Components& components, const ComponentType& type, Owner owner) {
  const std::span<const Component> all = components.of(type.name);
  const ComponentLayout layout = component_layout(type);
  std::vector<double> defaults;
  for (const ComponentProperty& property : type.properties) {
    defaults.insert(defaults.end(), property.default_value.begin(), property.default_value.begin() + property.count());
  }
  std::size_t count = 0;
  for (const Component& component : all) {
    if (component.owner == owner) count = component.id + std::size_t{1};  // sorted: the last one is the largest
  }
  std::vector<std::byte> bytes(count * layout.stride);
  const auto write = [&](std::size_t id, std::uint32_t is_present, std::uint64_t written,
                         const std::vector<double>& values) {
    const std::size_t at = id * layout.stride;
    store(bytes, at, is_present);
    store(bytes, at + 4, static_cast<std::uint32_t>(written));
    std::size_t first = 0;
    for (std::size_t i = 0; i < type.properties.size(); ++i) {
      store_property(bytes, at + layout.offsets[i], type.properties[i], &values[first]);
      first += type.properties[i].count();
    }
  };
  for (std::size_t id = 0; id < count; ++id) write(id, 0, 0, defaults);
  for (const Component& component : all) {
    if (component.owner == owner) write(component.id, 1, component.written, component.values);
  }
  return bytes;
}

}  // namespace heddle::scene
