// SPDX-License-Identifier: Apache-2.0
// What a check proves of lists: barriers round counts, memory under them, and that nobody sees the order of elements.
#include "parsed.hpp"
#include "roles/rendering.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace {

using testing::HasSubstr;

class Lists : public testing::Test {
 protected:
  static void SetUpTestSuite() { rendering::Host::flags = HEDDLE_HOST_CHECK; }

  /// The error of a check, or its report.
  static std::string checked(const std::string& output, const std::string& passes, std::uint32_t frames = 4) {
    rendering::Scene scene;
    rendering::Graph graph("extent = [96, 40]\noutput = \"" + output + ".color\"\n" + passes);
    const char* report = nullptr;
    if (heddle_graph_check(graph.handle, scene.handle, nullptr, frames, &report) != HEDDLE_OK)
      return heddle_error(rendering::Host::get().handle);
    return report;
  }
  /// The error of three frames, or "".
  static std::string rendered(const std::string& output, const std::string& passes) {
    rendering::Scene scene;
    rendering::Graph graph("extent = [96, 40]\noutput = \"" + output + ".color\"\n" + passes);
    for (int frame = 0; frame < 3; ++frame)
      if (heddle_render(graph.handle, scene.handle, nullptr) != HEDDLE_OK)
        return heddle_error(rendering::Host::get().handle);
    return "";
  }
  static std::string pass(const std::string& name, const std::string& technique, const std::string& more = "") {
    return "[[pass]]\nname = \"" + name + "\"\nrole = \"lists\"\ntechnique = \"" + technique + "\"\n" + more;
  }
  static std::string pixels(const std::string& of) { return "inputs.pixels = \"" + of + ".pixels\"\n"; }
};

TEST_F(Lists, WithRoomKeepTheRules) {
  const nlohmann::json report =
      parsed::json(checked("shade", pass("find", "find", "params.room = 3840\n") +
                                        pass("more", "more", pixels("find") + "params.share = 300\n") +
                                        pass("shade", "shade", pixels("more"))));
  // What both choose is drawn twice, with the same value.
  EXPECT_EQ(report["lists"], nlohmann::json::array({"find.pixels"}));
  EXPECT_EQ(report["overflowed"], 0);
}

TEST_F(Lists, ThatGrowAreComparedWhereTheyHaveRoom) {
  const nlohmann::json report = parsed::json(
      checked("shade", pass("find", "find", "params.room = 64\n") + pass("shade", "shade", pixels("find"))));
  EXPECT_EQ(report["frames"], 4);
  EXPECT_EQ(report["overflowed"], 1);
}

TEST_F(Lists, ThatNeverHaveRoomCannotBeCompared) {
  EXPECT_THAT(checked("shade", pass("find", "find", "params.room = 64\nparams.grows = false\n") +
                                   pass("shade", "shade", pixels("find"))),
              HasSubstr("error: in each of 4 frames a list had no room: nothing could be compared\n"
                        "  found:    'find.pixels' with room for 64 elements, "));
}

TEST_F(Lists, WhoseOrderShowsAreFound) {
  EXPECT_THAT(
      checked("order", pass("find", "find", "params.room = 3840\n") + pass("order", "order", pixels("find"))),
      testing::AllOf(HasSubstr("error: 'order.color' depends on the order of a list's elements, which have none"),
                     HasSubstr("the first output that differs is 'order.color': pass 'order' (lists/order)")));
}

TEST_F(Lists, ThatAreKeptOrReadLateKeepTheRules) {
  for (const std::string& text :
       {checked("collect", pass("collect", "collect", "params.share = 10\nparams.room = 500\n")),
        checked("late", pass("find", "find", "params.room = 3840\n") + pass("late", "late", pixels("find"))),
        checked("canvas", pass("canvas", "canvas"))})
    EXPECT_THAT(text, HasSubstr("\"runs\""));
}

TEST_F(Lists, EmptiedBehindTheHostsBackAreFound) {
  EXPECT_THAT(rendered("forgets",
                       pass("forgets", "forgets", "params.room = 3840\n") + pass("shade", "shade", pixels("forgets"))),
              HasSubstr("pass 'forgets', stage 'find', vkCmdDispatch: 'forgets.pixels' is "));
}

TEST_F(Lists, AppendedToTwiceWithoutABarrierAreFound) {
  EXPECT_THAT(rendered("twice", pass("twice", "twice", "params.room = 3840\n")),
              HasSubstr("pass 'twice', stage 'find', vkCmdDispatch: 'twice."));
}

}  // namespace
