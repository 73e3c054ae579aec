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

const Json kUnit{{"minimum", 0}, {"maximum", 1}}, kNotNegative{{"minimum", 0}}, kPositive{{"exclusiveMinimum", 0}},
    kAngle{{"minimum", 0}, {"maximum", std::numbers::pi}};

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
          {"orthographic_half_height", number("metres; makes the camera orthographic", kPositive)},
          {"near", number("metres", kPositive)}};
}

Json light() {
  return {{"name", name("a new name adds a light, which needs a type and an intensity; a present one changes it")},
          {"type", word("its shape", {"directional", "point", "spot", "sphere", "capsule", "cone", "wedge", "box",
                                      "rectangle", "environment"})},
          {"position", numbers(3, "metres")},
          {"direction", numbers(3, "where its light goes; of any length but 0")},
          {"tangent", numbers(3, "along a capsule, a wedge's edge, a rectangle's width; of any length but 0")},
          {"intensity", numbers(3,
                                "linear Rec.709; directional and box lux; point, spot, capsule, cone, wedge candela; "
                                "sphere, rectangle cd/m^2",
                                kNotNegative)},
          {"half_extent", numbers(3, "metres", kNotNegative)},
          {"range", number("metres, beyond which it is exactly 0; 0: no end", kNotNegative)},
          {"radius", number("metres", kNotNegative)},
          {"segment_length", number("metres", kNotNegative)},
          {"inner_angle", number("radians from the axis, where the fall-off begins", kAngle)},
          {"outer_angle", number("radians from the axis, where the light ends", kAngle)},
          {"casts_shadow", boolean("whether techniques give it shadows")}};
}

Json material() {
  return {{"name", name("of a material that the scene has")},
          {"base_color", numbers(4, "linear Rec.709 and alpha", kUnit)},
          {"emissive", numbers(3, "cd/m^2, linear Rec.709", kNotNegative)},
          {"metalness", number("0 dielectric, 1 metal", kUnit)},
          {"roughness", number("perceptual, as glTF's", kUnit)},
          {"normal_scale", number("of the normal map")},
          {"occlusion_strength", number("of the occlusion texture", kUnit)},
          {"ior", number("index of refraction", {{"minimum", 1}})},
          {"transmission", number("part of the light that goes through", kUnit)},
          {"alpha_cutoff", number("with alpha_mode mask: what is below is a hole", kNotNegative)},
          {"alpha_mode", word("what alpha means", {"opaque", "mask", "blend"})},
          {"double_sided", boolean("seen from behind too")},
          {"unlit", boolean("base_color is radiance as it is")}};
}

}  // namespace

Json overlay_schema() {
  Json properties{{"file", text("the scene that is changed, a path from this file's folder; without it the one that is "
                                "there")},
                  {"camera", table("[[camera]] for each", camera())},
                  {"light", table("[[light]] for each", light())},
                  {"material", table("[[material]] for each", material())},
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
