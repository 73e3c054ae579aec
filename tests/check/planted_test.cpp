// SPDX-License-Identifier: Apache-2.0
// Techniques that break rules behind the graph's back: each is found by the check that is for it, and told with pass,
// stage and port.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace {

using testing::AllOf;
using testing::HasSubstr;

class Planted : public testing::Test {
 protected:
  static void SetUpTestSuite() { rendering::Host::flags = HEDDLE_HOST_CHECK; }

  /// The error of three frames, or "".
  static std::string rendered(const std::string& passes, const std::string& output) {
    rendering::Scene scene;
    rendering::Graph graph("extent = [16, 8]\noutput = \"" + output + "\"\n" + passes);
    for (int frame = 0; frame < 3; ++frame)
      if (heddle_render(graph.handle, scene.handle, nullptr) != HEDDLE_OK)
        return heddle_error(rendering::Host::get().handle);
    return "";
  }
  /// The error of a check, or its report.
  static std::string checked(const std::string& passes, const std::string& output, std::uint32_t frames = 3) {
    rendering::Scene scene;
    rendering::Graph graph("extent = [16, 8]\noutput = \"" + output + "\"\n" + passes);
    const char* report = nullptr;
    if (heddle_graph_check(graph.handle, scene.handle, nullptr, frames, &report) != HEDDLE_OK)
      return heddle_error(rendering::Host::get().handle);
    return report;
  }
  static std::string pass(const std::string& name, const std::string& technique, const std::string& more = "") {
    return "[[pass]]\nname = \"" + name + "\"\nrole = \"planted\"\ntechnique = \"" + technique + "\"\n" + more;
  }
  static std::string combine(const std::string& a, const std::string& b) {
    return pass("both", "combine", "inputs.a = \"" + a + ".color\"\ninputs.b = \"" + b + ".color\"\n");
  }
};

TEST_F(Planted, WhatKeepsTheRulesPasses) {
  const std::string passes =
      pass("one", "constant") + pass("two", "constant", "params.value = 2.0\n") + combine("one", "two");
  EXPECT_EQ(rendered(passes, "both.color"), "");
  const nlohmann::json report = parsed::json(checked(passes, "both.color"));
  EXPECT_EQ(report["unordered_pairs"], 1);
  EXPECT_EQ(report["seen_both_ways"], 1);
  EXPECT_EQ(report["orders"], 2);
  EXPECT_EQ(report["compared"], nlohmann::json::array({"both.color"}));
}

TEST_F(Planted, BarrierForgottenBetweenTwoDispatchesOfAStage) {
  EXPECT_EQ(rendered(pass("one", "forgets"), "one.color"),
            "test.toml:3:1: error: frame 0, pass 'one', stage 'fill', vkCmdDispatch: 'one.color' is written while "
            "vkCmdDispatch of pass 'one', stage 'fill' may still write\n"
            "  found:    no barrier in between\n"
            "  expected: a barrier from COMPUTE_SHADER (SHADER_STORAGE_WRITE) to COMPUTE_SHADER "
            "(SHADER_STORAGE_WRITE)");
}

TEST_F(Planted, NaNIsToldWithPassPortPixelAndFrame) {
  EXPECT_EQ(rendered(pass("one", "constant", "params.spot = \"nan\"\n") + combine("one", "one"), "both.color"),
            "test.toml:3:1: error: frame 0, pass 'one' (planted/constant): 'one.color' holds a NaN at pixel 5, 3\n"
            "  found:    nan in channel 0; 4 of 512 numbers are wrong\n"
            "  expected: 0 to 1000, finite\n"
            "  help:     this is the first output in the order of the frame that breaks a rule");
}

TEST_F(Planted, InfinityIsToldWhereTheRoleForbidsIt) {
  EXPECT_THAT(rendered(pass("one", "constant", "params.spot = \"infinity\"\n"), "one.color"),
              HasSubstr("'one.color' holds an infinity at pixel 5, 3\n  found:    inf in channel 0"));
}

TEST_F(Planted, ValueOutOfTheRolesRangeIsTold) {
  EXPECT_THAT(rendered(pass("one", "constant", "params.spot = \"negative\"\n"), "one.color"),
              HasSubstr("'one.color' holds a value out of range at pixel 5, 3\n  found:    -1 in channel 0"));
}

TEST_F(Planted, PixelsThatNobodyWroteDependOnTheMemory) {
  const std::string passes = pass("one", "constant", "params.where = \"left_half\"\n") + combine("one", "one");
  EXPECT_THAT(
      checked(passes, "both.color"),
      AllOf(HasSubstr("error: 'both.color' depends on memory that nobody wrote, filled with 0xFFFFFFFF\n"
                      "  found:    frame 0, pixel 8, 0: nan nan nan nan\n"),
            HasSubstr("help:     the first output that differs is 'one.color': pass 'one' (planted/constant)")));
}

TEST_F(Planted, CpuStageThatListensToAnotherPass) {
  const std::string passes = pass("says", "publishes") + pass("hears", "listens") + combine("says", "hears");
  EXPECT_EQ(rendered(passes, "both.color"), "");
  EXPECT_THAT(checked(passes, "both.color"),
              AllOf(HasSubstr("error: 'both.color' depends on the order of stages that nothing puts in order"),
                    HasSubstr("the first output that differs is 'hears.color': pass 'hears' (planted/listens) uses "
                              "something that its declared accesses do not tell; the order was ")));
}

TEST_F(Planted, CopyOfAnImageWhoseHandleLeaked) {
  const std::string passes = pass("source", "leaks") + pass("target", "copies") + combine("source", "target");
  EXPECT_EQ(rendered(passes, "both.color"), "") << "in the order of the file all barriers happen to be there";
  EXPECT_THAT(checked(passes, "both.color", 1),
              AllOf(HasSubstr("error: 'both.color' depends on the order of stages that nothing puts in order"),
                    HasSubstr("the first output that differs is 'target.color'")));
  EXPECT_THAT(checked(passes, "both.color"),
              HasSubstr("pass 'target', stage 'transfer', vkCmdCopyImage: 'source.color'"))
      << "from the second frame on the hazard checker sees it too";
}

TEST_F(Planted, PassesThatCountTogether) {
  const std::string passes = pass("first", "counts") + pass("second", "counts") + combine("first", "second");
  EXPECT_EQ(rendered(passes, "both.color"), "");
  EXPECT_THAT(checked(passes, "both.color"),
              AllOf(HasSubstr("error: 'both.color' depends on the order of stages that nothing puts in order\n"
                              "  found:    frame 0, pixel 0, 0: 4 4 4 4\n"
                              "  expected: 5 5 5 5, as in the order of the graph"),
                    HasSubstr("the order was second.transfer, first.transfer, both.combine")));
}

TEST_F(Planted, CheckNeedsAFrame) {
  EXPECT_EQ(checked(pass("one", "constant"), "one.color", 0),
            "error: a check of 0 frames was asked for\n  help:     render three");
}

}  // namespace
