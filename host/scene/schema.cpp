// SPDX-License-Identifier: Apache-2.0
// What overlay.cpp reads, as JSON Schema. What needs the scene (which names there are) a schema cannot say.
#include "scene/schema.hpp"

#include <numbers>

namespace heddle::scene {
namespace {

Json number(std::string_view help, Json range = Json::object()) {
  Json json{{"type", "number"}, {"description", help}};
  json.update(range);
  return json;
}

Json numbers(std::size_t count, std::string_view help, Json range = Json::object()) {
  Json item{{"type", "number"}};
  item.update(range);
  return {
      {"type", "array"}, {"description", help}, {"items", std::move(item)}, {"minItems", count}, {"maxItems", count}};
}

Json boolean(std::string_view help) {
  return {{"type", "boolean"}, {"description", help}};
}

Json word(std::string_view help, Json words) {
  return {{"type", "string"}, {"description", help}, {"enum", std::move(words)}};
}

Json text(std::string_view help) {
  return {{"type", "string"}, {"description", help}};
}

Json name(std::string_view help) {
  return {{"type", "string"}, {"description", help}, {"minLength", 1}};
}

const Json kUnitRange{{"minimum", 0}, {"maximum", 1}}, kNotNegativeRange{{"minimum", 0}},
    kPositiveRange{{"exclusiveMinimum", 0}}, kAngle{{"minimum", 0}, {"maximum", std::numbers::pi}};

Json property(const ComponentProperty& declared) {
  std::string help = declared.help;
  if (!declared.unit.empty() && declared.unit != "1") help += " [" + declared.unit + "]";
  Json range = Json::object();
  if (declared.range) range = {{"minimum", (*declared.range)[0]}, {"maximum", (*declared.range)[1]}};
  switch (declared.type) {
    case PropertyType::kBool:
      return boolean(help);
    case PropertyType::kChoice:
      return word(help, declared.choices);
    case PropertyType::kColor:
    case PropertyType::kFloat3:
      return numbers(3, help, std::move(range));
    case PropertyType::kInt: {
      Json json = number(help, std::move(range));
      json["type"] = "integer";
      return json;
    }
    case PropertyType::kFloat:
      break;
  }
  return number(help, std::move(range));
}

/// components.shadow.settings, or components."shadow.settings": those that may sit on this kind of thing.
Json components(const ComponentCatalog& catalog, Owner owner) {
  Json json{{"type", "object"},
            {"description", "extras that some techniques read, as roles declare them"},
            {"properties", Json::object()},
            {"additionalProperties", false}};
  for (const std::string& name : catalog.names()) {
    const ComponentType& type = *catalog.find(name);
    if (!type.sits_on(owner)) continue;
    Json one{{"type", "object"},
             {"description", type.title},
             {"properties", Json::object()},
             {"additionalProperties", false}};
    for (const ComponentProperty& declared : type.properties) one["properties"][declared.name] = property(declared);
    const std::size_t dot = name.find('.');
    Json& of_role = json["properties"][name.substr(0, dot)];
    if (of_role.is_null()) {
      of_role = {{"type", "object"}, {"properties", Json::object()}, {"additionalProperties", false}};
    }
    of_role["properties"][name.substr(dot + 1)] = one;
    json["properties"][name] = std::move(one);
  }
  return json;
}

Json instance() {
  return {{"name", name("of an instance that the scene has")}};
}

Json table(std::string_view help, Json properties) {
  return {{"type", "array"},
          {"description", help},
          {"items",
           {{"type", "object"},
            {"properties", std::move(properties)},
            {"required", {"name"}},
            {"additionalProperties", false}}}};
}

Json camera() {
  return {{"name", name("a new name adds a camera, a bookmark for --camera; a present one changes it")},
          {"position", numbers(3, "metres")},
          {"target", numbers(3, "what it looks at, metres; needs a position")},
          {"vertical_angle", number("radians", {{"minimum", 1e-6}, {"maximum", 3.14159}})},
          {"orthographic_half_height", number("metres; makes the camera orthographic", kPositiveRange)},
          {"near", number("metres", kPositiveRange)}};
}

Json light() {
  return {
      {"name", name("a new name adds a light, which needs a type and an intensity; a present one changes it")},
      {"type", word("its shape", {"directional", "point", "spot", "sphere", "capsule", "cone", "wedge", "box",
                                  "rectangle", "environment"})},
      {"position", numbers(3, "metres")},
      {"direction", numbers(3, "where its light goes; of any length but 0")},
      {"tangent", numbers(3, "along a capsule, a wedge's edge, a rectangle's width; of any length but 0")},
      {"intensity", numbers(3,
                            "linear Rec.709; directional and box lux; point, spot, capsule, cone, wedge candela; "
                            "sphere, rectangle cd/m^2",
                            kNotNegativeRange)},
      {"half_extent", numbers(3, "metres", kNotNegativeRange)},
      {"range", number("metres, beyond which it is exactly 0; 0: no end", kNotNegativeRange)},
      {"radius", number("metres", kNotNegativeRange)},
      {"segment_length", number("metres", kNotNegativeRange)},
      {"inner_angle", number("radians from the axis, where the fall-off begins", kAngle)},
      {"outer_angle", number("radians from the axis, where the light ends", kAngle)},
      {"texture", text("image on a rectangle, seen from its lit side with the tangent to the right: its radiance is "
                       "intensity times texel; a path from this file's folder, or \"none\"")},
      {"casts_shadow", boolean("whether techniques give it shadows")}};
}

Json material() {
  return {{"name", name("of a material that the scene has")},
          {"base_color", numbers(4, "linear Rec.709 and alpha", kUnitRange)},
          {"emissive", numbers(3, "cd/m^2, linear Rec.709", kNotNegativeRange)},
          {"metalness", number("0 dielectric, 1 metal", kUnitRange)},
          {"roughness", number("perceptual, as glTF's", kUnitRange)},
          {"normal_scale", number("of the normal map")},
          {"occlusion_strength", number("of the occlusion texture", kUnitRange)},
          {"ior", number("index of refraction", {{"minimum", 1}})},
          {"transmission", number("part of the light that goes through", kUnitRange)},
          {"alpha_cutoff", number("with alpha_mode mask: what is below is a hole", kNotNegativeRange)},
          {"alpha_mode", word("what alpha means", {"opaque", "mask", "blend"})},
          {"double_sided", boolean("seen from behind too")},
          {"unlit", boolean("base_color is radiance as it is")}};
}

}  // namespace

Json overlay_schema(const ComponentCatalog& catalog) {
  const auto with_components = [&](Json keys, Owner owner) {
    keys["components"] = components(catalog, owner);
    return keys;
  };
  Json properties{{"file", text("the scene that is changed, a path from this file's folder; without it the one that is "
                                "there")},
                  {"camera", table("[[camera]] for each", camera())},
                  {"light", table("[[light]] for each", with_components(light(), Owner::kLight))},
                  {"material", table("[[material]] for each", with_components(material(), Owner::kMaterial))},
                  {"instance", table("[[instance]] for each", with_components(instance(), Owner::kInstance))},
                  {"components", components(catalog, Owner::kScene)},
                  {"use_camera", text("name of the camera that renders")},
                  {"animation", text("name of the animation that plays; \"none\": at rest")},
                  {"loop", boolean("whether the animation begins again after its end")}};
  return {{"$schema", "http://json-schema.org/draft-07/schema#"},
          {"title", "Heddle scene overlay"},
          {"description", "a scene, and what is different in it"},
          {"type", "object"},
          {"properties", std::move(properties)},
          {"additionalProperties", false}};
}

}  // namespace heddle::scene
