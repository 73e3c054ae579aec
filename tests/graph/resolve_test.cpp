// SPDX-License-Identifier: Apache-2.0
// Names -> resources, providers and parameters. What is refused, with whole messages: errors_test.cpp.
#include <gmock/gmock.h>

#include "graph/plugin_folder.hpp"
#include "graph/resolve.hpp"

namespace heddle::graph {
namespace {

using test_support::kSmallGraph;
using test_support::message_of;
using test_support::resolve_text;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Pass& find(const ResolvedGraph& graph, std::string_view name) {
  for (const Pass& pass : graph.passes)
    if (pass.name == name) return pass;
  throw std::runtime_error("no such pass");
}

std::string bound(const ResolvedGraph& graph, std::string_view pass, std::string_view port) {
  const auto& ports = find(graph, pass).ports;
  const auto found = ports.find(port);
  return found == ports.end() ? "absent" : graph.resources[found->second].name;
}

std::vector<std::string> providers(const ResolvedGraph& graph, std::string_view pass, std::string_view role) {
  std::vector<std::string> names;
  for (const FunctionBinding& binding : find(graph, pass).functions)
    if (binding.role == role)
      for (const PassIndex provider : binding.providers) names.push_back(graph.passes[provider].name);
  return names;
}

ResolvedGraph with(std::string_view more) {
  return resolve_text(std::string(kSmallGraph) + std::string(more));
}

ResolvedGraph with_settings(std::initializer_list<const char*> settings, std::string_view text = kSmallGraph) {
  WrittenGraph written = parse(text, "test.toml");
  for (const char* setting : settings) apply_setting(written, setting);
  return resolve(written, test_support::shared_registry());
}

TEST(Resolve, WarnsOfNumbersInAnotherUnit) {
  EXPECT_THAT(with_settings({}).warnings, IsEmpty());
  EXPECT_EQ(to_text(with_settings({"ao.inputs.depth=gbuffer.normal"}).warnings),
            "--set:1:17: warning: pass 'ao': input 'depth' is in m, but 'gbuffer.normal' is without unit\n"
            "  found:    inputs.depth = \"gbuffer.normal\"\n"
            "  expected: a port in m\n"
            "  help:     'gbuffer.depth' is one");
  EXPECT_THAT(with_settings({"lighting.inputs.material=gbuffer.normal"}).warnings, IsEmpty())
      << "the role says no unit";
}

TEST(Resolve, RemembersWhereParametersComeFrom) {
  const ResolvedGraph graph = with_settings({"params.near=0.25", "ao.params.radius=$near"});
  const Pass& ao = find(graph, "ao");
  std::size_t given = 0;
  for (std::size_t i = 0; i < ao.parameters.size(); ++i) {
    if (!ao.origins[i].where) continue;
    ++given;
    EXPECT_EQ(ao.entry.technique->parameters[i].name, "radius");
    EXPECT_EQ(ao.origins[i].preset, "near");
    EXPECT_EQ(ao.origins[i].preset_where.column, 13U);
  }
  EXPECT_EQ(given, 1U);
}

constexpr std::string_view kShadows = R"(output = "lighting.radiance"
[[pass]]
role = "sky"
technique = "procedural"
[[pass]]
role = "gbuffer"
technique = "raster"
[[pass]]
role = "shadow"
technique = "shadow_map"
[[pass]]
name = "contact"
role = "shadow"
technique = "ray_marched_screen"
[[pass]]
name = "material"
role = "surface_material"
technique = "ggx"
[[pass]]
role = "lighting"
technique = "deferred"
)";

TEST(Resolve, BindsAnUnboundInputToTheLastProducerAbove) {
  const ResolvedGraph graph = resolve_text(kSmallGraph);
  EXPECT_EQ(bound(graph, "ao", "depth"), "gbuffer.depth");
  EXPECT_EQ(bound(graph, "lighting", "visibility"), "ao.visibility");
  EXPECT_EQ(bound(graph, "lighting", "lights"), "scene.lights");
  EXPECT_EQ(bound(graph, "gbuffer", "surfaces"), "scene.surfaces");
  EXPECT_EQ(graph.resources[graph.output].name, "display.color");
  EXPECT_EQ(graph.width, 1280U);
  EXPECT_EQ(graph.height, 720U);
}

TEST(Resolve, DoesNotHandOnATechniquesOwnOutputs) {
  // gtao has an image 'noisy' of its own; the role of no other pass may catch it by name.
  test_support::PluginFolder folder;
  folder.add_role(
      "sink",
      "role = \"sink\"\nrevision = 1\ntitle = \"t\"\n[[port]]\nname = \"noisy\"\ndirection = \"in\"\ntype = \"image\"\n"
      "optional = true\nhelp = \"h\"\n[[port]]\nname = \"result\"\ndirection = \"out\"\ntype = \"image\"\nhelp = "
      "\"h\"\n");
  Technique sink;
  sink.id = "sink/all";
  sink.title = "t";
  Port in;
  in.name = "noisy";
  in.flags = HEDDLE_PORT_OPTIONAL;
  Port out;
  out.name = "result";
  out.direction = Direction::kOut;
  out.format = VK_FORMAT_R8_UNORM;
  sink.ports = {in, out};
  sink.stages = {{"main",
                  StageKind::kGpu,
                  {{"noisy", HEDDLE_ACCESS_SAMPLED, 0, {}}, {"result", HEDDLE_ACCESS_STORAGE_WRITE, 0, {}}}}};
  folder.add(sink);
  const Registry registry = folder.registry();
  const std::string text = std::string(kSmallGraph) + "[[pass]]\nrole = \"sink\"\ntechnique = \"all\"\n";
  EXPECT_EQ(bound(resolve_text(text, registry), "sink", "noisy"), "absent");
  EXPECT_EQ(bound(resolve_text(text + "inputs.noisy = \"ao.noisy\"\n", registry), "sink", "noisy"), "ao.noisy");
}

TEST(Resolve, LetsAnInputPointBelow) {
  const ResolvedGraph graph = resolve_text(R"(output = "display.color"
[[pass]]
role = "display"
technique = "linear"
inputs.radiance = "lighting.radiance"
[[pass]]
role = "gbuffer"
technique = "raster"
[[pass]]
role = "lighting"
technique = "deferred"
)");
  EXPECT_EQ(bound(graph, "display", "radiance"), "lighting.radiance");
  const Order sequence = order(graph);
  EXPECT_EQ(sequence.stages.back().pass, 0U);
}

TEST(Resolve, LeavesOutTechniqueNoneAndItsReadersAreNeutral) {
  for (const char* setting : {"ao.technique=none", "ao.enabled=false"}) {
    const ResolvedGraph graph = with_settings({setting});
    EXPECT_EQ(graph.passes.size(), 3U);
    EXPECT_EQ(bound(graph, "lighting", "visibility"), "absent");
    ASSERT_EQ(graph.notes.size(), 1U);
    EXPECT_THAT(graph.notes[0], HasSubstr("pass 'ao': "));
  }
  const ResolvedGraph named = with_settings({"lighting.inputs.visibility=ao.visibility", "ao.technique=none"});
  EXPECT_EQ(bound(named, "lighting", "visibility"), "absent");
  EXPECT_EQ(bound(with_settings({"lighting.inputs.visibility=none"}), "lighting", "visibility"), "absent");
}

TEST(Resolve, MakesANewVersionOfWhatIsChanged) {
  const ResolvedGraph graph = resolve_text(kShadows);
  EXPECT_EQ(bound(graph, "lighting", "lights"), "sky.lights");
  EXPECT_EQ(bound(graph, "sky", "lights"), "sky.lights");
  EXPECT_EQ(graph.resources[find(graph, "sky").inout_sources.at("lights")].name, "scene.lights");
  EXPECT_EQ(graph.resources[find_resource(graph, "sky.lights")].previous_version, find_resource(graph, "scene.lights"));
}

TEST(Resolve, PassesOnWhatALeftOutPassWouldHaveChanged) {
  const ResolvedGraph graph = with_settings({"lighting.inputs.lights=sky.lights", "sky.technique=none"}, kShadows);
  EXPECT_EQ(bound(graph, "lighting", "lights"), "scene.lights");
  EXPECT_THAT(providers(graph, "lighting", "sky"), IsEmpty());
  // The same of a technique that leaves its role's inout port out.
  const ResolvedGraph uniform = with_settings({"lighting.inputs.lights=sky.lights", "sky.technique=uniform"}, kShadows);
  EXPECT_EQ(bound(uniform, "lighting", "lights"), "scene.lights");
  EXPECT_THAT(providers(uniform, "lighting", "sky"), ElementsAre("sky"));
}

TEST(Resolve, ChangesInPlaceInTheOrderOfTheFile) {
  const ResolvedGraph graph = with(
      "[[pass]]\nname = \"one\"\nrole = \"paint\"\ntechnique = \"dots\"\n[[pass]]\nname = \"two\"\nrole = "
      "\"paint\"\ntechnique = \"dots\"\n");
  const ResourceIndex two = find_resource(graph, "two.radiance");
  EXPECT_EQ(graph.resources[graph.resources[two].previous_version].name, "one.radiance");
  EXPECT_EQ(graph.resources[first_version(graph, two)].name, "lighting.radiance");
  EXPECT_EQ(graph.resources[two].format, VK_FORMAT_R16G16B16A16_SFLOAT);
  EXPECT_EQ(graph.resources[two].width, 1280U);
  EXPECT_EQ(bound(graph, "display", "radiance"), "lighting.radiance");  // it stands above
}

TEST(Resolve, JoinsEveryProviderAbove) {
  const ResolvedGraph graph = resolve_text(kShadows);
  EXPECT_THAT(providers(graph, "lighting", "shadow"), ElementsAre("shadow", "contact"));
  EXPECT_THAT(providers(graph, "lighting", "sky"), ElementsAre("sky"));
  EXPECT_THAT(providers(graph, "lighting", "surface_material"), ElementsAre("material"));
  EXPECT_EQ(find(graph, "lighting").functions[0].join, Join::kProduct);
}

TEST(Resolve, TakesTheProvidersThatAreNamed) {
  EXPECT_THAT(providers(with_settings({"lighting.functions.shadow=['contact']"}, kShadows), "lighting", "shadow"),
              ElementsAre("contact"));
  EXPECT_THAT(providers(with_settings({"lighting.functions.shadow=[]"}, kShadows), "lighting", "shadow"), IsEmpty());
  EXPECT_THAT(
      providers(with_settings({"lighting.functions.shadow=['contact','shadow']"}, kShadows), "lighting", "shadow"),
      ElementsAre("contact", "shadow"));
  EXPECT_THAT(
      providers(with_settings({"lighting.functions.shadow=['contact','shadow']", "contact.technique=none"}, kShadows),
                "lighting", "shadow"),
      ElementsAre("shadow"));
  EXPECT_EQ(find(with_settings({"joins.shadow=switch"}, kShadows), "lighting").functions[0].join, Join::kSwitch);
}

TEST(Resolve, DependsOnProvidersAndWhatTheyRead) {
  const ResolvedGraph graph = resolve_text(kShadows);
  std::vector<std::string> names;
  for (const PassIndex p : find(graph, "lighting").dependencies) names.push_back(graph.passes[p].name);
  EXPECT_THAT(names, ElementsAre("sky", "gbuffer", "shadow", "contact", "material"));
  EXPECT_THAT(find(graph, "gbuffer").dependencies, IsEmpty());
}

TEST(Resolve, SaysWhyTheBuildLeftATechniqueOut) {
  test_support::PluginFolder folder;
  folder.leave_out("display/calibrated", "this build has no Spectrometer: install libspectrometer-dev");
  std::string text(kSmallGraph);
  text.replace(text.find("linear"), 6, "calibrated");
  EXPECT_EQ(message_of([&] { resolve_text(text, folder.registry()); }),
            "test.toml:14:13: error: pass 'display': role 'display' has no technique 'calibrated'\n"
            "  found:    technique = \"calibrated\"\n"
            "  expected: one of none, linear\n"
            "  help:     this build has no Spectrometer: install libspectrometer-dev");
}

TEST(Resolve, ReadsParametersOfEveryType) {
  const ResolvedGraph graph = with(
      "[[pass]]\nname = \"dots\"\nrole = \"paint\"\ntechnique = \"dots\"\nparams.count = 7\nparams.lights = [\"sun\", "
      "\"lamp\"]\nparams.offset = [0, 0.5, -1]\nparams.free = -1e9\n"
      "params.label = \"a, b\"\n");
  const Pass& dots = find(graph, "dots");
  EXPECT_EQ(dots.parameters[0].number[0], 7);
  EXPECT_THAT(dots.parameters[1].names, ElementsAre("sun", "lamp"));
  EXPECT_THAT(dots.parameters[2].number, ElementsAre(0, 0.5, -1));
  EXPECT_EQ(dots.parameters[3].number[0], -1e9);
  EXPECT_THAT(dots.parameters[4].names, ElementsAre("a, b"));
  const ResolvedGraph ao = with_settings({"ao.params.falloff=linear", "ao.params.denoise=false", "ao.params.radius=1"});
  EXPECT_EQ(find(ao, "ao").parameters[1].number[0], 1);
  EXPECT_EQ(find(ao, "ao").parameters[3].number[0], 0);
  EXPECT_EQ(find(ao, "ao").parameters[2].number[0], 2);  // its default
}

TEST(Resolve, TakesNumbersThatAreChoicesToTheLetter) {
  Technique technique;
  technique.id = "source/virtual";
  technique.parameters.resize(2);
  technique.parameters[0].name = "spacing";
  technique.parameters[1].name = "bias";
  for (Parameter& each : technique.parameters) each.type = ParameterType::kChoice;
  technique.parameters[0].choices = {"16", "8", "4", "2"};
  technique.parameters[1].choices = {"-0.5", "0.5", "true"};
  const auto read = [&](std::string_view params, std::initializer_list<const char*> settings) {
    WrittenGraph written = parse(
        "[[pass]]\nname = \"source\"\nrole = \"source\"\ntechnique = \"virtual\"\n" + std::string(params), "test.toml");
    for (const char* setting : settings) apply_setting(written, setting);
    Presets presets;
    Problems problems;
    std::vector<std::string> notes;
    std::vector<ParameterOrigin> origins;
    const auto values = read_parameters(written.passes[0], technique, presets, problems, notes, origins);
    problems.throw_if_any();
    return std::vector<double>{values[0].number[0], values[1].number[0]};
  };
  EXPECT_THAT(read("params.spacing = 4\nparams.bias = 0.5\n", {}), ElementsAre(2, 1));
  EXPECT_THAT(read("params.spacing = \"8\"\n", {"source.params.spacing=2", "source.params.bias=-0.5"}),
              ElementsAre(3, 0));
  // What is not one of them to the letter stays an error, and a bool is no word.
  for (const char* wrong : {"source.params.spacing=3", "source.params.spacing=4.0", "source.params.bias=true"})
    EXPECT_THAT(message_of([&] { read("", {wrong}); }), HasSubstr("expected: one of ")) << wrong;
  EXPECT_THAT(message_of([&] { read("", {"source.params.spacing=3"}); }), HasSubstr("params.spacing is an integer"));
}

TEST(Resolve, PutsPresetsIn) {
  const std::string text = "[params]\nao_radius = 2.5\nunused = 1\n";
  const std::string graph_text = std::string(kSmallGraph).insert(kSmallGraph.find("[[pass]]"), text);
  const ResolvedGraph graph = with_settings({"ao.params.radius=$ao_radius"}, graph_text);
  EXPECT_EQ(find(graph, "ao").parameters[0].number[0], 2.5);
  EXPECT_THAT(graph.notes, ElementsAre("params.unused is used by no pass"));
  EXPECT_THAT(message_of([&] {
                with_settings({"ao.params.radius=$ao_radius", "params.ao_raduis=4"}, graph_text);
              }),
              AllOf(HasSubstr("no pass uses a preset 'ao_raduis'"), HasSubstr("did you mean 'ao_radius'?")));
  EXPECT_EQ(find(with_settings({"ao.params.radius=$ao_radius", "params.ao_radius=4"}, graph_text), "ao")
                .parameters[0]
                .number[0],
            4);
}

TEST(Resolve, ShapesImagesByTheirRules) {
  const ResolvedGraph graph = with_settings({"extent=[33, 17]"}, kShadows);
  const Resource& depth = graph.resources[find_resource(graph, "gbuffer.depth")];
  EXPECT_EQ(depth.width, 33U);
  EXPECT_EQ(depth.height, 17U);
  EXPECT_EQ(depth.format, VK_FORMAT_R32_SFLOAT);
  const Resource& atlas = graph.resources[find_resource(graph, "shadow.atlas")];
  EXPECT_EQ(atlas.width, 1024U);
  EXPECT_EQ(atlas.layers, 16U);
  EXPECT_TRUE(graph.resources[find_resource(graph, "sky.sky_map")].is_kept);
}

TEST(Resolve, FindsResourcesAndNamesTheNearest) {
  const ResolvedGraph graph = resolve_text(kSmallGraph);
  EXPECT_EQ(graph.resources[find_resource(graph, "scene.camera")].name, "scene.camera");
  EXPECT_THAT(message_of([&] { find_resource(graph, "ao.visibilty"); }), HasSubstr("did you mean 'ao.visibility'?"));
}

TEST(Resolve, SaysOneMessageForOneCause) {
  // gbuffer is misspelt: nothing is said about the inputs that it would have made.
  const std::string message = message_of([] { with_settings({"gbuffer.technique=rastr"}); });
  EXPECT_EQ(message.find("error:"), message.rfind("error:")) << message;
}

TEST(Resolve, ListsAllMistakesAtOnce) {
  const std::string message = message_of([] {
    with_settings(
        {"extent=[0,1]", "ao.params.radius=1000", "lighting.inputs.depth=gbuffer.dept", "output=display.colour"});
  });
  std::size_t errors = 0;
  for (std::size_t at = message.find("error:"); at != std::string::npos; at = message.find("error:", at + 1)) ++errors;
  EXPECT_EQ(errors, 4U) << message;
}

TEST(Histories, AreOneResourceForAllWhoReadThem) {
  const ResolvedGraph graph = resolve_text(std::string(kSmallGraph) + R"([[pass]]
role = "sky"
technique = "procedural"
[[pass]]
name = "one"
role = "display"
technique = "linear"
inputs.radiance = "sky.sky_map@previous"
[[pass]]
name = "two"
role = "display"
technique = "linear"
inputs.radiance = "sky.sky_map@previous"
)");
  EXPECT_EQ(bound(graph, "one", "radiance"), "sky.sky_map@previous");
  EXPECT_EQ(find(graph, "one").ports.at("radiance"), find(graph, "two").ports.at("radiance"));
  const Resource& history = graph.resources[find_resource(graph, "sky.sky_map@previous")];
  EXPECT_EQ(history.width, 128U);
  EXPECT_EQ(history.format, static_cast<std::uint32_t>(VK_FORMAT_R32G32B32A32_SFLOAT));
  EXPECT_EQ(graph.resources[history.history_of].name, "sky.sky_map");
  EXPECT_TRUE(find(graph, "one").dependencies.empty());
  EXPECT_EQ(find(graph, "one").past_dependencies.size(), 1U);
}

TEST(Histories, OfALeftOutPassAreAbsent) {
  const ResolvedGraph graph = resolve_text(std::string(kSmallGraph) + R"([[pass]]
role = "sky"
technique = "none"
[[pass]]
name = "again"
role = "lighting"
technique = "deferred"
inputs.visibility = "sky.sky_map@previous"
)");
  EXPECT_EQ(bound(graph, "again", "visibility"), "absent");
}

}  // namespace
}  // namespace heddle::graph
