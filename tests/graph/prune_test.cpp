// SPDX-License-Identifier: Apache-2.0
// Which passes stay, and the sentence that says why.
#include <gmock/gmock.h>

#include "graph/plugin_folder.hpp"
#include "graph/synthetic_graph.hpp"

namespace heddle::graph {
namespace {

using test_support::SyntheticGraph;
using test_support::touch;

struct Fork : SyntheticGraph {
  PassIndex source = pass("source"), filter = pass("filter"), side = pass("side");
  ResourceIndex image_a = image(source, "a"), image_b, image_c;
  Fork() {
    gpu(source, "main", {touch("a", HEDDLE_ACCESS_STORAGE_WRITE)});
    input(filter, "a", image_a, true);
    image_b = image(filter, "b");
    gpu(filter, "main", {touch("a", HEDDLE_ACCESS_SAMPLED), touch("b", HEDDLE_ACCESS_STORAGE_WRITE)});
    input(side, "a", image_a);
    image_c = image(side, "c");
    gpu(side, "main", {touch("a", HEDDLE_ACCESS_SAMPLED), touch("c", HEDDLE_ACCESS_STORAGE_WRITE)});
    output(image_b);
  }
};

TEST(Prune, KeepsPassWhoseOutputIsDisplayed) {
  Fork chain;
  prune(chain.graph, std::array{chain.image_b}, {});
  EXPECT_FALSE(chain.graph.passes[chain.filter].is_pruned);
  EXPECT_EQ(chain.graph.passes[chain.filter].reason, "makes the output 'filter.b'");
  EXPECT_FALSE(chain.graph.passes[chain.source].is_pruned);
  EXPECT_EQ(chain.graph.passes[chain.source].reason, "makes 'source.a' for 'filter'");
}

TEST(Prune, DropsPassThatNobodyAskedFor) {
  Fork chain;
  prune(chain.graph, std::array{chain.image_b}, {});
  EXPECT_TRUE(chain.graph.passes[chain.side].is_pruned);
  EXPECT_EQ(chain.graph.passes[chain.side].reason, "nobody asks for 'side.c'");
}

TEST(Prune, KeepsPassWhoseOutputIsAskedForBesides) {
  Fork chain;
  prune(chain.graph, std::array{chain.image_b, chain.image_c}, {});
  EXPECT_FALSE(chain.graph.passes[chain.side].is_pruned);
  EXPECT_EQ(chain.graph.passes[chain.side].reason, "makes 'side.c', which is asked for");
}

TEST(Prune, SaysThatOnlyDroppedPassesWouldUseIt) {
  Fork chain;
  chain.output(kNoIndex);
  prune(chain.graph, {}, {});
  EXPECT_EQ(chain.graph.passes[chain.source].reason, "only 'filter', 'side' would use it, and nobody asks for that");
}

TEST(Prune, DropsPassWithoutItsFeatureAndLeavesItsReadersNeutral) {
  Fork chain;
  chain.need_feature(chain.source, "fog");
  ResolvedGraph with = chain.graph;
  prune(with, std::array{chain.image_b}, std::array{std::string("fog")});
  EXPECT_FALSE(with.passes[chain.source].is_pruned);
  prune(chain.graph, std::array{chain.image_b}, {});
  EXPECT_TRUE(chain.graph.passes[chain.source].is_pruned);
  EXPECT_EQ(chain.graph.passes[chain.source].reason, "the scene has no 'fog'");
  EXPECT_FALSE(chain.graph.passes[chain.filter].is_pruned);
  EXPECT_FALSE(chain.graph.passes[chain.filter].ports.contains("a"));
  EXPECT_TRUE(chain.graph.passes[chain.filter].dependencies.empty());
}

TEST(Prune, HandsOnTheVersionBeforeWhenTheChangerIsDropped) {
  SyntheticGraph made;
  const PassIndex first = made.pass("first"), fog = made.pass("fog"), last = made.pass("last");
  const ResourceIndex a = made.image(first, "a");
  const ResourceIndex changed = made.change(fog, "a", a);
  made.need_feature(fog, "fog");
  made.input(last, "a", changed);
  const ResourceIndex b = made.image(last, "b");
  made.output(b);
  prune(made.graph, std::array{b}, {});
  EXPECT_EQ(made.graph.passes[last].ports.at("a"), a);
  EXPECT_FALSE(made.graph.passes[first].is_pruned);
  EXPECT_EQ(made.graph.passes[first].reason, "makes 'first.a' for 'last'");
}

TEST(Prune, KeepsProvidersAndWhatTheirFunctionsRead) {
  SyntheticGraph made;
  const PassIndex depth = made.pass("depth"), contact = made.pass("contact"), caller = made.pass("caller");
  const ResourceIndex d = made.image(depth, "d");
  made.gpu(depth, "main", {touch("d", HEDDLE_ACCESS_STORAGE_WRITE)});
  made.input(contact, "d", d);
  made.provide(contact, "shadow", {touch("d", HEDDLE_ACCESS_SAMPLED)});
  const ResourceIndex out = made.image(caller, "out");
  made.gpu(caller, "main", {touch("out", HEDDLE_ACCESS_STORAGE_WRITE)}, ShaderKind::kCompute, {"shadow"});
  made.bind(caller, "shadow", {contact});
  made.output(out);
  prune(made.graph, std::array{out}, {});
  EXPECT_FALSE(made.graph.passes[contact].is_pruned);
  EXPECT_EQ(made.graph.passes[contact].reason, "answers 'shadow' for 'caller'");
  EXPECT_FALSE(made.graph.passes[depth].is_pruned);
  EXPECT_EQ(made.graph.passes[depth].reason, "makes 'depth.d' for functions that 'caller' calls");
}

TEST(Prune, RefusesToReadWhatALaterPassChangesInPlace) {
  SyntheticGraph made;
  const PassIndex first = made.pass("first"), second = made.pass("second");
  const ResourceIndex a = made.image(first, "a");
  const ResourceIndex b = made.change(second, "a", a);
  made.output(b);
  EXPECT_EQ(test_support::message_of([&] {
              prune(made.graph, std::array{b, a}, {});
            }),
            "synthetic.toml:2:1: error: 'first.a' cannot be read after the frame: pass 'second' changes it in place\n"
            "  help:     ask for 'second.a'");
  EXPECT_NO_THROW(prune(made.graph, std::array{a}, {}));  // then nobody changes it
}

TEST(Prune, KeepsWhatMadeTheHistoryThatIsRead) {
  SyntheticGraph made;
  const PassIndex late = made.pass("late"), show = made.pass("show");
  const ResourceIndex a = made.image(late, "a", HEDDLE_PORT_KEPT);
  const ResourceIndex past = made.history(a);
  made.input(show, "a", past);
  made.input(late, "own", past);
  const ResourceIndex b = made.image(show, "b");
  made.output(b);
  prune(made.graph, std::array{b}, {});
  EXPECT_FALSE(made.graph.passes[late].is_pruned);
  EXPECT_EQ(made.graph.passes[late].reason, "makes 'late.a', whose last version 'show' reads");
  EXPECT_TRUE(made.graph.passes[show].dependencies.empty());
  EXPECT_EQ(made.graph.passes[late].past_dependencies, std::vector{late});
}

TEST(Prune, LeavesReadersOfAHistoryNeutralWhenItsMakerHasNothingToDo) {
  SyntheticGraph made;
  const PassIndex fog = made.pass("fog"), show = made.pass("show");
  const ResourceIndex a = made.image(fog, "a", HEDDLE_PORT_KEPT);
  made.need_feature(fog, "fog");
  made.input(show, "a", made.history(a), true);
  const ResourceIndex b = made.image(show, "b");
  made.output(b);
  prune(made.graph, std::array{b}, {});
  EXPECT_FALSE(made.graph.passes[show].ports.contains("a"));
}

TEST(Prune, RefusesAHistoryOfWhatALaterPassChangesInPlace) {
  SyntheticGraph made;
  const PassIndex first = made.pass("first"), second = made.pass("second"), show = made.pass("show");
  const ResourceIndex a = made.image(first, "a", HEDDLE_PORT_KEPT);
  const ResourceIndex b = made.change(second, "b", a);
  made.input(show, "a", made.history(a));
  made.input(show, "b", b);
  const ResourceIndex c = made.image(show, "c");
  made.output(c);
  EXPECT_EQ(test_support::message_of([&] { prune(made.graph, std::array{c}, {}); }),
            "synthetic.toml:3:1: error: pass 'show': inputs.a: 'first.a' is gone by the next frame: pass 'second' "
            "changes it in place\n"
            "  help:     read \"second.b@previous\"");
}

TEST(Prune, RefusesAGraphWhoseOutputNeedsAMissingFeature) {
  Fork chain;
  chain.need_feature(chain.filter, "fog");
  EXPECT_THROW(prune(chain.graph, std::array{chain.image_b}, {}), Error);
}

}  // namespace
}  // namespace heddle::graph
