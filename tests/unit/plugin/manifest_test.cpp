// SPDX-License-Identifier: Apache-2.0
// Manifests: exact there and back, and what is said of broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "diagnostics.hpp"
#include "plugin/technique.hpp"

namespace heddle {
namespace {

using testing::HasSubstr;

/// Numbers that a careless text form would round.
Technique example() {
  Technique technique;
  technique.id = "ambient_occlusion/test";
  technique.title = "Quotes \" and \\ and \n and \u00fc";
  technique.source = "nobody";
  technique.is_reference = true;
  technique.role_revision = 3;
  Port depth;
  depth.name = "depth";
  depth.flags = HEDDLE_PORT_OPTIONAL;
  Port out;
  out.name = "visibility";
  out.direction = Direction::kOut;
  out.flags = HEDDLE_PORT_KEPT | HEDDLE_PORT_CUBE;
  out.format = VK_FORMAT_R16G16B16A16_SFLOAT;
  out.extent_rule = HEDDLE_EXTENT_ABSOLUTE;
  out.extent_scale = 1.0F / 3.0F;
  out.width = 4294967295U;
  out.height = 1;
  out.layers = 12;
  out.mips = 9;
  Port table;
  table.name = "table";
  table.type = PortType::kBuffer;
  table.direction = Direction::kInout;
  table.byte_size = std::numeric_limits<std::uint64_t>::max();
  table.glsl = "float table[];";
  Port list;
  list.name = "found";
  list.type = PortType::kBuffer;
  list.direction = Direction::kOut;
  list.flags = HEDDLE_PORT_LIST;
  list.capacity = 4294967295U;
  list.element_bytes = 12;
  list.glsl = "float found[][3];";
  technique.ports = {depth, out, table, list};
  Parameter radius;
  radius.name = "radius";
  radius.flags = HEDDLE_PARAMETER_KNOB;
  radius.unit = "m";
  radius.minimum = -std::numeric_limits<double>::infinity();
  radius.maximum = std::numeric_limits<double>::infinity();
  radius.default_value = {0.1, 0, 0};
  radius.ladder = {std::numeric_limits<double>::denorm_min(), 1.0 / 3.0, std::numeric_limits<double>::max(), -0.0};
  Parameter quality;
  quality.name = "quality";
  quality.type = ParameterType::kChoice;
  quality.choices = {"low", "high"};
  Parameter tint;
  tint.name = "tint";
  tint.type = ParameterType::kColor;
  tint.default_value = {0.1, 1e-300, 12345678.901234567};
  technique.parameters = {radius, quality, tint};
  Access read{"depth", HEDDLE_ACCESS_SAMPLED_COMPARE, HEDDLE_LOAD_KEEP, {}};
  Access write{"visibility",
               HEDDLE_ACCESS_COLOR,
               HEDDLE_LOAD_CLEAR,
               {std::numeric_limits<float>::infinity(), 0.1F, 1e-45F, -0.0F},
               HEDDLE_BLEND_MULTIPLY};
  Access fill{"table", HEDDLE_ACCESS_STORAGE_READ_WRITE, HEDDLE_LOAD_DONT_CARE, {}};
  Access append{"found", HEDDLE_ACCESS_APPEND, HEDDLE_LOAD_KEEP, {}};
  technique.stages = {{"draw", StageKind::kGpu, {read, write, fill, append}}, {"wait", StageKind::kCpu, {}}};
  technique.shaders = {{"draw", ShaderKind::kSurfaces, "draw", "", {"shadow", "sky"}, VK_COMPARE_OP_LESS, -1.1F, 0.7F}};
  technique.functions = {{"sky", "sky.glsl", {read}, {"shadow"}, true}};
  technique.features = {"mesh"};
  technique.device_features = {"rayQuery"};
  technique.fallback = "none";
  technique.components = {"cloud.layer", "snow.surface"};
  return technique;
}

Manifest example_manifest() {
  Manifest manifest;
  manifest.library = "/plugins/ambient_occlusion/test/test.so";
  manifest.folder = "/plugins/ambient_occlusion/test";
  manifest.abi_major = 0;
  manifest.abi_minor = 1;
  manifest.techniques = {example()};
  return manifest;
}

const std::filesystem::path kFile = "/plugins/ambient_occlusion/test/test.manifest.json";

std::string message(const std::string& json) {
  try {
    manifest_from_json(json, kFile);
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), HEDDLE_BAD_INPUT);
    return error.what();
  }
  return "no error";
}

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Manifest, ComesBackExactly) {
  const Manifest written = example_manifest();
  const Manifest read = manifest_from_json(to_json(written), kFile);
  EXPECT_EQ(read.library, written.library);
  EXPECT_EQ(read.folder, written.folder);
  EXPECT_EQ(read.abi_major, written.abi_major);
  EXPECT_EQ(read.abi_minor, written.abi_minor);
  ASSERT_EQ(read.techniques.size(), 1U);
  EXPECT_TRUE(read.techniques[0] == written.techniques[0]);
  EXPECT_TRUE(std::signbit(read.techniques[0].parameters[0].ladder[3]));  // == does not tell -0 from 0
  EXPECT_TRUE(std::signbit(read.techniques[0].stages[0].accesses[1].clear[3]));
  EXPECT_EQ(to_json(read), to_json(written));
}

Port port_of(std::string name, PortType type, Direction direction, std::uint32_t flags = 0) {
  Port port;
  port.name = std::move(name);
  port.type = type;
  port.direction = direction;
  port.flags = flags;
  port.byte_size = type == PortType::kValue ? 16 : 0;
  return port;
}

TEST(Manifest, OfALoopWithAPastComesBackExactly) {
  Technique technique;
  technique.id = "antialiasing/test";
  technique.title = "a loop";
  Port past = port_of("past", PortType::kImage, Direction::kIn);
  past.previous_of = "sum";
  technique.ports = {port_of("view", PortType::kValue, Direction::kIn),
                     port_of("sample_view", PortType::kValue, Direction::kOut),
                     port_of("radiance", PortType::kImage, Direction::kInout),
                     port_of("sum", PortType::kImage, Direction::kOut, HEDDLE_PORT_KEPT | HEDDLE_PORT_REWRITTEN), past};
  technique.stages = {
      {"watch", StageKind::kCpu, {{"radiance", HEDDLE_ACCESS_HOST_READ, 0, {}}}, 3, HEDDLE_LOOP_OUTSIDE},
      {"move", StageKind::kCpu, {{"sample_view", HEDDLE_ACCESS_VALUE, 0, {}}}, 0, HEDDLE_LOOP_BEFORE},
      {"gather",
       StageKind::kGpu,
       {{"radiance", HEDDLE_ACCESS_SAMPLED, 0, {}}, {"sum", HEDDLE_ACCESS_STORAGE_WRITE, 0, {}}},
       0,
       HEDDLE_LOOP_AFTER}};
  technique.loop = Loop{{{"view", "sample_view"}}, {"radiance"}};
  Manifest written = example_manifest();
  written.techniques = {technique};
  const Manifest read = manifest_from_json(to_json(written), kFile);
  ASSERT_EQ(read.techniques.size(), 1U);
  EXPECT_TRUE(read.techniques[0] == technique);
  EXPECT_EQ(to_json(read), to_json(written));
}

TEST(Manifest, OfCachedStagesComesBackExactly) {
  Manifest written = example_manifest();
  written.techniques[0].stages[1] = {"bake", StageKind::kCpu, {{"table", HEDDLE_ACCESS_HOST_WRITE, 0, {}}}};
  written.techniques[0].ports[2].direction = Direction::kOut;
  std::erase_if(written.techniques[0].stages[0].accesses, [](const Access& access) { return access.port == "table"; });
  for (const std::vector<std::string>& parameters : {std::vector<std::string>{}, {"quality", "radius"}}) {
    written.techniques[0].stages[1].cached_by = parameters;
    const Manifest read = manifest_from_json(to_json(written), kFile);
    EXPECT_TRUE(read.techniques[0] == written.techniques[0]);
    EXPECT_FALSE(read.techniques[0].stages[0].cached_by);
    EXPECT_EQ(read.techniques[0].stages[1].cached_by, parameters);
  }
}

TEST(Manifest, OfAStageThatAChoiceRulesOutComesBackExactly) {
  Manifest written = example_manifest();
  written.techniques[0].parameters[1].flags = HEDDLE_PARAMETER_REDECLARE;
  written.techniques[0].stages[1].only_if = {"quality", "high"};
  const Manifest read = manifest_from_json(to_json(written), kFile);
  EXPECT_FALSE(read.techniques[0].stages[0].only_if);
  EXPECT_EQ(read.techniques[0].stages[1].only_if, written.techniques[0].stages[1].only_if);
}

TEST(Manifest, WithBrokenJsonNamesThePlace) {
  EXPECT_EQ(message("{\n \"format\": 4,\n \"abi\": [0 1]\n}\n"),
            kFile.string() +
                ":3:12: error: manifest: this is no JSON\n"
                "  help:     manifests are written by heddle-manifest: build the plugin again");
  EXPECT_THAT(message(""), HasSubstr(":1:1: error: manifest: this is no JSON"));
  const std::string whole = to_json(example_manifest());
  EXPECT_THAT(message(whole.substr(0, whole.size() / 2)), HasSubstr("error: manifest: this is no JSON"));
}

TEST(Manifest, OfAnotherFormatSaysSo) {
  EXPECT_EQ(message(replaced(to_json(example_manifest()), "\"format\": 4", "\"format\": 5")),
            kFile.string() +
                ": error: manifest: /format is another format\n  found:    5\n  expected: 4\n"
                "  help:     manifests are written by heddle-manifest: build the plugin again");
}

TEST(Manifest, WithAMissingUnknownOrWrongKeyNamesItsPath) {
  const std::string json = to_json(example_manifest());
  EXPECT_THAT(message(replaced(json, "\"layers\"", "\"layer\"")),
              HasSubstr("error: manifest: /techniques/0/ports/0 has an unknown key 'layer'"));
  EXPECT_THAT(message(replaced(json, "    \"mips\": 1,\n", "")),
              HasSubstr("error: manifest: /techniques/0/ports/0 has no 'mips'"));
  EXPECT_EQ(message(replaced(json, "\"layers\": 12", "\"layers\": -12")),
            kFile.string() +
                ": error: manifest: /techniques/0/ports/1/layers has the wrong type\n  found:    -12\n"
                "  expected: an integer from 0\n"
                "  help:     manifests are written by heddle-manifest: build the plugin again");
  EXPECT_THAT(message(replaced(json, "\"layers\": 12", "\"layers\": 4294967296")),
              HasSubstr("/techniques/0/ports/1/layers is too large"));
  EXPECT_THAT(message(replaced(json, "\"type\": \"buffer\"", "\"type\": \"bufer\"")),
              HasSubstr("/techniques/0/ports/2/type is an unknown word\n  found:    \"bufer\"\n"
                        "  expected: one of image, buffer, value, surfaces"));
  EXPECT_THAT(message(replaced(json, "\"-inf\"", "\"inf-\"")),
              HasSubstr("/techniques/0/parameters/0/minimum has the wrong type"));
  EXPECT_THAT(message(replaced(json, "\"test.so\"", "\"../../test.so\"")), HasSubstr("/library is no file name"));
  EXPECT_THAT(message("[]"), HasSubstr("error: manifest: the document has the wrong type"));
}

TEST(Manifest, KeepsTheRulesOfPlugins) {
  EXPECT_EQ(message(replaced(to_json(example_manifest()), "\"port\": \"table\"", "\"port\": \"tabel\"")),
            kFile.string() +
                ": error: technique 'ambient_occlusion/test': stage 'draw': access to 'tabel': there is no such port\n"
                "  expected: one of depth, visibility, table, found\n" +
                kFile.string() +
                ": error: technique 'ambient_occlusion/test': port 'table': no stage and no function touches this "
                "output");
}

}  // namespace
}  // namespace heddle
