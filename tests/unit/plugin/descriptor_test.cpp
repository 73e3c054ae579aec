// SPDX-License-Identifier: Apache-2.0
// Descriptors: what is copied, and every rule of plugin.h that a broken one meets. Each test breaks one field of a
// right descriptor and compares the whole message.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>

#include "diagnostics.hpp"
#include "plugin/rules.hpp"
#include "plugin/technique.hpp"

namespace heddle {
namespace {

/// A right descriptor that uses everything, open to be changed.
struct Example {
  heddle_port ports[3]{};
  heddle_parameter parameters[3]{};
  heddle_access accesses[3]{};
  heddle_stage stages[2]{};
  heddle_shader shaders[1]{};
  heddle_function functions[1]{};
  const char* choices[3]{"low", "high", nullptr};
  double ladder[3]{1, 2, 4};
  heddle_technique technique{};

  Example() {
    for (heddle_port& port : ports) port.struct_size = sizeof(heddle_port);
    ports[0].name = "depth";
    ports[0].flags = HEDDLE_PORT_OPTIONAL;
    ports[0].help = "distance";
    ports[1].name = "visibility";
    ports[1].direction = HEDDLE_OUT;
    ports[1].flags = HEDDLE_PORT_KEPT;
    ports[1].format = VK_FORMAT_R32_SFLOAT;
    ports[1].extent_scale = 0.5F;
    ports[1].layers = 2;
    ports[2].name = "table";
    ports[2].type = HEDDLE_PORT_BUFFER;
    ports[2].direction = HEDDLE_OUT;
    ports[2].byte_size = 1ULL << 40U;
    ports[2].glsl = "float table[];";
    for (heddle_parameter& parameter : parameters) parameter.struct_size = sizeof(heddle_parameter);
    parameters[0].name = "radius";
    parameters[0].unit = "m";
    parameters[0].minimum = 0;
    parameters[0].maximum = INFINITY;
    parameters[0].default_value[0] = 0.1;
    parameters[1].name = "quality";
    parameters[1].type = HEDDLE_TYPE_CHOICE;
    parameters[1].choices = choices;
    parameters[1].default_value[0] = 1;
    parameters[2].name = "samples";
    parameters[2].type = HEDDLE_TYPE_INT;
    parameters[2].flags = HEDDLE_PARAMETER_KNOB | HEDDLE_PARAMETER_CONSTANT;
    parameters[2].minimum = 1;
    parameters[2].maximum = 4;
    parameters[2].default_value[0] = 2;
    parameters[2].ladder = ladder;
    parameters[2].ladder_count = 3;
    for (heddle_access& access : accesses) access.struct_size = sizeof(heddle_access);
    accesses[0].port = "depth";
    accesses[1].port = "visibility";
    accesses[1].access = HEDDLE_ACCESS_COLOR;
    accesses[1].load = HEDDLE_LOAD_CLEAR;
    accesses[1].clear[0] = 0.1F;
    accesses[2].port = "table";
    accesses[2].access = HEDDLE_ACCESS_HOST_WRITE;
    for (heddle_stage& stage : stages) stage.struct_size = sizeof(heddle_stage);
    stages[0].name = "draw";
    stages[0].access_count = 2;
    stages[0].accesses = accesses;
    stages[1].name = "fill";
    stages[1].kind = HEDDLE_STAGE_CPU;
    stages[1].access_count = 1;
    stages[1].accesses = accesses + 2;
    shaders[0].struct_size = sizeof(heddle_shader);
    shaders[0].name = "draw";
    shaders[0].kind = HEDDLE_SHADER_FULLSCREEN;
    shaders[0].stage = "draw";
    shaders[0].file = "draw.frag.glsl";
    shaders[0].calls = " shadow  sky ";
    functions[0].struct_size = sizeof(heddle_function);
    functions[0].role = "sky";
    functions[0].file = "sky.glsl";
    functions[0].access_count = 1;
    functions[0].accesses = accesses;
    technique.struct_size = sizeof(heddle_technique);
    technique.id = "ambient_occlusion/test";
    technique.title = "A test";
    technique.source = "nobody";
    technique.flags = HEDDLE_TECHNIQUE_REFERENCE;
    technique.role_revision = 1;
    technique.port_count = 3;
    technique.ports = ports;
    technique.parameter_count = 3;
    technique.parameters = parameters;
    technique.stage_count = 2;
    technique.stages = stages;
    technique.shader_count = 1;
    technique.shaders = shaders;
    technique.function_count = 1;
    technique.functions = functions;
    technique.features = "mesh light";
    technique.fallback = "nothing";
    technique.components = "cloud.layer snow.surface";
  }
  Example(const Example&) = delete;
  Example& operator=(const Example&) = delete;
};

std::string message(const std::function<void(Example&)>& change) {
  Example example;
  change(example);
  try {
    from_descriptor(example.technique, "t.so");
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), HEDDLE_BUG);
    return error.what();
  }
  return "no error";
}

constexpr std::string_view kWho = "t.so: error: technique 'ambient_occlusion/test': ";
std::string told(std::string_view text) {
  return std::string(kWho) + std::string(text);
}

TEST(Descriptor, IsCopiedWhole) {
  Technique technique;
  {
    Example example;
    technique = from_descriptor(example.technique, "t.so");
    std::memset(static_cast<void*>(example.ports), 0xff, sizeof example.ports);  // nothing is borrowed
  }
  EXPECT_EQ(technique.id, "ambient_occlusion/test");
  EXPECT_EQ(technique.role_name(), "ambient_occlusion");
  EXPECT_EQ(technique.name(), "test");
  EXPECT_TRUE(technique.is_reference);
  ASSERT_EQ(technique.ports.size(), 3U);
  EXPECT_TRUE(technique.ports[0].is_optional());
  EXPECT_EQ(technique.ports[0].extent_scale, 1.0F);  // 0 means 1
  EXPECT_EQ(technique.ports[0].layers, 1U);
  EXPECT_EQ(technique.ports[1].extent_scale, 0.5F);
  EXPECT_EQ(technique.ports[1].layers, 2U);
  EXPECT_TRUE(technique.ports[1].is_kept());
  EXPECT_EQ(technique.ports[2].byte_size, 1ULL << 40U);
  EXPECT_EQ(technique.ports[2].glsl, "float table[];");
  ASSERT_EQ(technique.parameters.size(), 3U);
  EXPECT_EQ(technique.parameters[0].maximum, INFINITY);
  EXPECT_EQ(technique.parameters[1].choices, (std::vector<std::string>{"low", "high"}));
  EXPECT_EQ(technique.parameters[2].ladder, (std::vector<double>{1, 2, 4}));
  EXPECT_TRUE(technique.find_parameter("samples")->is_knob());
  EXPECT_EQ(technique.find_parameter("sample"), nullptr);
  ASSERT_EQ(technique.stages.size(), 2U);
  EXPECT_EQ(technique.stages[0].accesses[1].clear[0], 0.1F);
  EXPECT_EQ(technique.find_stage("fill")->kind, StageKind::kCpu);
  EXPECT_EQ(technique.find_shader("draw")->calls, (std::vector<std::string>{"shadow", "sky"}));
  EXPECT_EQ(technique.find_function("sky")->file, "sky.glsl");
  EXPECT_FALSE(technique.find_function("sky")->has_service);
  EXPECT_EQ(technique.features, (std::vector<std::string>{"mesh", "light"}));
  EXPECT_EQ(technique.fallback, "nothing");
  EXPECT_EQ(technique.components, (std::vector<std::string>{"cloud.layer", "snow.surface"}));
}

TEST(Descriptor, OfAnOlderPluginKeepsDefaultsForNewFields) {
  Example example;
  // As if `layers` and all that follows had been appended later: the stride is the older structure's.
  struct OldPort {
    unsigned char bytes[offsetof(heddle_port, layers)];
  };
  alignas(heddle_port) OldPort old[3];
  for (std::size_t i = 0; i < 3; ++i) {
    example.ports[i].struct_size = sizeof(OldPort);
    std::memcpy(old + i, example.ports + i, sizeof(OldPort));
  }
  example.technique.declare = [](heddle_pass*, const heddle_pass_host*) -> heddle_status { return HEDDLE_OK; };
  example.technique.ports = reinterpret_cast<const heddle_port*>(old);
  example.technique.struct_size = offsetof(heddle_technique, features);
  example.technique.declare = nullptr;
  // Without declare an output buffer needs its size, which the older structure cannot say.
  example.technique.port_count = 2;
  example.technique.stage_count = 1;
  const Technique technique = from_descriptor(example.technique, "t.so");
  ASSERT_EQ(technique.ports.size(), 2U);
  EXPECT_EQ(technique.ports[1].name, "visibility");
  EXPECT_EQ(technique.ports[1].layers, 1U);
  EXPECT_EQ(technique.ports[1].help, "");
  EXPECT_TRUE(technique.features.empty());
  EXPECT_TRUE(technique.components.empty());
}

TEST(Descriptor, OfANewerPluginIsReadByItsOwnStride) {
  struct NewPort {
    heddle_port port;
    std::uint64_t appended[3];
  };
  Example example;
  NewPort ports[3]{};
  for (std::size_t i = 0; i < 3; ++i) {
    ports[i].port = example.ports[i];
    ports[i].port.struct_size = sizeof(NewPort);
    ports[i].appended[0] = ~0ULL;
  }
  example.technique.ports = &ports[0].port;
  const Technique technique = from_descriptor(example.technique, "t.so");
  ASSERT_EQ(technique.ports.size(), 3U);
  EXPECT_EQ(technique.ports[2].name, "table");
}

TEST(Descriptor, WithAStructureThatIsTooSmallIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.technique.struct_size = 8; }),
            "t.so: error: heddle_technique: struct_size is too small\n  found:    8\n  expected: 96 bytes or more");
  EXPECT_EQ(message([](Example& e) { e.ports[0].struct_size = 4; }),
            told("ports[0]: struct_size is too small\n  found:    4\n  expected: 24 bytes or more"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].struct_size = 0; }),
            told("ports[1]: struct_size differs from the first's\n  found:    0\n  expected: 128"));
}

TEST(Descriptor, WithNullPointersIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.technique.id = nullptr; }),
            "t.so: error: technique: id is NULL\n  expected: a string");
  EXPECT_EQ(message([](Example& e) { e.technique.title = nullptr; }), told("title is NULL\n  expected: a string"));
  EXPECT_EQ(message([](Example& e) { e.technique.ports = nullptr; }), told("ports is NULL\n  found:    3 of them"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].name = nullptr; }),
            told("ports[1]: name is NULL\n  expected: a string"));
  EXPECT_EQ(message([](Example& e) { e.parameters[2].ladder = nullptr; }),
            told("parameters[2]: ladder is NULL\n  found:    3 of them"));
  EXPECT_EQ(message([](Example& e) { e.accesses[1].port = nullptr; }),
            told("stages[0]: accesses[1]: port is NULL\n  expected: a string"));
  EXPECT_EQ(message([](Example& e) { e.functions[0].file = nullptr; }),
            told("functions[0]: file is NULL\n  expected: a string"));
}

TEST(Descriptor, WithTextThatIsNotUtf8IsRefused) {
  EXPECT_EQ(message([](Example& e) { e.technique.source = "Mitter\xfc"; }), told("source is not UTF-8"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].help = "\xed\xa0\x80"; }), told("ports[0]: help is not UTF-8"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].help = "\xc0\x80"; }), told("ports[0]: help is not UTF-8"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].help = "\u00fc \u20ac \U0001F600"; }), "no error");
}

TEST(Descriptor, WithABadIdIsRefused) {
  const std::string expected = "\n  expected: \"role/technique\", both names, and the technique's not 'none'";
  for (const char* id : {"gtao", "a/b/c", "a/", "/b", "a/none", "a/1b", "a/b-c"}) {
    EXPECT_EQ(message([&](Example& e) { e.technique.id = id; }), std::string("t.so: error: technique '") + id +
                                                                     "': id is no technique id\n  found:    \"" + id +
                                                                     "\"" + expected);
  }
}

TEST(Descriptor, WithUnknownEnumerationsIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.ports[0].type = 9; }),
            told("port 'depth': unknown type\n  found:    9\n  expected: 0 to 5"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].direction = 3; }),
            told("port 'depth': unknown direction\n  found:    3\n  expected: 0 to 2"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].flags = 64; }),
            told("port 'depth': unknown flags\n  found:    0x40\n  expected: a combination within 0x1f"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].extent_rule = 2; }),
            told("port 'visibility': unknown extent_rule\n  found:    2\n  expected: 0 to 1"));
  EXPECT_EQ(message([](Example& e) { e.parameters[0].type = 8; }),
            told("parameter 'radius': unknown type\n  found:    8\n  expected: 0 to 7"));
  EXPECT_EQ(message([](Example& e) { e.accesses[0].access = 17; }),
            told("stage 'draw': access to 'depth': unknown access\n  found:    17\n  expected: 0 to 16\n") +
                told("function 'sky': access to 'depth': unknown access\n  found:    17\n  expected: 0 to 16\n") +
                told("function 'sky': access to 'depth' is not for functions\n  found:    HEDDLE_ACCESS 17\n"
                     "  expected: SAMPLED*, STORAGE_*, VALUE or APPEND"));
  EXPECT_EQ(message([](Example& e) { e.accesses[1].load = HEDDLE_LOAD_CLEAR_NEW + 1; }),
            told("stage 'draw': access to 'visibility': unknown load\n  found:    4\n  expected: 0 to 3\n") +
                told("port 'visibility': no stage and no function touches this output"));
  EXPECT_EQ(message([](Example& e) { e.shaders[0].kind = 3; }),
            told("shader 'draw': unknown kind\n  found:    3\n  expected: 0 to 2"));
  EXPECT_EQ(message([](Example& e) { e.shaders[0].depth_compare = 8; }),
            told("shader 'draw': unknown depth_compare\n  found:    8\n  expected: 0 to 7"));
  EXPECT_EQ(message([](Example& e) { e.technique.flags = 6; }), told("unknown flags\n  found:    0x6"));
}

TEST(Descriptor, WithTwoThingsOfOneNameIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.ports[0].name = "table"; }).substr(0, kWho.size() + 44),
            told("two of the kind port are called 'table'\n").substr(0, kWho.size() + 40) + "t.so");
  EXPECT_EQ(message([](Example& e) { e.parameters[1].name = "radius"; }),
            told("two of the kind parameter are called 'radius'"));
  EXPECT_EQ(message([](Example& e) { e.stages[1].name = "draw"; }), told("two of the kind stage are called 'draw'"));
}

TEST(Descriptor, WithANameThatGlslRefusesIsRefused) {
  for (const char* name : {"", "2d", "a-b", "a__b", "gl_depth", "a b", "gr\u00f6sse"}) {
    EXPECT_EQ(message([&](Example& e) { e.parameters[0].name = name; }),
              told(std::string("parameter '") + name +
                   "': this is no name\n  expected: letters, digits and single underscores, no digit first, no gl_"));
  }
}

TEST(Descriptor, WithAPortThatContradictsItselfIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.ports[1].flags = HEDDLE_PORT_OPTIONAL; }),
            told("port 'visibility': an output cannot be HEDDLE_PORT_OPTIONAL"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].flags = HEDDLE_PORT_KEPT; }),
            told("port 'depth': an input cannot be HEDDLE_PORT_KEPT"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].format = 1; }),
            told("port 'depth': an input cannot choose a format\n  found:    1\n  expected: 0"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].format = 0; }),
            told("ports[1]: an image output without format\n  found:    0\n"
                 "  expected: a VkFormat, or a declare that sets it"));
  EXPECT_EQ(message([](Example& e) { e.ports[2].byte_size = 0; }),
            told("ports[2]: an output without byte_size\n  found:    0\n"
                 "  expected: the capacity in bytes, or a declare that sets it"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].flags = HEDDLE_PORT_CUBE; }),
            told("port 'visibility': HEDDLE_PORT_CUBE needs an image with layers in sixes\n  found:    2 layers"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].extent_scale = -1; }),
            told("port 'visibility': extent_scale is no scale\n  found:    -1\n  expected: a number above 0"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].extent_rule = HEDDLE_EXTENT_ABSOLUTE; }),
            told("port 'visibility': HEDDLE_EXTENT_ABSOLUTE without an extent\n  found:    0 x 0\n"
                 "  expected: width and height above 0"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].glsl = "float x;"; }),
            told("port 'depth': glsl belongs to buffers and values"));
}

TEST(Descriptor, WithSurfacesThatHaveNoPlaceIsRefused) {
  // Port 'visibility' becomes surfaces, whose batches would lie in 'table'.
  const auto made = [](const auto& change) {
    return message([&](Example& e) {
      e.ports[1].type = HEDDLE_PORT_SURFACES;
      e.ports[1].flags = 0;
      e.ports[1].vertices = "table";
      e.ports[1].indices = "table";
      for (heddle_access& access : e.accesses)
        if (std::string_view(access.port) == "visibility") {
          access.access = HEDDLE_ACCESS_BATCHES;
          access.load = HEDDLE_LOAD_KEEP;
        }
      change(e);
    });
  };
  EXPECT_EQ(made([](Example&) {}), "no error");
  EXPECT_EQ(made([](Example& e) { e.ports[1].vertices = "depth"; }),
            told("port 'visibility': vertices names nothing that batches could lie in\n  found:    \"depth\"\n"
                 "  expected: an out buffer of the technique, a list for commands alone"));
  EXPECT_EQ(
      made([](Example& e) { e.ports[1].indices = nullptr; }),
      told("port 'visibility': its batches have no place\n"
           "  expected: vertices, or a function of role surface_program, and indices; instances and commands both or "
           "none"));
  EXPECT_EQ(
      made([](Example& e) { e.ports[1].commands = "table"; }),
      told("port 'visibility': its batches have no place\n"
           "  expected: vertices, or a function of role surface_program, and indices; instances and commands both or "
           "none"));
  // Or their vertices are what a function answers, which sees little.
  const auto asked = [&](const auto& change) {
    return made([&](Example& e) {
      e.ports[1].vertices = nullptr;
      e.functions[0].role = "surface_program";
      e.functions[0].calls = nullptr;
      e.accesses[2].access = HEDDLE_ACCESS_STORAGE_READ;
      e.stages[1].kind = HEDDLE_STAGE_GPU;
      e.functions[0].accesses = e.accesses + 2;
      e.functions[0].access_count = 1;
      change(e);
    });
  };
  EXPECT_EQ(asked([](Example&) {}), "no error");
  EXPECT_EQ(asked([](Example& e) { e.functions[0].calls = "shadow"; }),
            told("function 'surface_program' calls functions\n  found:    shadow\n  expected: none: it is no pass"));
  EXPECT_EQ(asked([](Example& e) { e.accesses[2].access = HEDDLE_ACCESS_STORAGE_READ_WRITE; }),
            told("function 'surface_program': access to 'table' is not for surface programs\n"
                 "  found:    HEDDLE_ACCESS 4\n  expected: VALUE, or STORAGE_READ of a buffer"));
  EXPECT_EQ(message([](Example& e) { e.ports[2].vertices = "table"; }),
            told("port 'table': vertices names nothing that batches could lie in\n  found:    \"table\"\n"
                 "  expected: NULL: it makes no surfaces"));
}

TEST(Descriptor, WithAListThatContradictsItselfIsRefused) {
  const auto list = [](const auto& change) {
    return message([&](Example& e) {
      e.ports[2].flags = HEDDLE_PORT_LIST;
      e.ports[2].byte_size = 0;
      e.ports[2].element_bytes = 8;
      e.accesses[2].access = HEDDLE_ACCESS_HOST_READ;
      change(e);
    });
  };
  EXPECT_EQ(list([](Example&) {}), "no error") << "a capacity of 0 is one";
  EXPECT_EQ(list([](Example& e) { e.ports[2].byte_size = 64; }),
            told("port 'table': a list's memory follows from its capacity\n  found:    byte_size 64\n"
                 "  expected: byte_size 0"));
  EXPECT_EQ(list([](Example& e) { e.ports[2].element_bytes = 6; }),
            told("port 'table': element_bytes is no size of an element\n  found:    6\n"
                 "  expected: a multiple of 4 above 0"));
  EXPECT_EQ(list([](Example& e) {
              e.ports[2].direction = HEDDLE_INOUT;
              e.ports[2].element_bytes = 0;
            }),
            "no error")
      << "the maker says it";
  EXPECT_EQ(list([](Example& e) {
              e.ports[2].direction = HEDDLE_INOUT;
              e.ports[2].flags = HEDDLE_PORT_LIST | HEDDLE_PORT_OPTIONAL;
              e.ports[2].element_bytes = 0;
            }),
            told("port 'table': element_bytes is no size of an element\n  found:    0\n"
                 "  expected: a multiple of 4 above 0"));
  EXPECT_EQ(list([](Example& e) { e.accesses[2].access = HEDDLE_ACCESS_HOST_WRITE; }),
            told("stage 'fill': access to 'table': the access does not fit the port's type\n"
                 "  found:    HEDDLE_ACCESS 11"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].flags = HEDDLE_PORT_LIST; }),
            told("port 'visibility': HEDDLE_PORT_LIST is for buffers\n") +
                told("port 'visibility': element_bytes is no size of an element\n  found:    0\n"
                     "  expected: a multiple of 4 above 0\n") +
                told("stage 'draw': access to 'visibility': the access does not fit the port's type\n"
                     "  found:    HEDDLE_ACCESS 5"));
  EXPECT_EQ(message([](Example& e) { e.ports[2].capacity = 8; }),
            told("port 'table': capacity and element_bytes belong to HEDDLE_PORT_LIST"));
}

TEST(Descriptor, WithAHistoryThatIsNotThereIsRefused) {
  const auto refused = [](const std::string& name) {
    return told("port 'depth': previous_of names nothing that it could read\n  found:    \"" + name +
                "\"\n  expected: for an input: an output of its type, images and buffers HEDDLE_PORT_KEPT");
  };
  EXPECT_EQ(message([](Example& e) { e.ports[0].previous_of = "visibility"; }), "no error");
  EXPECT_EQ(message([](Example& e) { e.ports[0].previous_of = "nothing"; }), refused("nothing"));
  EXPECT_EQ(message([](Example& e) { e.ports[0].previous_of = "table"; }), refused("table"));
  EXPECT_EQ(message([](Example& e) {
              e.ports[0].previous_of = "visibility";
              e.ports[1].flags = 0;
            }),
            refused("visibility"));
  EXPECT_EQ(message([](Example& e) { e.ports[1].flags = HEDDLE_PORT_REWRITTEN; }),
            told("port 'visibility': HEDDLE_PORT_REWRITTEN is for outputs that are HEDDLE_PORT_KEPT"));
}

TEST(Descriptor, WithALatencyThatMeansNothingIsRefused) {
  const auto refused = [](const std::string& stage, const std::string& latency) {
    return told("stage '" + stage + "': latency has no meaning here\n  found:    " + latency +
                "\n  expected: 1 to 16, in a cpu stage with HOST_READ of an image or buffer");
  };
  EXPECT_EQ(message([](Example& e) { e.stages[0].latency = 1; }), refused("draw", "1"));
  EXPECT_EQ(message([](Example& e) { e.stages[1].latency = 1; }), refused("fill", "1"));  // it only writes
  const auto reads = [](std::uint32_t latency) {
    return [latency](Example& e) {
      e.stages[1].latency = latency;
      e.stages[1].accesses = e.accesses + 1;
      e.stages[1].access_count = 2;
      e.stages[0].access_count = 1;
      e.accesses[1] = e.accesses[2];
      e.accesses[1].port = "visibility";
      e.accesses[1].access = HEDDLE_ACCESS_HOST_READ;
    };
  };
  EXPECT_EQ(message(reads(16)), "no error");
  EXPECT_EQ(message(reads(17)), refused("fill", "17"));
}

TEST(Descriptor, OfACachedStageIsRefusedWhereItsKeyWouldLackSomething) {
  EXPECT_EQ(message([](Example& e) { e.stages[1].cached_by = "radius quality"; }), "no error");
  EXPECT_EQ(message([](Example& e) { e.stages[1].cached_by = ""; }), "no error");
  EXPECT_EQ(message([](Example& e) { e.stages[1].cached_by = "radios"; }),
            told("stage 'fill': cached_by names no parameter, or one twice\n  found:    \"radios\""));
  EXPECT_EQ(message([](Example& e) { e.stages[1].cached_by = "radius radius"; }),
            told("stage 'fill': cached_by names no parameter, or one twice\n  found:    \"radius\""));
  EXPECT_EQ(message([](Example& e) {
              e.stages[0].cached_by = "";
              e.stages[0].access_count = 1;
            }),
            told("stage 'draw': cached_by has no meaning here\n"
                 "  expected: a cpu stage without latency, in no part of a loop") +
                "\n" + told("stage 'draw': it is cached, and has no output") + "\n" +
                told("port 'visibility': no stage and no function touches this output"));
  EXPECT_EQ(message([](Example& e) {
              e.stages[1].cached_by = "";
              e.ports[2].direction = HEDDLE_INOUT;
            }),
            told("stage 'fill': it is cached, and 'table' cannot be part of that\n"
                 "  expected: inputs that are no surfaces and no lists, and outputs that it only writes") +
                "\n" + told("stage 'fill': it is cached, and has no output"));
  EXPECT_EQ(message([](Example& e) {
              e.stages[1].cached_by = "";
              e.ports[2].flags = HEDDLE_PORT_LIST;
              e.ports[2].direction = HEDDLE_IN;
              e.ports[2].byte_size = 0;
              e.accesses[2].access = HEDDLE_ACCESS_HOST_READ;
            }),
            told("stage 'fill': it is cached, and 'table' cannot be part of that\n"
                 "  expected: inputs that are no surfaces and no lists, and outputs that it only writes") +
                "\n" + told("stage 'fill': it is cached, and has no output"));
}

TEST(Descriptor, OfAStageThatAChoiceRulesOutNamesAChoiceThatIsDeclaredAnew) {
  const auto only_if = [](const char* text, std::uint32_t flags = HEDDLE_PARAMETER_REDECLARE) {
    return message([&](Example& e) {
      e.stages[1].only_if = text;
      e.parameters[1].flags = flags;
    });
  };
  const auto refused = [](const std::string& text) {
    return told("stage 'fill': only_if names no choice that is declared anew\n  found:    \"" + text +
                "\"\n  expected: \"PARAMETER=CHOICE\" of a HEDDLE_TYPE_CHOICE with HEDDLE_PARAMETER_REDECLARE");
  };
  EXPECT_EQ(only_if("quality=high"), "no error");
  EXPECT_EQ(only_if("quality=higher"), refused("quality=higher"));
  EXPECT_EQ(only_if("quality"), refused("quality="));
  EXPECT_EQ(only_if("radius=1"), refused("radius=1"));
  EXPECT_EQ(only_if("color=red"), refused("color=red"));
  EXPECT_EQ(only_if("quality=high", 0), refused("quality=high"));
}

TEST(Descriptor, OfWhatLastsIsRefusedWhereJobsCannotKeepIt) {
  const auto lasting = [](std::uint32_t type, const std::function<void(Example&)>& change) {
    return message([&](Example& e) {
      e.ports[2].type = type;
      e.ports[2].glsl = nullptr;
      e.ports[2].byte_size = 0;
      for (heddle_access& access : e.accesses)
        if (access.port != nullptr && std::string_view(access.port) == "table") access.access = HEDDLE_ACCESS_VALUE;
      change(e);
    });
  };
  EXPECT_EQ(lasting(HEDDLE_PORT_ARTIFACT, [](Example&) {}), "no error");
  EXPECT_EQ(lasting(HEDDLE_PORT_REPORT, [](Example&) {}), "no error");
  EXPECT_THAT(lasting(HEDDLE_PORT_ARTIFACT, [](Example& e) { e.ports[2].direction = HEDDLE_INOUT; }),
              testing::HasSubstr("port 'table': the direction does not fit its type\n"
                                 "  found:    an artifact that is changed\n  expected: HEDDLE_IN or HEDDLE_OUT"));
  EXPECT_THAT(lasting(HEDDLE_PORT_REPORT, [](Example& e) { e.ports[2].direction = HEDDLE_IN; }),
              testing::HasSubstr("port 'table': the direction does not fit its type\n"
                                 "  found:    a report\n  expected: HEDDLE_OUT"));
  EXPECT_EQ(lasting(HEDDLE_PORT_ARTIFACT, [](Example& e) { e.ports[2].flags = HEDDLE_PORT_KEPT; }),
            told("port 'table': artifacts and reports have no size and no flags but HEDDLE_PORT_OPTIONAL"));
}

TEST(Descriptor, ThatSavesStatesAlsoLoadsThem) {
  EXPECT_EQ(message([](Example& e) {
              e.technique.save_state = [](heddle_pass*, const heddle_pass_host*, std::uint32_t, heddle_frame*) {
                return HEDDLE_OK;
              };
            }),
            told("save_state and load_state go together\n  found:    save_state\n  expected: both, or neither"));
}

/// A right loop, open to be changed; what broken_rules says of it.
std::string loop_message(const std::function<void(Technique&)>& change) {
  const auto port_of = [](const char* name, PortType type, Direction direction, std::uint32_t flags = 0) {
    Port port;
    port.name = name;
    port.type = type;
    port.direction = direction;
    port.flags = flags;
    return port;
  };
  Technique technique;
  technique.id = "ambient_occlusion/test";
  technique.title = "a loop";
  technique.ports = {port_of("view", PortType::kValue, Direction::kIn),
                     port_of("sample_view", PortType::kValue, Direction::kOut),
                     port_of("radiance", PortType::kImage, Direction::kInout),
                     port_of("sum", PortType::kImage, Direction::kOut, HEDDLE_PORT_KEPT)};
  technique.stages = {{"move", StageKind::kCpu, {{"sample_view", HEDDLE_ACCESS_VALUE, 0, {}}}, 0, HEDDLE_LOOP_BEFORE},
                      {"gather",
                       StageKind::kGpu,
                       {{"radiance", HEDDLE_ACCESS_SAMPLED, 0, {}}, {"sum", HEDDLE_ACCESS_STORAGE_READ_WRITE, 0, {}}},
                       0,
                       HEDDLE_LOOP_AFTER}};
  technique.loop = Loop{{{"view", "sample_view"}}, {"radiance"}};
  change(technique);
  const std::vector<Diagnostic> broken = broken_rules(technique, {"t.so", 0, 0});
  return broken.empty() ? "no error" : to_text(broken);
}

TEST(Descriptor, WithALoopThatContradictsItselfIsRefused) {
  EXPECT_EQ(loop_message([](Technique&) {}), "no error");
  EXPECT_EQ(loop_message([](Technique& t) { t.loop.reset(); }),
            told("stage 'move' is part of a loop, and the technique has none\n") +
                told("stage 'gather' is part of a loop, and the technique has none"));
  EXPECT_EQ(loop_message([](Technique& t) { t.loop->overrides.clear(); }),
            told("its loop overrides or gathers nothing\n"
                 "  expected: an override set by a stage HEDDLE_LOOP_BEFORE, and a gathered input of a stage "
                 "HEDDLE_LOOP_AFTER"));
  EXPECT_EQ(loop_message([](Technique& t) { t.loop->overrides[0].output = "sum"; }),
            told("its loop cannot override 'view' by 'sum'\n"
                 "  expected: two values: an input, and an output that a stage HEDDLE_LOOP_BEFORE sets"));
  EXPECT_EQ(loop_message([](Technique& t) { t.loop->gathers = {"sum"}; }),
            told("its loop cannot gather 'sum'\n"
                 "  expected: an image or buffer that goes in, and that a stage HEDDLE_LOOP_AFTER reads"));
  EXPECT_EQ(loop_message([](Technique& t) { t.ports[3].flags = 0; }),
            told("stage 'gather' gathers into 'sum', which is not HEDDLE_PORT_KEPT"));
  EXPECT_EQ(loop_message([](Technique& t) { std::swap(t.stages[0], t.stages[1]); }),
            told("stage 'move' stands behind the stages that gather"));
  EXPECT_EQ(loop_message([](Technique& t) {
              t.stages.insert(t.stages.begin() + 1, Stage{"between", StageKind::kCpu, {}});
            }),
            told("stage 'between' stands between the parts of an iteration"));
  EXPECT_EQ(loop_message([](Technique& t) { t.stages[0].loop_part = 7; }),
            told("stage 'move': unknown loop_part\n  found:    7\n  expected: 0 to 2"));
}

TEST(Descriptor, OfALoopWithoutIterationsIsRefused) {
  static const heddle_override override{sizeof(heddle_override), 0, "depth", "visibility"};
  static const heddle_loop loop{sizeof(heddle_loop), 1, &override, "depth"};
  EXPECT_EQ(message([](Example& e) { e.technique.loop = &loop; }), told("a loop without the function iterations"));
}

TEST(Descriptor, WithoutFormatIsRightIfDeclareSetsIt) {
  EXPECT_EQ(message([](Example& e) {
              e.ports[1].format = 0;
              e.ports[2].byte_size = 0;
              e.technique.declare = [](heddle_pass*, const heddle_pass_host*) -> heddle_status { return HEDDLE_OK; };
            }),
            "no error");
}

TEST(Descriptor, WithAParameterThatContradictsItselfIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.parameters[0].minimum = 0.5; }),
            told("parameter 'radius': default_value is out of range\n  found:    0.1\n  expected: 0.5 to inf"));
  EXPECT_EQ(message([](Example& e) { e.parameters[0].default_value[0] = NAN; }),
            told("parameter 'radius': default_value is not finite\n  found:    nan"));
  EXPECT_EQ(message([](Example& e) { e.parameters[0].minimum = INFINITY, e.parameters[0].maximum = 1; }),
            told("parameter 'radius': the range is empty\n  found:    inf to 1\n"
                 "  expected: minimum <= maximum; equal: unbounded\n") +
                told("parameter 'radius': default_value is out of range\n  found:    0.1\n  expected: inf to 1"));
  EXPECT_EQ(message([](Example& e) { e.parameters[2].default_value[0] = 1.5; }),
            told("parameter 'samples': default_value is no integer\n  found:    1.5"));
  EXPECT_EQ(message([](Example& e) { e.parameters[1].default_value[0] = 2; }),
            told("parameter 'quality': default_value is out of range\n  found:    2\n  expected: 0 to 1"));
  EXPECT_EQ(message([](Example& e) { e.parameters[1].choices = nullptr; }).substr(0, kWho.size() + 42),
            told("parameter 'quality': a choice without choi"));
  EXPECT_EQ(message([](Example& e) { e.choices[1] = "low"; }),
            told("parameter 'quality': a choice is empty or stands twice\n  found:    \"low\""));
  EXPECT_EQ(message([](Example& e) { e.parameters[0].choices = e.choices; }),
            told("parameter 'radius': choices belong to HEDDLE_TYPE_CHOICE"));
  EXPECT_EQ(message([](Example& e) { e.ladder[2] = 8; }),
            told("parameter 'samples': ladder is out of range\n  found:    8\n  expected: 1 to 4"));
  EXPECT_EQ(message([](Example& e) { e.parameters[2].ladder_count = 1; }),
            told("parameter 'samples': a knob needs one component and a ladder of two values or more\n"
                 "  found:    1 components, 1 values"));
  EXPECT_EQ(message([](Example& e) { e.parameters[2].flags = 0; }),
            told("parameter 'samples': a ladder belongs to HEDDLE_PARAMETER_KNOB"));
  EXPECT_EQ(message([](Example& e) {
              e.parameters[0].type = HEDDLE_TYPE_COLOR;
              e.parameters[0].flags = HEDDLE_PARAMETER_CONSTANT;
            }),
            told("parameter 'radius': HEDDLE_PARAMETER_CONSTANT needs one component"));
}

TEST(Descriptor, MayHaveALadderInAnyOrderAndUnboundedParameters) {
  EXPECT_EQ(message([](Example& e) {
              e.ladder[0] = 4;
              e.ladder[2] = 1;
              e.parameters[0].maximum = 0;  // equal bounds: unbounded
              e.parameters[0].default_value[0] = -1e9;
            }),
            "no error");
}

TEST(Descriptor, WithAnAccessThatDoesNotFitIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.accesses[2].port = "tabel"; }),
            told("stage 'fill': access to 'tabel': there is no such port\n"
                 "  expected: one of depth, visibility, table\n") +
                told("port 'table': no stage and no function touches this output"));
  EXPECT_EQ(message([](Example& e) { e.accesses[1].access = HEDDLE_ACCESS_DRAW; }),
            told("stage 'draw': access to 'visibility': the access does not fit the port's type\n"
                 "  found:    HEDDLE_ACCESS 9"));
  EXPECT_EQ(message([](Example& e) { e.accesses[0].access = HEDDLE_ACCESS_STORAGE_WRITE; }),
            told("stage 'draw': access to 'depth': an input is written\n") +
                told("function 'sky': access to 'depth': an input is written"));
  EXPECT_EQ(message([](Example& e) { e.accesses[2].access = HEDDLE_ACCESS_STORAGE_WRITE; }),
            told("stage 'fill': access to 'table' is not of its kind\n  found:    HEDDLE_ACCESS 3\n"
                 "  expected: HOST_READ, HOST_WRITE, VALUE or BATCHES in a cpu stage"));
  EXPECT_EQ(message([](Example& e) { e.accesses[1].access = HEDDLE_ACCESS_HOST_WRITE; }),
            told("stage 'draw': access to 'visibility' is not of its kind\n  found:    HEDDLE_ACCESS 11\n"
                 "  expected: no HOST_READ and no HOST_WRITE in a gpu stage"));
  EXPECT_EQ(message([](Example& e) { e.accesses[1].clear[3] = NAN; }),
            told("stage 'draw': access to 'visibility': clear is NaN"));
  EXPECT_EQ(message([](Example& e) { e.accesses[1].load = HEDDLE_LOAD_CLEAR_NEW; }),
            told("stage 'draw': access to 'visibility': HEDDLE_LOAD_CLEAR_NEW is for optional inout ports"));
  EXPECT_EQ(message([](Example& e) { e.accesses[1].blend = HEDDLE_BLEND_CONSTANT + 1; }),
            told("stage 'draw': access to 'visibility': unknown blend\n  found:    6\n  expected: 0 to 5\n") +
                told("port 'visibility': no stage and no function touches this output"));
  EXPECT_EQ(message([](Example& e) { e.accesses[2].blend = HEDDLE_BLEND_OVER; }),
            told("stage 'fill': access to 'table': blend belongs to HEDDLE_ACCESS_COLOR"));
  EXPECT_EQ(message([](Example& e) {
              e.accesses[1].port = "depth";
              e.accesses[1].access = HEDDLE_ACCESS_SAMPLED;
              e.technique.port_count = 1;
              e.technique.stage_count = 1;
            }),
            told("stage 'draw': access to 'depth': stands twice"));
}

TEST(Descriptor, WithAShaderOfAnUnknownStageIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.shaders[0].stage = "darw"; }),
            told("shader 'draw': there is no such gpu stage\n  found:    \"darw\"\n  expected: one of draw"));
  EXPECT_EQ(message([](Example& e) { e.shaders[0].stage = "fill"; }),
            told("shader 'draw': there is no such gpu stage\n  found:    \"fill\"\n  expected: one of draw"));
}

TEST(Descriptor, WithAShaderFileOfAnotherKindIsRefused) {
  const std::string expected = "\n  expected: <what>.frag.glsl in the technique's folder";
  for (const char* file : {"", "draw.comp.glsl", ".frag.glsl", "../draw.frag.glsl", "/draw.frag.glsl"}) {
    EXPECT_EQ(
        message([&](Example& e) { e.shaders[0].file = file; }),
        told(std::string("shader 'draw': file is no shader of its kind\n  found:    \"") + file + "\"") + expected);
  }
  EXPECT_EQ(message([](Example& e) {
              e.shaders[0].kind = HEDDLE_SHADER_SURFACES;  // depth only
              e.shaders[0].file = nullptr;
            }),
            "no error");
  EXPECT_EQ(message([](Example& e) { e.functions[0].file = "sky.txt"; }),
            told("function 'sky': file is no shader text\n  found:    \"sky.txt\"\n"
                 "  expected: <what>.glsl in the technique's folder"));
  EXPECT_EQ(message([](Example& e) { e.shaders[0].calls = "sky sky"; }),
            told("shader 'draw': calls holds no role, or one twice\n  found:    \"sky\""));
}

TEST(Descriptor, OfAnOutputThatNobodyTouchesIsRefused) {
  EXPECT_EQ(message([](Example& e) { e.technique.stage_count = 1; }),
            told("port 'table': no stage and no function touches this output"));
}

TEST(Plugin, ThatIsNullOrSpeaksAnotherAbiIsRefused) {
  const auto text = [](const heddle_plugin* plugin, heddle_status status) -> std::string {
    try {
      from_plugin(plugin, "t.so");
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), status);
      return error.what();
    }
    return "no error";
  };
  Example example;
  const heddle_technique* techniques[2]{&example.technique, &example.technique};
  heddle_plugin plugin{sizeof(heddle_plugin), HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR, 1, techniques};
  EXPECT_EQ(text(&plugin, HEDDLE_OK), "no error");
  EXPECT_EQ(text(nullptr, HEDDLE_BUG), "t.so: error: heddle_entry answered NULL\n  expected: a heddle_plugin");
  plugin.technique_count = 2;
  EXPECT_EQ(text(&plugin, HEDDLE_BUG), "t.so: error: two techniques have the id 'ambient_occlusion/test'");
  techniques[1] = nullptr;
  EXPECT_EQ(text(&plugin, HEDDLE_BUG), "t.so: error: techniques[1] is NULL");
  plugin.technique_count = 0;
  EXPECT_EQ(text(&plugin, HEDDLE_BUG), "t.so: error: heddle_plugin has no techniques");
  plugin.abi_minor = 9;
  EXPECT_EQ(text(&plugin, HEDDLE_UNSUPPORTED),
            "t.so: error: this plugin was built for another version of Heddle's interface\n"
            "  found:    ABI 0.9\n  expected: ABI 0.1\n  help:     build the plugin again with this version's headers");
  plugin.struct_size = 4;
  EXPECT_EQ(text(&plugin, HEDDLE_BUG),
            "t.so: error: heddle_plugin: struct_size is too small\n  found:    4\n  expected: 12 bytes or more");
}

}  // namespace
}  // namespace heddle
