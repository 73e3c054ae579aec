// SPDX-License-Identifier: Apache-2.0
// Hand-made techniques -> manifests in a temporary folder (see plugin_folder.hpp).
#include "graph/plugin_folder.hpp"

#include <unistd.h>

#include <fstream>

namespace heddle::graph::test_support {
namespace {

namespace fs = std::filesystem;

Port port(std::string name, PortType type, Direction direction, std::uint32_t flags = 0) {
  Port p;
  p.name = std::move(name);
  p.type = type;
  p.direction = direction;
  p.flags = flags;
  p.help = "for tests";
  return p;
}
Port image_in(std::string name, std::uint32_t flags = 0) {
  return port(std::move(name), PortType::kImage, Direction::kIn, flags);
}
Port value_in(std::string name) {
  return port(std::move(name), PortType::kValue, Direction::kIn);
}
Port surfaces_in(std::string name) {
  return port(std::move(name), PortType::kSurfaces, Direction::kIn);
}
Port image_out(std::string name, VkFormat format, std::uint32_t flags = 0, float scale = 1) {
  Port p = port(std::move(name), PortType::kImage, Direction::kOut, flags);
  p.format = format;
  p.extent_scale = scale;
  return p;
}
Port image_out_sized(std::string name, VkFormat format, std::uint32_t width, std::uint32_t height, std::uint32_t flags,
                     std::uint32_t layers = 1) {
  Port p = image_out(std::move(name), format, flags);
  p.extent_rule = HEDDLE_EXTENT_ABSOLUTE;
  p.width = width;
  p.height = height;
  p.layers = layers;
  return p;
}

Parameter parameter(std::string name, ParameterType type, std::string unit, double minimum, double maximum,
                    double value) {
  Parameter p;
  p.name = std::move(name);
  p.type = type;
  p.unit = std::move(unit);
  p.minimum = minimum;
  p.maximum = maximum;
  p.default_value = {value, value, value};
  p.help = "for tests";
  return p;
}
Parameter choice(std::string name, std::vector<std::string> choices) {
  Parameter p = parameter(std::move(name), ParameterType::kChoice, "1", 0, 0, 0);
  p.choices = std::move(choices);
  return p;
}

Access touch(std::string name, std::uint32_t access, std::uint32_t load = HEDDLE_LOAD_KEEP) {
  return {std::move(name), access, load, {}};
}
Access sampled(std::string name) {
  return touch(std::move(name), HEDDLE_ACCESS_SAMPLED);
}
Access value(std::string name) {
  return touch(std::move(name), HEDDLE_ACCESS_VALUE);
}
Access written(std::string name) {
  return touch(std::move(name), HEDDLE_ACCESS_STORAGE_WRITE);
}

Shader shader(std::string name, ShaderKind kind, std::string stage, std::vector<std::string> calls = {}) {
  Shader s;
  s.file = name + (kind == ShaderKind::kCompute ? ".comp.glsl" : ".frag.glsl");
  s.name = std::move(name);
  s.kind = kind;
  s.stage = std::move(stage);
  s.calls = std::move(calls);
  return s;
}

Technique technique(std::string id) {
  Technique t;
  t.id = std::move(id);
  t.title = "for tests";
  return t;
}

Technique sky_procedural() {
  Technique t = technique("sky/procedural");
  t.ports = {port("lights", PortType::kValue, Direction::kInout),
             image_out_sized("sky_map", VK_FORMAT_R32G32B32A32_SFLOAT, 128, 256, HEDDLE_PORT_KEPT),
             image_out_sized("specular", VK_FORMAT_R32G32B32A32_SFLOAT, 64, 96, HEDDLE_PORT_KEPT, 7)};
  t.parameters = {parameter("sun_elevation", ParameterType::kFloat, "rad", -1.57, 1.57, 0.9),
                  parameter("sun_azimuth", ParameterType::kFloat, "rad", -8, 8, 0.7),
                  parameter("sun", ParameterType::kBool, "1", 0, 0, 1),
                  parameter("ground_albedo", ParameterType::kColor, "1", 0, 1, 0.2)};
  t.stages = {{"sun", StageKind::kCpu, {value("lights")}},
              {"sky_map", StageKind::kGpu, {written("sky_map")}},
              {"filter", StageKind::kGpu, {touch("sky_map", HEDDLE_ACCESS_SAMPLED_LINEAR), written("specular")}}};
  t.shaders = {shader("sky_map", ShaderKind::kCompute, "sky_map"), shader("filter", ShaderKind::kCompute, "filter")};
  t.functions = {{"sky", "sky.glsl", {sampled("sky_map"), sampled("specular")}, {}, false}};
  return t;
}

Technique sky_uniform() {
  Technique t = technique("sky/uniform");  // leaves the lights alone, so it has no such port
  t.parameters = {parameter("radiance", ParameterType::kColor, "cd/m^2", 0, 1e9, 1)};
  t.functions = {{"sky", "uniform.glsl", {}, {}, false}};
  return t;
}

Technique sky_environment_map() {
  Technique t = technique("sky/environment_map");
  t.ports = {value_in("environment"),
             image_out_sized("mean_radiance", VK_FORMAT_R32G32B32A32_SFLOAT, 64, 64, HEDDLE_PORT_KEPT, 6),
             image_out_sized("specular", VK_FORMAT_R32G32B32A32_SFLOAT, 64, 64, HEDDLE_PORT_KEPT, 48)};
  t.stages = {{"load", StageKind::kCpu, {value("environment"), touch("mean_radiance", HEDDLE_ACCESS_HOST_WRITE)}},
              {"filter", StageKind::kGpu, {touch("mean_radiance", HEDDLE_ACCESS_SAMPLED_LINEAR), written("specular")}}};
  t.shaders = {shader("filter", ShaderKind::kCompute, "filter")};
  t.functions = {{"sky", "sky.glsl", {sampled("specular")}, {}, false}};
  t.features = {"environment"};
  return t;
}

Technique mesh_detail() {
  Technique t = technique("mesh_detail/chosen");
  Port surfaces = port("surfaces", PortType::kSurfaces, Direction::kInout);
  surfaces.vertices = "vertices";
  surfaces.indices = "indices";
  t.ports = {surfaces};
  for (const char* name : {"vertices", "indices"}) {
    Port p = port(name, PortType::kBuffer, Direction::kOut, HEDDLE_PORT_KEPT);
    p.byte_size = 64;
    p.glsl = "uint " + p.name + "[];";
    t.ports.push_back(p);
  }
  t.parameters = {choice("show", {"coarse", "fine"})};
  t.stages = {{"choose",
               StageKind::kCpu,
               {touch("vertices", HEDDLE_ACCESS_HOST_WRITE), touch("indices", HEDDLE_ACCESS_HOST_WRITE),
                touch("surfaces", HEDDLE_ACCESS_BATCHES)}}};
  t.features = {"mesh_detail.fine"};
  t.components = {"mesh_detail.fine"};
  return t;
}

Technique subdivision() {
  Technique t = technique("subdivision/catmull_clark");
  Port surfaces = port("surfaces", PortType::kSurfaces, Direction::kInout);
  surfaces.vertices = "vertices";
  surfaces.indices = "indices";
  const auto buffer = [](std::string name, std::uint32_t flags) {
    Port p = port(std::move(name), PortType::kBuffer, Direction::kOut, flags);
    p.byte_size = 4096;
    p.glsl = "uint " + p.name + "[];";
    return p;
  };
  t.ports = {surfaces, buffer("vertices", HEDDLE_PORT_KEPT), buffer("indices", HEDDLE_PORT_KEPT), buffer("points", 0)};
  t.parameters = {parameter("levels", ParameterType::kInt, "1", 1, 6, 2)};
  t.stages = {
      {"pose",
       StageKind::kCpu,
       {touch("points", HEDDLE_ACCESS_HOST_WRITE), touch("indices", HEDDLE_ACCESS_HOST_WRITE)}},
      {"refine",
       StageKind::kGpu,
       {touch("points", HEDDLE_ACCESS_STORAGE_READ), written("vertices"), touch("surfaces", HEDDLE_ACCESS_BATCHES)}}};
  t.shaders = {shader("refine", ShaderKind::kCompute, "refine")};
  t.features = {"subdivision.surface"};
  t.components = {"subdivision.surface"};
  return t;
}

Technique gbuffer_raster() {
  Technique t = technique("gbuffer/raster");
  t.ports = {surfaces_in("surfaces"),
             value_in("camera"),
             image_out("depth", VK_FORMAT_R32_SFLOAT),
             image_out("normal", VK_FORMAT_R16G16_SNORM),
             image_out("normal_geometric", VK_FORMAT_R16G16_SNORM),
             image_out("base_color", VK_FORMAT_R8G8B8A8_SRGB),
             image_out("material", VK_FORMAT_R8G8B8A8_UNORM),
             image_out("emissive", VK_FORMAT_R16G16B16A16_SFLOAT),
             image_out("motion", VK_FORMAT_R16G16_SFLOAT),
             image_out("depth_buffer", VK_FORMAT_D32_SFLOAT)};
  std::vector<Access> accesses{touch("surfaces", HEDDLE_ACCESS_DRAW), value("camera")};
  for (const char* name : {"depth", "normal", "normal_geometric", "base_color", "material", "emissive", "motion"})
    accesses.push_back(touch(name, HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR));
  accesses.push_back(touch("depth_buffer", HEDDLE_ACCESS_DEPTH, HEDDLE_LOAD_CLEAR));
  t.stages = {{"draw", StageKind::kGpu, accesses}};
  t.shaders = {shader("surface", ShaderKind::kSurfaces, "draw", {"texture_source"})};
  t.parameters = {choice("precision", {"packed", "float32"})};
  return t;
}

Technique gtao() {
  Technique t = technique("ambient_occlusion/gtao");
  t.ports = {image_in("depth"), image_in("normal_geometric"), value_in("camera"),
             image_out("noisy", VK_FORMAT_R8_UNORM), image_out("visibility", VK_FORMAT_R8_UNORM)};
  t.parameters = {parameter("radius", ParameterType::kFloat, "m", 0.01, 100, 0.5),
                  choice("falloff", {"none", "linear"}), parameter("directions", ParameterType::kInt, "1", 1, 64, 2),
                  parameter("denoise", ParameterType::kBool, "1", 0, 0, 1)};
  t.stages = {
      {"horizon", StageKind::kGpu, {sampled("depth"), sampled("normal_geometric"), value("camera"), written("noisy")}},
      {"denoise", StageKind::kGpu, {sampled("depth"), sampled("noisy"), written("visibility")}}};
  t.shaders = {shader("horizon", ShaderKind::kCompute, "horizon"), shader("denoise", ShaderKind::kCompute, "denoise")};
  return t;
}

Technique ray_traced() {
  Technique t = technique("ambient_occlusion/ray_traced");
  t.is_reference = true;
  t.ports = {image_in("depth"), image_in("normal_geometric"), value_in("camera"), surfaces_in("surfaces"),
             image_out("visibility", VK_FORMAT_R32_SFLOAT)};
  t.parameters = {parameter("radius", ParameterType::kFloat, "m", 0.01, 100, 0.5),
                  choice("falloff", {"none", "linear"}), parameter("samples", ParameterType::kInt, "1", 1, 65536, 64)};
  t.stages = {
      {"trace",
       StageKind::kCpu,
       {touch("depth", HEDDLE_ACCESS_HOST_READ), touch("normal_geometric", HEDDLE_ACCESS_HOST_READ), value("camera"),
        touch("surfaces", HEDDLE_ACCESS_HOST_READ), touch("visibility", HEDDLE_ACCESS_HOST_WRITE)}}};
  return t;
}

Technique baked() {
  Technique t = technique("ambient_occlusion/baked");
  Port values = port("baked_values", PortType::kBuffer, Direction::kOut, HEDDLE_PORT_KEPT);
  values.byte_size = 4096;
  values.glsl = "uvec2 baked_values[];";
  t.ports = {surfaces_in("surfaces"),
             value_in("camera"),
             image_in("depth_buffer"),
             port("occlusion", PortType::kArtifact, Direction::kIn),
             values,
             image_out("visibility", VK_FORMAT_R32_SFLOAT)};
  t.stages = {
      {"upload", StageKind::kCpu, {value("occlusion"), touch("baked_values", HEDDLE_ACCESS_HOST_WRITE)}},
      {"look",
       StageKind::kGpu,
       {touch("surfaces", HEDDLE_ACCESS_DRAW), value("camera"), touch("baked_values", HEDDLE_ACCESS_STORAGE_READ),
        touch("visibility", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_CLEAR), touch("depth_buffer", HEDDLE_ACCESS_DEPTH_READ)}}};
  t.shaders = {shader("baked", ShaderKind::kSurfaces, "look")};
  return t;
}

Technique bake_depth_maps() {
  Technique t = technique("bake_visibility/depth_maps");
  Port sums = port("sums", PortType::kBuffer, Direction::kOut);
  sums.byte_size = 4096;
  sums.glsl = "vec4 sums[];";
  t.ports = {surfaces_in("surfaces"), port("occlusion", PortType::kArtifact, Direction::kOut),
             port("report", PortType::kReport, Direction::kOut), sums,
             image_out_sized("depth_maps", VK_FORMAT_D32_SFLOAT, 256, 256, 0, 8)};
  t.parameters = {parameter("directions", ParameterType::kInt, "1", 1, 16384, 512),
                  parameter("spacing", ParameterType::kFloat, "m", 1e-4, 1e4, 0.25)};
  t.stages = {{"clear", StageKind::kGpu, {written("sums")}},
              {"draw",
               StageKind::kGpu,
               {touch("surfaces", HEDDLE_ACCESS_DRAW), touch("depth_maps", HEDDLE_ACCESS_DEPTH, HEDDLE_LOAD_CLEAR)}},
              {"sample", StageKind::kGpu, {sampled("depth_maps"), touch("sums", HEDDLE_ACCESS_STORAGE_READ_WRITE)}},
              {"keep", StageKind::kCpu, {touch("sums", HEDDLE_ACCESS_HOST_READ), value("occlusion"), value("report")}}};
  Shader depth_only = shader("depth", ShaderKind::kSurfaces, "draw");
  depth_only.file.clear();
  t.shaders = {shader("clear", ShaderKind::kCompute, "clear"), depth_only,
               shader("sample", ShaderKind::kCompute, "sample")};
  return t;
}

Technique shadow_map() {
  Technique t = technique("shadow/shadow_map");
  Port views = port("shadow_views", PortType::kValue, Direction::kOut);
  views.byte_size = 4096;
  views.glsl = "vec4 shadow_views[];";
  t.ports = {value_in("lights"), surfaces_in("surfaces"), value_in("camera"),
             image_out_sized("atlas", VK_FORMAT_D32_SFLOAT, 1024, 1024, 0, 16), views};
  t.parameters = {parameter("resolution", ParameterType::kInt, "px", 64, 8192, 1024)};
  t.stages = {{"views", StageKind::kCpu, {value("lights"), value("camera"), value("shadow_views")}},
              {"draw",
               StageKind::kGpu,
               {touch("surfaces", HEDDLE_ACCESS_DRAW), touch("atlas", HEDDLE_ACCESS_DEPTH, HEDDLE_LOAD_CLEAR)}}};
  Shader depth_only = shader("depth", ShaderKind::kSurfaces, "draw");
  depth_only.file.clear();
  t.shaders = {depth_only};
  t.functions = {{"shadow",
                  "shadow_map.glsl",
                  {touch("atlas", HEDDLE_ACCESS_SAMPLED_COMPARE), value("shadow_views"), value("lights")},
                  {},
                  false}};
  return t;
}

Technique ray_marched_screen() {
  Technique t = technique("shadow/ray_marched_screen");
  t.ports = {value_in("lights"), value_in("camera"), image_in("depth", HEDDLE_PORT_OPTIONAL)};
  t.parameters = {parameter("distance", ParameterType::kFloat, "m", 1e-6, 1e4, 0.3)};
  t.functions = {{"shadow", "contact.glsl", {value("lights"), value("camera"), sampled("depth")}, {}, false}};
  return t;
}

Technique ggx() {
  Technique t = technique("surface_material/ggx");
  t.ports = {image_out_sized("albedo", VK_FORMAT_R32G32_SFLOAT, 32, 32, HEDDLE_PORT_KEPT)};
  t.parameters = {parameter("multiple_scattering", ParameterType::kBool, "1", 0, 0, 1)};
  t.stages = {{"tables", StageKind::kCpu, {touch("albedo", HEDDLE_ACCESS_HOST_WRITE)}}};
  t.functions = {
      {"surface_material", "surface_material.glsl", {touch("albedo", HEDDLE_ACCESS_SAMPLED_LINEAR)}, {}, true}};
  return t;
}

Technique tiled() {
  Technique t = technique("light_assignment/tiled");
  Port tiling = port("tiling", PortType::kValue, Direction::kOut);
  tiling.byte_size = 32;
  tiling.glsl = "uvec4 tiling[2];";
  Port lists = port("tile_lists", PortType::kBuffer, Direction::kOut);
  lists.byte_size = 4096;
  lists.glsl = "uint tile_lists[];";
  t.ports = {value_in("lights"), value_in("camera"), image_in("depth", HEDDLE_PORT_OPTIONAL), tiling, lists};
  t.stages = {
      {"plan", StageKind::kCpu, {value("lights"), value("camera"), value("tiling")}},
      {"range", StageKind::kGpu, {sampled("depth"), value("camera"), value("tiling"), written("tile_lists")}},
      {"assign",
       StageKind::kGpu,
       {value("lights"), value("camera"), value("tiling"), touch("tile_lists", HEDDLE_ACCESS_STORAGE_READ_WRITE)}}};
  t.shaders = {shader("range", ShaderKind::kCompute, "range"), shader("assign", ShaderKind::kCompute, "assign")};
  t.functions = {{"light_assignment",
                  "tiled.glsl",
                  {value("lights"), value("camera"), value("tiling"), touch("tile_lists", HEDDLE_ACCESS_STORAGE_READ)},
                  {},
                  false}};
  t.features = {"lights"};
  return t;
}

Technique store_tiled() {
  Technique t = technique("texture_store/tiled");
  t.ports = {port("store", PortType::kArtifact, Direction::kOut), port("report", PortType::kReport, Direction::kOut)};
  t.stages = {{"make", StageKind::kCpu, {value("store"), value("report")}}};
  return t;
}

/// A function that writes: whoever calls it appends to `requests`, which a stage reads two frames later.
Technique virtual_texture() {
  Technique t = technique("texture_source/virtual");
  Port state = port("virtual_state", PortType::kValue, Direction::kOut);
  state.byte_size = 48;
  state.glsl = "uvec4 virtual_layout; uvec4 virtual_query; vec4 virtual_time;";
  Port table = port("tile_table", PortType::kBuffer, Direction::kOut, HEDDLE_PORT_KEPT);
  table.byte_size = 4096;
  table.glsl = "uint tile_table[];";
  Port requests = port("requests", PortType::kBuffer, Direction::kOut, HEDDLE_PORT_LIST);
  requests.capacity = 4096;
  requests.element_bytes = 8;
  requests.glsl = "uvec2 requests[];";
  t.ports = {port("store", PortType::kArtifact, Direction::kIn, HEDDLE_PORT_OPTIONAL), state, table, requests,
             image_out_sized("tile_cache", VK_FORMAT_R8G8B8A8_SRGB, 64, 1, HEDDLE_PORT_KEPT)};
  t.stages = {{"manage",
               StageKind::kCpu,
               {touch("requests", HEDDLE_ACCESS_HOST_READ), value("store"), value("virtual_state")},
               2},
              {"upload", StageKind::kGpu, {touch("tile_cache", HEDDLE_ACCESS_TRANSFER_WRITE)}},
              {"publish", StageKind::kGpu, {written("tile_table")}}};
  t.shaders = {shader("fill", ShaderKind::kCompute, "publish")};
  t.functions = {{"texture_source",
                  "virtual.glsl",
                  {value("virtual_state"), touch("tile_table", HEDDLE_ACCESS_STORAGE_READ),
                   touch("tile_cache", HEDDLE_ACCESS_SAMPLED_LINEAR), touch("requests", HEDDLE_ACCESS_APPEND)},
                  {},
                  false}};
  t.features = {"texture_source.virtual"};
  t.components = {"texture_source.virtual"};
  return t;
}

Technique heat_map() {
  Technique t = technique("light_count/heat_map");
  t.ports = {image_in("depth"), value_in("camera"), value_in("lights"), image_out("count", VK_FORMAT_R32G32_SFLOAT),
             image_out("color", VK_FORMAT_R8G8B8A8_UNORM)};
  t.stages = {{"count",
               StageKind::kGpu,
               {sampled("depth"), value("camera"), value("lights"), written("count"), written("color")}}};
  t.shaders = {shader("count", ShaderKind::kCompute, "count", {"light_assignment"})};
  return t;
}

Technique path_tracer() {
  Technique t = technique("ray_tracing/path_tracer");
  t.ports = {surfaces_in("surfaces"), value_in("camera"), value_in("lights"),
             image_out_sized("sky_map", VK_FORMAT_R32G32B32A32_SFLOAT, 64, 32, HEDDLE_PORT_KEPT),
             image_out("radiance", VK_FORMAT_R32G32B32A32_SFLOAT, HEDDLE_PORT_KEPT)};
  t.parameters = {choice("emission", {"lights", "seen"})};
  t.stages = {{"sky", StageKind::kGpu, {written("sky_map")}},
              {"trace",
               StageKind::kCpu,
               {touch("sky_map", HEDDLE_ACCESS_HOST_READ), touch("surfaces", HEDDLE_ACCESS_HOST_READ), value("camera"),
                value("lights"), touch("radiance", HEDDLE_ACCESS_HOST_WRITE)}}};
  for (const char* split :
       {"variance", "emission", "direct", "indirect_diffuse", "indirect_specular", "occlusion", "shadow"}) {
    t.ports.push_back(image_out(split, VK_FORMAT_R32G32B32A32_SFLOAT, HEDDLE_PORT_KEPT));
    t.stages[1].accesses.push_back(touch(split, HEDDLE_ACCESS_HOST_WRITE));
  }
  t.shaders = {shader("sky", ShaderKind::kCompute, "sky", {"sky", "surface_material"})};
  return t;
}

Technique deferred() {
  Technique t = technique("lighting/deferred");
  std::vector<Access> accesses;
  for (const char* name : {"depth", "normal", "normal_geometric", "base_color", "material"}) {
    t.ports.push_back(image_in(name));
    accesses.push_back(sampled(name));
  }
  for (const char* name : {"emissive", "visibility"}) {
    t.ports.push_back(image_in(name, HEDDLE_PORT_OPTIONAL));
    accesses.push_back(sampled(name));
  }
  for (const char* name : {"camera", "lights"}) {
    t.ports.push_back(value_in(name));
    accesses.push_back(value(name));
  }
  t.ports.push_back(image_out("radiance", VK_FORMAT_R16G16B16A16_SFLOAT));
  accesses.push_back(touch("radiance", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_DONT_CARE));
  t.stages = {{"light", StageKind::kGpu, accesses}};
  t.shaders = {
      shader("light", ShaderKind::kFullscreen, "light", {"shadow", "surface_material", "sky", "light_assignment"})};
  t.parameters = {choice("precision", {"float16", "float32"})};
  return t;
}

Technique supersampled() {
  Technique t = technique("antialiasing/supersampled");
  Port camera = port("sample_camera", PortType::kValue, Direction::kOut);
  camera.byte_size = sizeof(HeddleView);
  camera.glsl = "HeddleView sample_camera;";
  t.ports = {port("radiance", PortType::kImage, Direction::kInout), value_in("camera"), camera,
             image_out("mean", VK_FORMAT_R32G32B32A32_SFLOAT, HEDDLE_PORT_KEPT)};
  t.parameters = {parameter("samples", ParameterType::kInt, "1", 1, 65536, 16)};
  t.stages = {
      {"move", StageKind::kCpu, {value("camera"), value("sample_camera")}, 0, HEDDLE_LOOP_BEFORE},
      {"accumulate",
       StageKind::kGpu,
       {sampled("radiance"), touch("mean", HEDDLE_ACCESS_STORAGE_READ_WRITE)},
       0,
       HEDDLE_LOOP_AFTER},
      {"resolve", StageKind::kGpu, {sampled("mean"), touch("radiance", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_DONT_CARE)}}};
  t.shaders = {shader("accumulate", ShaderKind::kCompute, "accumulate"),
               shader("resolve", ShaderKind::kFullscreen, "resolve")};
  t.loop = Loop{{{"camera", "sample_camera"}}, {"radiance"}};
  return t;
}

Technique sorted() {
  Technique t = technique("transparency/sorted");
  t.ports = {surfaces_in("surfaces"), value_in("camera"), value_in("lights"), image_in("depth_buffer"),
             port("radiance", PortType::kImage, Direction::kInout)};
  Access blended = touch("radiance", HEDDLE_ACCESS_COLOR);
  blended.blend = HEDDLE_BLEND_TINT;
  t.stages = {{"draw",
               StageKind::kGpu,
               {touch("surfaces", HEDDLE_ACCESS_DRAW), value("camera"), value("lights"), blended,
                touch("depth_buffer", HEDDLE_ACCESS_DEPTH_READ)}}};
  t.shaders = {shader("blend", ShaderKind::kSurfaces, "draw",
                      {"shadow", "surface_material", "sky", "light_assignment", "texture_source"})};
  t.features = {"blended"};
  return t;
}

Technique display() {
  Technique t = technique("display/linear");
  t.ports = {image_in("radiance"), image_out("color", VK_FORMAT_R8G8B8A8_UNORM)};
  t.parameters = {parameter("exposure", ParameterType::kFloat, "EV100", -16, 24, 15)};
  t.stages = {
      {"encode", StageKind::kGpu, {sampled("radiance"), touch("color", HEDDLE_ACCESS_COLOR, HEDDLE_LOAD_DONT_CARE)}}};
  t.shaders = {shader("encode", ShaderKind::kFullscreen, "encode")};
  return t;
}

/// A role that changes an image in place and takes names, for what the shipped roles do not show.
constexpr const char* kPaintRole = R"(role = "paint"
revision = 1
title = "Changes radiance in place, for tests"
[[port]]
name = "radiance"
direction = "inout"
type = "image"
neutral = [0, 0, 0, 0]
help = "what is changed"
)";

Technique paint_dots() {
  Technique t = technique("paint/dots");
  t.ports = {port("radiance", PortType::kImage, Direction::kInout)};
  t.parameters = {
      parameter("count", ParameterType::kInt, "1", 0, 100, 3), parameter("lights", ParameterType::kNames, "", 0, 0, 0),
      parameter("offset", ParameterType::kFloat3, "m", -1, 1, 0),
      parameter("free", ParameterType::kFloat, "s", 0, 0, 0), parameter("label", ParameterType::kText, "", 0, 0, 0)};
  t.stages = {{"paint", StageKind::kGpu, {touch("radiance", HEDDLE_ACCESS_STORAGE_READ_WRITE)}}};
  t.shaders = {shader("paint", ShaderKind::kCompute, "paint")};
  return t;
}

void write(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
}

}  // namespace

PluginFolder::PluginFolder() {
  std::string pattern = (fs::temp_directory_path() / "heddle-graph-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder");
  folder_ = pattern;
  for (const Technique& t : {sky_procedural(),
                             sky_uniform(),
                             sky_environment_map(),
                             mesh_detail(),
                             subdivision(),
                             gbuffer_raster(),
                             gtao(),
                             ray_traced(),
                             baked(),
                             bake_depth_maps(),
                             shadow_map(),
                             ray_marched_screen(),
                             ggx(),
                             tiled(),
                             virtual_texture(),
                             store_tiled(),
                             heat_map(),
                             deferred(),
                             path_tracer(),
                             supersampled(),
                             sorted(),
                             display(),
                             paint_dots()}) {
    const fs::path role = fs::path(HEDDLE_SOURCE_DIR) / "plugins" / t.role_name() / "role.toml";
    const fs::path copy = folder_ / t.role_name() / "role.toml";
    fs::create_directories(copy.parent_path());
    if (t.role_name() == "paint") {
      add_role("paint", kPaintRole);
    } else if (!fs::exists(copy)) {
      fs::copy_file(role, copy);
    }
    add(t);
  }
}

PluginFolder::~PluginFolder() {
  std::error_code error;
  fs::remove_all(folder_, error);
}

void PluginFolder::add_role(const std::string& name, const std::string& text) {
  write(folder_ / name / "role.toml", text);
}

void PluginFolder::add(const Technique& technique) {
  Manifest manifest;
  const std::string name(technique.name());
  manifest.library = name + ".so";
  manifest.abi_major = HEDDLE_ABI_MAJOR;
  manifest.abi_minor = HEDDLE_ABI_MINOR;
  manifest.techniques = {technique};
  write(folder_ / technique.role_name() / name / (name + ".manifest.json"), to_json(manifest));
}

void PluginFolder::leave_out(const std::string& id, const std::string& reason) {
  write(folder_ / id / "left_out.txt", reason + "\n");
}

const Registry& shared_registry() {
  static const PluginFolder kFolder;
  static const Registry kRegistry = kFolder.registry();
  return kRegistry;
}

ResolvedGraph resolve_text(std::string_view text, const Registry& registry) {
  return resolve(parse(text, "test.toml"), registry);
}

}  // namespace heddle::graph::test_support
