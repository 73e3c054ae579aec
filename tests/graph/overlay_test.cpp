// SPDX-License-Identifier: Apache-2.0
// Files that extend files, and settings: what changes, what stays, where it stands, and which place a value keeps.
#include <gmock/gmock.h>

#include <fstream>

#include "graph/plugin_folder.hpp"

namespace heddle::graph {
namespace {

using test_support::kSmallGraph;
using test_support::message_of;
using test_support::text;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> names(const WrittenGraph& graph) {
  std::vector<std::string> list;
  for (const WrittenPass& pass : graph.passes) list.push_back(text(pass.name));
  return list;
}

WrittenGraph over(std::string_view overlay_text) {
  return overlay(parse(kSmallGraph, "base.toml"),
                 parse("extends = \"base.toml\"\n" + std::string(overlay_text), "over.toml"));
}

const WrittenPass& find(const WrittenGraph& graph, std::string_view name) {
  for (const WrittenPass& pass : graph.passes)
    if (text(pass.name) == name) return pass;
  throw std::runtime_error("no such pass");
}

TEST(Overlay, SwapsATechniqueAndKeepsThePlaces) {
  const WrittenGraph graph = over("[[pass]]\nname = \"ao\"\ntechnique = \"ray_traced\"\n");
  EXPECT_THAT(names(graph), ElementsAre("gbuffer", "ao", "lighting", "display"));
  EXPECT_EQ(text(find(graph, "ao").technique), "ray_traced");
  EXPECT_EQ(find(graph, "ao").technique.where.file, "over.toml");
  EXPECT_EQ(find(graph, "ao").role.where.file, "base.toml");
  EXPECT_EQ(find(graph, "ao").role.where.line, 7U);
  EXPECT_FALSE(graph.extends.has_value());
  EXPECT_EQ(graph.file, "over.toml");
}

TEST(Overlay, PutsNewPassesWhereTheySay) {
  EXPECT_THAT(names(over("[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\nbefore = \"gbuffer\"\n")),
              ElementsAre("sky", "gbuffer", "ao", "lighting", "display"));
  EXPECT_THAT(names(over("[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\nafter = \"ao\"\n")),
              ElementsAre("gbuffer", "ao", "sky", "lighting", "display"));
  EXPECT_THAT(names(over("[[pass]]\nrole = \"sky\"\ntechnique = \"uniform\"\n")),
              ElementsAre("gbuffer", "ao", "lighting", "display", "sky"));
  EXPECT_THAT(names(over("[[pass]]\nname = \"ao\"\nafter = \"display\"\n")),
              ElementsAre("gbuffer", "lighting", "display", "ao"));
}

TEST(Overlay, RemovesPasses) {
  EXPECT_THAT(names(over("remove = [\"ao\"]\n")), ElementsAre("gbuffer", "lighting", "display"));
}

TEST(Overlay, ReplacesOnlyWhatItSays) {
  const WrittenGraph graph = over("extent = [8, 8]\n[[pass]]\nname = \"ao\"\nparams.radius = 2.0\nenabled = false\n");
  EXPECT_EQ(text(*graph.output), "display.color");
  EXPECT_EQ(graph.extent->where.file, "over.toml");
  EXPECT_EQ(text(find(graph, "ao").technique), "gtao");
  EXPECT_FALSE(std::get<bool>(find(graph, "ao").enabled->value));
  EXPECT_EQ(find(graph, "ao").params.size(), 1U);
}

TEST(Overlay, MarksParametersThatWereWrittenForAnotherTechnique) {
  WrittenGraph graph = parse(kSmallGraph, "base.toml");
  apply_setting(graph, "ao.params.directions=4");
  apply_setting(graph, "ao.technique=ray_traced");
  apply_setting(graph, "ao.params.samples=8");
  EXPECT_EQ(find(graph, "ao").params[0].first.written_for, "gtao");
  EXPECT_EQ(find(graph, "ao").params[1].first.written_for, "");
  const ResolvedGraph resolved = resolve(graph, test_support::shared_registry());
  ASSERT_EQ(resolved.notes.size(), 1U);
  EXPECT_EQ(resolved.notes[0],
            "pass 'ao': params.directions was written for 'gtao' and is left out: 'ray_traced' has no such parameter");
  // Back again, they count again.
  apply_setting(graph, "ao.technique=gtao");
  EXPECT_EQ(find(graph, "ao").params[0].first.written_for, "");
  EXPECT_EQ(find(graph, "ao").params[1].first.written_for, "ray_traced");
}

TEST(Overlay, CarriesParametersOverWhereBothTechniquesHaveThem) {
  WrittenGraph graph = parse(kSmallGraph, "base.toml");
  apply_setting(graph, "ao.params.radius=2");
  apply_setting(graph, "ao.technique=ray_traced");
  const ResolvedGraph resolved = resolve(graph, test_support::shared_registry());
  EXPECT_EQ(resolved.passes[1].parameters[0].number[0], 2.0);
  EXPECT_TRUE(resolved.notes.empty());
}

TEST(Overlay, ReadsChainsOfFilesRelativeToEachFile) {
  const test_support::PluginFolder folder;
  const auto root = folder.path() / "graphs";
  std::filesystem::create_directories(root / "deep");
  std::ofstream(root / "base.toml") << kSmallGraph;
  std::ofstream(root / "middle.toml") << "extends = \"base.toml\"\nextent = [32, 16]\n";
  std::ofstream(root / "deep" / "top.toml") << "extends = \"../middle.toml\"\nremove = [\"ao\"]\n";
  const WrittenGraph graph = read_graph(root / "deep" / "top.toml");
  EXPECT_THAT(names(graph), ElementsAre("gbuffer", "lighting", "display"));
  EXPECT_EQ(std::get<std::int64_t>(std::get<std::vector<Written>>(graph.extent->value)[0].value), 32);
  const WrittenGraph parsed = read_extended(parse("extends = \"middle.toml\"\n", "text"), root);
  EXPECT_EQ(parsed.passes.size(), 4U);
}

TEST(Overlay, NamesACircleOfFiles) {
  const test_support::PluginFolder folder;
  std::ofstream(folder.path() / "a.toml") << "extends = \"b.toml\"\n";
  std::ofstream(folder.path() / "b.toml") << "extends = \"a.toml\"\n";
  EXPECT_THAT(message_of([&] { read_graph(folder.path() / "a.toml"); }),
              HasSubstr("b.toml:1:11: error: graph files extend each other in a circle"));
}

TEST(Overlay, NamesTheNearestFileWhenOneIsMissing) {
  const test_support::PluginFolder folder;
  std::ofstream(folder.path() / "deferred.toml") << kSmallGraph;
  std::ofstream(folder.path() / "over.toml") << "extends = \"defered.toml\"\n";
  const std::string message = message_of([&] { read_graph(folder.path() / "over.toml"); });
  EXPECT_THAT(message, HasSubstr("over.toml:1:11: error: there is no such graph file"));
  EXPECT_THAT(message, HasSubstr("did you mean 'deferred.toml'?"));
}

TEST(Overlay, FindsAShippedGraphByItsNameUnlessAFileHasIt) {
  const test_support::PluginFolder folder;
  const auto shipped = folder.path() / "shipped";
  const auto own = folder.path() / "own";
  std::filesystem::create_directories(shipped);
  std::filesystem::create_directories(own);
  std::ofstream(shipped / "base.toml") << kSmallGraph;
  std::ofstream(own / "over.toml") << "extends = \"base\"\nremove = [\"ao\"]\n";
  EXPECT_EQ(read_graph(own / "over.toml", shipped).passes.size(), 3U);
  EXPECT_EQ(read_graph("base", shipped).passes.size(), 4U);
  EXPECT_EQ(read_graph("base.toml", shipped).file, (shipped / "base.toml").string());
  std::ofstream(own / "base") << "output = \"display.color\"\n[[pass]]\nname = \"ao\"\nrole = \"ambient_occlusion\"\n"
                                 "technique = \"gtao\"\n";
  EXPECT_EQ(read_graph(own / "over.toml", shipped).passes.size(), 0U) << "a file beside it comes first";
}

TEST(Overlay, NamesBothPlacesThatWereLookedAt) {
  const test_support::PluginFolder folder;
  const auto shipped = folder.path() / "shipped";
  std::filesystem::create_directories(shipped);
  std::ofstream(shipped / "deferred.toml") << kSmallGraph;
  std::ofstream(folder.path() / "over.toml") << "extends = \"defered\"\n";
  const std::string root = folder.path().string();
  EXPECT_EQ(message_of([&] { read_graph(folder.path() / "over.toml", shipped); }),
            root +
                "/over.toml:1:11: error: there is neither a file nor a shipped graph 'defered'\n  expected: one of the "
                "files " +
                root + "/defered and " + root +
                "/shipped/defered.toml; shipped are deferred\n  help:     did you mean 'deferred'?");
}

TEST(Overlay, RemembersWhatItRemoved) {
  const WrittenGraph graph =
      overlay(parse(kSmallGraph, "base.toml"), parse("extends = \"base.toml\"\nremove = [\"ao\"]\n", "over.toml"));
  ASSERT_EQ(graph.removed.size(), 1U);
  EXPECT_EQ(graph.removed[0].where.file, "over.toml");
  EXPECT_EQ(graph.removed[0].where.line, 2U);
  EXPECT_EQ(graph.removed[0].pass.where.file, "base.toml");
}

TEST(Setting, TakesWordsWithoutQuotesAndTomlValues) {
  WrittenGraph graph = parse(kSmallGraph, "base.toml");
  apply_setting(graph, "ao.technique=ray_traced");
  apply_setting(graph, "ao.params.radius = 1");
  apply_setting(graph, "ao.params.falloff='linear'");
  apply_setting(graph, "ao.inputs.depth=gbuffer.depth");
  apply_setting(graph, "ao.enabled=false");
  apply_setting(graph, "lighting.functions.shadow=[]");
  apply_setting(graph, "extent=[640,360]");
  apply_setting(graph, "output=lighting.radiance");
  apply_setting(graph, "params.quality=0.5");
  apply_setting(graph, "joins.shadow=sum");
  const WrittenPass& ao = find(graph, "ao");
  EXPECT_EQ(text(ao.technique), "ray_traced");
  EXPECT_EQ(std::get<std::int64_t>(ao.params[0].second.value), 1);
  EXPECT_EQ(text(ao.params[1].second), "linear");
  EXPECT_EQ(text(ao.inputs[0].second), "gbuffer.depth");
  EXPECT_FALSE(std::get<bool>(ao.enabled->value));
  EXPECT_EQ(find(graph, "lighting").functions.size(), 1U);
  EXPECT_EQ(text(*graph.output), "lighting.radiance");
  EXPECT_EQ(std::get<double>(graph.params[0].second.value), 0.5);
  EXPECT_EQ(text(graph.joins[0].second), "sum");
  EXPECT_EQ(ao.params[0].second.where.file, "--set");
  EXPECT_EQ(ao.params[0].second.where.column, 20U);
  const auto& extent = std::get<std::vector<Written>>(graph.extent->value);
  EXPECT_EQ(extent[1].where.column, 13U);
}

TEST(Setting, LeavesTheGraphAloneWhenItIsWrong) {
  WrittenGraph graph = parse(kSmallGraph, "base.toml");
  for (const char* wrong : {"", "=", "ao", "ao=1", "ao.technique", "ao.technique=", "ao.technique=1", "ao..radius=1",
                            "oa.technique=gtao", "ao.params=1", "ao.params.a.b=1", "ao.name=x", "ao.params.radius=[1",
                            "ao.params.radius=1\nextent=2", "ao.params.radius=nan"})
    EXPECT_THROW(apply_setting(graph, wrong), Error) << wrong;
  EXPECT_EQ(text(find(graph, "ao").technique), "gtao");
  EXPECT_TRUE(find(graph, "ao").params.empty());
}

TEST(Setting, SaysTheColumnInCharactersOfTheSetting) {
  WrittenGraph graph = parse(kSmallGraph, "base.toml");
  EXPECT_THAT(message_of([&] { apply_setting(graph, "oa.technique=gtao"); }),
              HasSubstr("--set:1:1: error: the graph has no pass 'oa'"));
  EXPECT_THAT(message_of([&] { apply_setting(graph, "ao.tecnique=gtao"); }),
              HasSubstr("--set:1:4: error: pass 'ao': a pass has no key 'tecnique'"));
}

}  // namespace
}  // namespace heddle::graph
