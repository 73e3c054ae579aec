// SPDX-License-Identifier: Apache-2.0
// probe/shadow, sky, surface_material, light, texture: a grid of points or directions to what functions answer;
// probe/text: what a text answers that the pass itself makes. For tests.
#include <heddle/pass.hpp>

#include <fstream>
#include <iterator>

namespace {

using namespace heddle::pass;

constexpr const char* kShapes[] = {"parallelogram", "sphere", nullptr};
constexpr heddle_parameter kShadowParameters[] = {
    integer("light", "1", 0, 4096, 0, "index"),
    choice("shape", kShapes, 0, "of the grid of points"),
    triple("corner", "m", 0, 0, {0, 0, 0},
           "of the parallelogram, or the sphere's centre; relative to the frame's origin"),
    triple("edge_u", "m", 0, 0, {1, 0, 0}, "along x of the image; the sphere's radius is its length"),
    triple("edge_v", "m", 0, 0, {0, 0, 1}, "along y of the image"),
    triple("normal", "1", 0, 0, {0, 1, 0}, "unit; a sphere has its own"),
};
constexpr const char* kAnswers[] = {"radiance", "irradiance", "specular", nullptr};
constexpr heddle_parameter kSkyParameters[] = {
    choice("answer", kAnswers, 0, "which function"),
    parameter("alpha", "1", 0, 1, 0.5, "of the specular lobe"),
};
constexpr const char* kMaterialAnswers[] = {"brdf", "diffuse", "specular", "environment", nullptr};
constexpr heddle_parameter kMaterialParameters[] = {
    choice("answer", kMaterialAnswers, 0, "which function or lobe"),
    parameter("n_dot_v", "1", 0, 1, 0.5, "cosine of the view"),
    parameter("azimuth", "rad", 0, 0, 0, "of the light against the view"),
    parameter("metalness", "1", 0, 1, 0, "of the point"),
    parameter("ior", "1", 0, 10, 1.5, "of the point"),
    color("base_color", "1", 0, 1, {1, 1, 1}, "of the point"),
};
constexpr const char* kLightAnswers[] = {"irradiance", "facing", "direction", nullptr};
constexpr heddle_parameter kLightParameters[] = {
    integer("light", "1", 0, 4096, 0, "index"),
    choice("answer", kLightAnswers, 0, "irradiance on the normal, facing the light, direction; a: distance"),
    triple("corner", "m", 0, 0, {0, 0, 0}, "of the parallelogram, relative to the frame's origin"),
    triple("edge_u", "m", 0, 0, {1, 0, 0}, "along x of the image"),
    triple("edge_v", "m", 0, 0, {0, 0, 1}, "along y of the image"),
    triple("normal", "1", 0, 0, {0, 1, 0}, "unit"),
};
constexpr heddle_port lights_in() {
  heddle_port p = value_in("lights", "every light of the frame");
  p.glsl = "HeddleLight lights[];";
  return p;
}
constexpr heddle_port kLightPorts[] = {
    image_out("values", VK_FORMAT_R32G32B32A32_SFLOAT, "answers"),
    lights_in(),
};
constexpr heddle_access kLightAccesses[] = {storage_write("values"), value("lights")};
constexpr heddle_stage kLightStages[] = {gpu_stage("ask", kLightAccesses)};
constexpr heddle_shader kLightShaders[] = {compute_shader("ask", "ask", "light.comp.glsl")};
constexpr heddle_shader kMaterialShaders[] = {
    compute_shader("ask", "ask", "surface_material.comp.glsl", "surface_material")};
constexpr heddle_port kPorts[] = {image_out("values", VK_FORMAT_R32G32B32A32_SFLOAT, "answers")};
constexpr heddle_access kAccesses[] = {storage_write("values")};
constexpr heddle_stage kStages[] = {gpu_stage("ask", kAccesses)};
constexpr heddle_shader kShadowShaders[] = {compute_shader("ask", "ask", "shadow.comp.glsl", "shadow")};
constexpr heddle_shader kSkyShaders[] = {compute_shader("ask", "ask", "sky.comp.glsl", "sky")};

struct Probe {
  heddle_status record(const Frame& frame) { return frame.dispatch_over("ask", "values"); }
};

constexpr heddle_technique kShadow = technique<Probe>("probe/shadow", "The function shadow at points of a shape",
                                                      "definition", kPorts, kShadowParameters, kStages, kShadowShaders);
constexpr heddle_technique kSky = technique<Probe>("probe/sky", "The functions of sky in all directions", "definition",
                                                   kPorts, kSkyParameters, kStages, kSkyShaders);

constexpr heddle_technique kMaterial =
    technique<Probe>("probe/surface_material", "The functions of surface_material", "definition", kPorts,
                     kMaterialParameters, kStages, kMaterialShaders);
constexpr heddle_parameter kPatternParameters[] = {parameter("white", "1", 0, 1e9, 1, "the ramp's end")};
constexpr heddle_shader kPatternShaders[] = {compute_shader("ask", "ask", "pattern.comp.glsl")};
constexpr heddle_technique kPattern =
    technique<Probe>("probe/pattern", "Numbers that techniques must survive", "definition", kPorts, kPatternParameters,
                     kStages, kPatternShaders);
constexpr heddle_parameter kColorsParameters[] = {
    parameter("lowest", "1", -30, 30, -12, "exponent of 2 of the darkest value but 0"),
    parameter("highest", "1", -30, 30, 10, "exponent of 2 of the brightest value"),
};
constexpr heddle_shader kColorsShaders[] = {compute_shader("ask", "ask", "colors.comp.glsl")};
constexpr heddle_technique kColors = technique<Probe>("probe/colors", "Colours of every mixture and brightness",
                                                      "definition", kPorts, kColorsParameters, kStages, kColorsShaders);
constexpr heddle_technique kLight =
    technique<Probe>("probe/light", "A light at points of a parallelogram", "definition", kLightPorts, kLightParameters,
                     kLightStages, kLightShaders);

constexpr heddle_parameter kTextureParameters[] = {
    integer("material", "1", 0, 4096, 0, "id"),
    triple("corner", "1", 0, 0, {0, 0, 0}, "uv of pixel (0, 0): x and y"),
    triple("edge_u", "1", 0, 0, {1, 0, 0}, "of uv from pixel to pixel in x: also the derivative"),
    triple("edge_v", "1", 0, 0, {0, 1, 0}, "in y"),
    parameter("footprint", "1", 0, 0, 1, "what derivatives are multiplied with"),
};
constexpr heddle_shader kTextureShaders[] = {compute_shader("ask", "ask", "texture.comp.glsl", "texture_source")};
constexpr heddle_technique kTexture =
    technique<Probe>("probe/texture", "The function texture_source at points of a parallelogram", "definition", kPorts,
                     kTextureParameters, kStages, kTextureShaders);

constexpr heddle_parameter kTextParameters[] = {
    text("expression", "of x, the pixel's column", HEDDLE_PARAMETER_REDECLARE),
    text("file", "holds an expression", HEDDLE_PARAMETER_REDECLARE),
    names("terms", "expressions, added"),
    toggle("without_file", false, "sets a text that no file stands in for", HEDDLE_PARAMETER_REDECLARE),
    toggle("late", false, "sets a text in record"),
};
constexpr heddle_shader kTextShaders[] = {compute_shader("ask", "ask", "text.comp.glsl")};

/// An expression of the graph's author -> the function that text.comp.glsl calls.
struct Text {
  heddle_status declare(const PassHost& host) {
    std::string sum = host.text("expression");
    if (const std::string file = host.text("file"); !file.empty()) {
      std::ifstream stream(host.resolve_path(file));
      if (!stream) return host.fail(HEDDLE_BAD_INPUT, "cannot read " + host.resolve_path(file));
      sum.assign(std::istreambuf_iterator<char>(stream), {});
    }
    for (std::uint32_t i = 0; !host.text("terms", i).empty(); ++i) sum += " + " + host.text("terms", i);
    if (host.toggle("without_file")) return host.set_text("nothing", sum);
    return sum.empty() ? HEDDLE_OK : host.set_text("expression", "float expression(float x) { return " + sum + "; }\n");
  }
  heddle_status record(const Frame& frame) {
    if (frame.host().toggle("late")) return frame.host().set_text("expression", "");
    return frame.dispatch_over("ask", "values");
  }
};
constexpr heddle_technique kText = technique<Text>("probe/text", "A text that the pass makes", "definition", kPorts,
                                                   kTextParameters, kStages, kTextShaders);

}  // namespace

HEDDLE_PLUGIN(kShadow, kSky, kMaterial, kLight, kPattern, kColors, kText, kTexture)
