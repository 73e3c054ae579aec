// SPDX-License-Identifier: Apache-2.0
// Streams typed in by hand: the covered ones pass, and each planted fault is found and told with the barrier that is
// missing. No device.
#include "vulkan/hazard_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heddle::vulkan::hazard {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr VkPipelineStageFlags2 kCompute = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
constexpr VkPipelineStageFlags2 kFragment = VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT;
constexpr VkPipelineStageFlags2 kVertex = VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT;
constexpr VkPipelineStageFlags2 kColor = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT;
constexpr VkPipelineStageFlags2 kEarly = VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT;
constexpr VkPipelineStageFlags2 kLate = VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT;
constexpr VkPipelineStageFlags2 kCopy = VK_PIPELINE_STAGE_2_COPY_BIT;
constexpr VkPipelineStageFlags2 kIndirect = VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT;
constexpr VkPipelineStageFlags2 kHost = VK_PIPELINE_STAGE_2_HOST_BIT;

constexpr VkAccessFlags2 kSampled = VK_ACCESS_2_SHADER_SAMPLED_READ_BIT;
constexpr VkAccessFlags2 kRead = VK_ACCESS_2_SHADER_STORAGE_READ_BIT;
constexpr VkAccessFlags2 kWrite = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT;
constexpr VkAccessFlags2 kColorWrite = VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT;
constexpr VkAccessFlags2 kDepthBoth =
    VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
constexpr VkAccessFlags2 kDepthWrite = VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
constexpr VkAccessFlags2 kCopyRead = VK_ACCESS_2_TRANSFER_READ_BIT;
constexpr VkAccessFlags2 kCopyWrite = VK_ACCESS_2_TRANSFER_WRITE_BIT;

constexpr VkImageLayout kUndefined = VK_IMAGE_LAYOUT_UNDEFINED;
constexpr VkImageLayout kGeneral = VK_IMAGE_LAYOUT_GENERAL;
constexpr VkImageLayout kReadOnly = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
constexpr VkImageLayout kTarget = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
constexpr VkImageLayout kDepth = VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL;
constexpr VkImageLayout kDepthRead = VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL;
constexpr VkImageLayout kSource = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;

class HazardModel : public testing::Test {
 protected:
  ObjectIndex image(const std::string& name, std::uint64_t offset = 0, std::uint64_t memory = 0,
                    std::uint32_t layers = 1, std::uint32_t mips = 1) {
    const std::uint64_t own = 100 + stream_.objects.size();
    stream_.objects.push_back({name, true, layers, mips, memory != 0 ? memory : own, offset, 1024});
    return static_cast<ObjectIndex>(stream_.objects.size() - 1);
  }
  ObjectIndex buffer(const std::string& name, std::uint64_t offset = 0, std::uint64_t memory = 0) {
    const std::uint64_t own = 100 + stream_.objects.size();
    stream_.objects.push_back({name, false, 1, 1, memory != 0 ? memory : own, offset, 1024});
    return static_cast<ObjectIndex>(stream_.objects.size() - 1);
  }
  static Touch of(ObjectIndex object, VkPipelineStageFlags2 stages, VkAccessFlags2 access,
                  VkImageLayout layout = kUndefined, Range range = {}) {
    return {object, range, stages, access, layout};
  }
  void pass(const std::string& name) { stream_.labels.push_back({{"g.toml", 3}, "pass '" + name + "'"}); }
  void command(std::vector<Touch> touches, const char* name = "vkCmdDispatch") {
    Event event;
    event.command = name;
    event.label = static_cast<std::uint32_t>(stream_.labels.size() - 1);
    event.touches = std::move(touches);
    stream_.events.push_back(std::move(event));
  }
  void clear(ObjectIndex object, VkPipelineStageFlags2 stages, VkAccessFlags2 access, VkImageLayout layout) {
    Touch touch = of(object, stages, access, layout);
    touch.discards = true;
    command({touch}, "vkCmdBeginRendering");
  }
  void barrier(ObjectIndex object, VkPipelineStageFlags2 from, VkAccessFlags2 from_access, VkPipelineStageFlags2 to,
               VkAccessFlags2 to_access, VkImageLayout old_layout = kUndefined, VkImageLayout new_layout = kUndefined,
               Range range = {}) {
    Event event;
    event.kind = Event::Kind::kBarrier;
    event.command = "vkCmdPipelineBarrier2";
    event.label = static_cast<std::uint32_t>(stream_.labels.size() - 1);
    event.dependencies = {{object, range, from, to, from_access, to_access, old_layout, new_layout}};
    stream_.events.push_back(std::move(event));
  }
  void plain(Event::Kind kind, std::uint64_t number = 0) {
    Event event;
    event.kind = kind;
    event.number = number;
    stream_.events.push_back(std::move(event));
  }
  void host(bool writes, ObjectIndex object) {
    Event event;
    event.kind = writes ? Event::Kind::kHostWrite : Event::Kind::kHostRead;
    event.command = writes ? "host write" : "host read";
    event.touches = {of(object, 0, 0)};
    stream_.events.push_back(std::move(event));
  }
  void discard(ObjectIndex object) { contents(Event::Kind::kDiscard, object); }
  void accept(ObjectIndex object) { contents(Event::Kind::kAccept, object); }
  void contents(Event::Kind kind, ObjectIndex object) {
    Event event;
    event.kind = kind;
    event.touches = {of(object, 0, 0)};
    stream_.events.push_back(std::move(event));
  }

  /// Whole texts of what is found.
  std::vector<std::string> found() {
    Model model;
    model.play(stream_);
    std::vector<std::string> texts;
    for (const Diagnostic& diagnostic : model.take_findings()) texts.push_back(to_text(diagnostic));
    return texts;
  }

  Stream stream_;
};

// ---- what is covered passes ----

TEST_F(HazardModel, WriteThenReadBehindABarrierPasses) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCompute, kWrite, kFragment, kRead);
  command({of(b, kFragment, kRead)});
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, ReadersDoNotMindEachOther) {
  const ObjectIndex b = buffer("b");
  host(true, b);
  command({of(b, kCompute, kRead)});
  command({of(b, kFragment | kVertex, kRead)});
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, BarriersChain) {
  const ObjectIndex b = buffer("b");
  const ObjectIndex other = buffer("other");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCompute, kWrite, kCopy, kCopyRead);
  barrier(b, kCopy, 0, kFragment, kRead);
  command({of(b, kFragment, kRead), of(other, kFragment, kWrite)});
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, SourceStageCoversTheEarlierStagesOfADraw) {
  // A write after reads needs no more than that they are done: the fragment shader is done when the colours are out.
  const ObjectIndex b = buffer("b");
  host(true, b);
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  barrier(kEverything, kColor, 0, kCompute, 0);
  command({of(b, kCompute, kWrite)});
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, GlobalBarrierCoversEverything) {
  const ObjectIndex b = buffer("b");
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(b, kCompute, kWrite), of(i, kCompute, kWrite, kGeneral)});
  barrier(kEverything, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, VK_ACCESS_2_MEMORY_WRITE_BIT,
          VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT);
  command({of(b, kFragment, kRead), of(i, kFragment, kRead, kGeneral)}, "vkCmdDraw");
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, DisjointLayersAndMipsDoNotMeet) {
  const ObjectIndex i = image("i", 0, 0, 2, 2);
  barrier(i, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  for (std::uint32_t layer = 0; layer < 2; ++layer)
    for (std::uint32_t mip = 0; mip < 2; ++mip)
      command({of(i, kCompute, kWrite, kGeneral, {0, kWhole, mip, 1, layer, 1})});
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, DisjointBytesDoNotMeet) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite, kUndefined, {0, 512})});
  command({of(b, kCompute, kWrite, kUndefined, {512, 512})});
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, AtomicsDoNotRaceWithEachOther) {
  const ObjectIndex b = buffer("b");
  Touch counting = of(b, kCompute, kRead | kWrite);
  counting.is_atomic = true;
  host(true, b);
  command({counting});
  command({counting});
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, BytesHandedOverBehindABarrierPass) {
  const ObjectIndex a = image("a", 0, 7);
  const ObjectIndex b = image("b", 0, 7);
  barrier(a, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(a, kCompute, kWrite, kGeneral)});
  barrier(b, kCompute, kWrite, kColor, kColorWrite, kUndefined, kTarget);
  clear(b, kColor, kColorWrite, kTarget);
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, HostReadsBehindABarrierAndAWait) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCopy, kCopyWrite)}, "vkCmdCopyBuffer");
  barrier(kEverything, kCopy, kCopyWrite, kHost, VK_ACCESS_2_HOST_READ_BIT);
  plain(Event::Kind::kSubmit, 1);
  plain(Event::Kind::kWait, 1);
  host(false, b);
  host(true, b);
  EXPECT_THAT(found(), IsEmpty());
}

// ---- planted faults, each found ----

TEST_F(HazardModel, ReadAfterWriteWithoutABarrier) {
  const ObjectIndex b = buffer("list.items");
  pass("make");
  command({of(b, kCompute, kWrite)});
  pass("use");
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre("g.toml:3: error: frame 0, pass 'use', vkCmdDraw: 'list.items' is read while "
                                   "vkCmdDispatch of pass 'make' may still write\n"
                                   "  found:    no barrier in between\n"
                                   "  expected: a barrier from COMPUTE_SHADER (SHADER_STORAGE_WRITE) to "
                                   "FRAGMENT_SHADER (SHADER_STORAGE_READ)"));
}

TEST_F(HazardModel, WriteAfterReadWithoutABarrier) {
  const ObjectIndex b = buffer("list.items");
  host(true, b);
  pass("use");
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  pass("make");
  command({of(b, kCompute, kWrite)});
  EXPECT_THAT(found(), ElementsAre("g.toml:3: error: frame 0, pass 'make', vkCmdDispatch: 'list.items' is written "
                                   "while vkCmdDraw of pass 'use' may still read\n"
                                   "  found:    no barrier in between\n"
                                   "  expected: a barrier from FRAGMENT_SHADER (nothing) to COMPUTE_SHADER "
                                   "(SHADER_STORAGE_WRITE)"));
}

TEST_F(HazardModel, WriteAfterWriteWithoutABarrier) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  command({of(b, kCompute, kWrite)});
  EXPECT_THAT(found(), ElementsAre(HasSubstr("'b' is written while vkCmdDispatch may still write")));
}

TEST_F(HazardModel, ExecutionBarrierAloneForAWriteAfterAWrite) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCompute, 0, kCompute, 0);
  command({of(b, kCompute, kWrite)});
  EXPECT_THAT(found(), ElementsAre(HasSubstr("before what vkCmdDispatch wrote is available")));
}

TEST_F(HazardModel, BarrierFromAnotherStage) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCopy, kCopyWrite, kFragment, kRead);
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("may still write")));
}

TEST_F(HazardModel, BarrierToAnotherStage) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCompute, kWrite, kFragment, kRead);
  command({of(b, kVertex, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("found:    barriers order it before FRAGMENT_SHADER|LATE_FRAGMENT_TESTS|"
                                             "COLOR_ATTACHMENT_OUTPUT alone")))
      << "a fragment shader waits, and what comes later in its draw; the vertex shader does not";
}

TEST_F(HazardModel, BarrierWithoutTheWritingAccess) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCompute, kCopyWrite, kFragment, kRead);
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("'b' is read before what vkCmdDispatch wrote is available")));
}

TEST_F(HazardModel, BarrierWithoutTheReadingAccess) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCompute, kWrite, kFragment, kSampled);
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(),
              ElementsAre("error: frame 0, vkCmdDraw: 'b' is read, and what vkCmdDispatch wrote is not visible "
                          "to it\n"
                          "  found:    in FRAGMENT_SHADER it is visible to SHADER_SAMPLED_READ\n"
                          "  expected: a barrier from COMPUTE_SHADER (SHADER_STORAGE_WRITE) to "
                          "FRAGMENT_SHADER (SHADER_STORAGE_READ)"));
}

TEST_F(HazardModel, BarrierOnAnotherBuffer) {
  const ObjectIndex b = buffer("b");
  const ObjectIndex c = buffer("c");
  command({of(b, kCompute, kWrite)});
  barrier(c, kCompute, kWrite, kFragment, kRead);
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("before what vkCmdDispatch wrote is available")))
      << "another resource's barrier orders, and flushes nothing here";
}

TEST_F(HazardModel, BarrierOnAnotherPartOfTheBuffer) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite, kUndefined, {512, 512})});
  barrier(b, kCompute, kWrite, kFragment, kRead, kUndefined, kUndefined, {0, 512});
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("before what vkCmdDispatch wrote is available")));
}

TEST_F(HazardModel, ChainWithAGap) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCompute, kWrite, kCopy, kCopyRead);
  barrier(b, kVertex, 0, kFragment, kRead);
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("may still write")));
}

TEST_F(HazardModel, TransitionOfAnImageInUse) {
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(i, kCompute, kWrite, kGeneral)});
  barrier(i, kCopy, kCopyWrite, kFragment, kSampled, kGeneral, kReadOnly);
  command({of(i, kFragment, kSampled, kReadOnly)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre("error: frame 0, vkCmdPipelineBarrier2: 'i' changes its layout while vkCmdDispatch "
                                   "may still use 'i'\n"
                                   "  found:    a barrier from COPY\n"
                                   "  expected: a barrier from COMPUTE_SHADER (SHADER_STORAGE_WRITE)"));
}

TEST_F(HazardModel, TransitionBeforeTheWritesAreAvailable) {
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(i, kCompute, kWrite, kGeneral)});
  barrier(i, kCompute, 0, kFragment, kSampled, kGeneral, kReadOnly);
  command({of(i, kFragment, kSampled, kReadOnly)}, "vkCmdDraw");
  EXPECT_THAT(found(),
              ElementsAre(HasSubstr("changes its layout before what vkCmdDispatch wrote to 'i' is available")));
}

TEST_F(HazardModel, MissingTransition) {
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(i, kCompute, kWrite, kGeneral)});
  barrier(kEverything, kCompute, kWrite, kFragment, kSampled);
  command({of(i, kFragment, kSampled, kReadOnly)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre("error: frame 0, vkCmdDraw: 'i' is not in the layout that the command names\n"
                                   "  found:    GENERAL\n"
                                   "  expected: a barrier from GENERAL to SHADER_READ_ONLY_OPTIMAL for FRAGMENT_SHADER "
                                   "(SHADER_SAMPLED_READ)"));
}

TEST_F(HazardModel, TransitionFromAnotherLayout) {
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(i, kCompute, kWrite, kGeneral)});
  barrier(i, kCompute, kWrite, kFragment, kSampled, kSource, kReadOnly);
  EXPECT_THAT(found(), ElementsAre("error: frame 0, vkCmdPipelineBarrier2: the barrier's old layout "
                                   "TRANSFER_SRC_OPTIMAL of 'i' is not what the image is in\n"
                                   "  found:    GENERAL\n"
                                   "  expected: a barrier from GENERAL"));
}

TEST_F(HazardModel, LayoutThatDoesNotAllowTheUse) {
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kCompute, kWrite, kUndefined, kReadOnly);
  command({of(i, kCompute, kWrite, kReadOnly)});
  EXPECT_THAT(found(), ElementsAre("error: frame 0, vkCmdDispatch: 'i' is used in a layout that does not allow it\n"
                                   "  found:    SHADER_READ_ONLY_OPTIMAL for SHADER_STORAGE_WRITE"));
}

TEST_F(HazardModel, ContentsThatATransitionThrewAway) {
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(i, kCompute, kWrite, kGeneral)});
  barrier(i, kCompute, kWrite, kFragment, kSampled, kUndefined, kReadOnly);
  command({of(i, kFragment, kSampled, kReadOnly)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("'i' is read, and its contents are undefined")));
}

TEST_F(HazardModel, ColourAttachmentSampledWithoutABarrier) {
  const ObjectIndex i = image("gbuffer.normal");
  barrier(i, 0, 0, kColor, kColorWrite, kUndefined, kGeneral);
  clear(i, kColor, kColorWrite, kGeneral);
  command({of(i, kFragment, kSampled, kGeneral)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("expected: a barrier from COLOR_ATTACHMENT_OUTPUT "
                                             "(COLOR_ATTACHMENT_WRITE) to FRAGMENT_SHADER (SHADER_SAMPLED_READ)")));
}

TEST_F(HazardModel, ColourAttachmentDrawnIntoTwiceWithoutABarrier) {
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kColor, kColorWrite, kUndefined, kTarget);
  clear(i, kColor, kColorWrite, kTarget);
  clear(i, kColor, kColorWrite, kTarget);
  EXPECT_THAT(found(), ElementsAre(HasSubstr("'i' is written while vkCmdBeginRendering may still write")));
}

TEST_F(HazardModel, DepthAttachmentSampledBehindHalfABarrier) {
  // The clear writes in the early tests, the draws in the late ones: both must be named.
  const ObjectIndex i = image("depth");
  barrier(i, 0, 0, kEarly | kLate, kDepthBoth, kUndefined, kDepth);
  clear(i, kEarly | kLate, kDepthBoth, kDepth);
  barrier(i, kEarly, kDepthWrite, kFragment, kSampled, kDepth, kReadOnly);
  command({of(i, kFragment, kSampled, kReadOnly)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("expected: a barrier from LATE_FRAGMENT_TESTS "
                                             "(DEPTH_STENCIL_ATTACHMENT_WRITE)")));
}

TEST_F(HazardModel, DepthAttachmentTestedAndSampledAtOnceInAReadOnlyLayoutPasses) {
  const ObjectIndex i = image("depth");
  barrier(i, 0, 0, kEarly | kLate, kDepthBoth, kUndefined, kDepth);
  clear(i, kEarly | kLate, kDepthBoth, kDepth);
  barrier(i, kEarly | kLate, kDepthWrite, kEarly | kLate | kFragment,
          VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | kSampled, kDepth, kDepthRead);
  command({of(i, kEarly | kLate, VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT, kDepthRead)}, "vkCmdBeginRendering");
  command({of(i, kFragment, kSampled, kDepthRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, AttachmentSampledWhileItIsDrawnInto) {
  const ObjectIndex i = image("i");
  barrier(i, 0, 0, kColor | kFragment, kColorWrite | kSampled, kUndefined, kGeneral);
  clear(i, kColor, kColorWrite, kGeneral);
  command({of(i, kFragment, kSampled, kGeneral)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("'i' is read while vkCmdBeginRendering may still write")));
}

TEST_F(HazardModel, IndirectArgumentsReadTooEarly) {
  const ObjectIndex b = buffer("list.count");
  command({of(b, kCompute, kWrite)});
  barrier(b, kCompute, kWrite, kCompute, kRead);
  command({of(b, kIndirect, VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT)}, "vkCmdDispatchIndirect");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("expected: a barrier from COMPUTE_SHADER (SHADER_STORAGE_WRITE) to "
                                             "DRAW_INDIRECT (INDIRECT_COMMAND_READ)")));
}

TEST_F(HazardModel, BytesHandedOverWithoutABarrier) {
  const ObjectIndex a = image("a", 0, 7);
  const ObjectIndex b = image("b", 512, 7);
  barrier(a, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(a, kCompute, kWrite, kGeneral)});
  barrier(b, 0, 0, kColor, kColorWrite, kUndefined, kTarget);
  clear(b, kColor, kColorWrite, kTarget);
  EXPECT_THAT(found()[0], HasSubstr("'b' changes its layout while vkCmdDispatch may still use 'a'"));
}

TEST_F(HazardModel, BytesHandedOverBeforeTheWritesAreAvailable) {
  const ObjectIndex a = buffer("a", 0, 7);
  const ObjectIndex b = buffer("b", 512, 7);
  command({of(a, kCompute, kWrite)});
  barrier(b, kCompute, 0, kCopy, kCopyWrite);
  command({of(b, kCopy, kCopyWrite)}, "vkCmdCopyBuffer");
  EXPECT_THAT(found(),
              ElementsAre("error: frame 0, vkCmdCopyBuffer: 'b' is written before what vkCmdDispatch to 'a' on "
                          "the same bytes wrote is available\n"
                          "  found:    barriers in between that do not name the writing access\n"
                          "  expected: a barrier from COMPUTE_SHADER (SHADER_STORAGE_WRITE) to COPY "
                          "(TRANSFER_WRITE)"));
}

TEST_F(HazardModel, ImageReadAfterItsBytesWentToAnother) {
  const ObjectIndex a = image("a", 0, 7);
  const ObjectIndex b = buffer("b", 0, 7);
  barrier(a, 0, 0, kCompute, kWrite, kUndefined, kGeneral);
  command({of(a, kCompute, kWrite, kGeneral)});
  barrier(kEverything, kCompute, kWrite, kCompute, kRead | kWrite);
  command({of(b, kCompute, kWrite)});
  barrier(kEverything, kCompute, kWrite, kCompute, kRead | kWrite);
  command({of(a, kCompute, kRead, kGeneral)});
  EXPECT_THAT(found(), ElementsAre(HasSubstr("found:    UNDEFINED: 'b' took its bytes")));
}

TEST_F(HazardModel, BufferReadAfterItsBytesWentToAnother) {
  const ObjectIndex a = buffer("a", 0, 7);
  const ObjectIndex b = buffer("b", 0, 7);
  command({of(a, kCompute, kWrite)});
  barrier(kEverything, kCompute, kWrite, kCompute, kRead | kWrite);
  command({of(b, kCompute, kWrite)});
  barrier(kEverything, kCompute, kWrite, kCompute, kRead | kWrite);
  command({of(a, kCompute, kRead)});
  EXPECT_THAT(found(), ElementsAre(HasSubstr("'a' is read, and its contents are undefined\n"
                                             "  found:    'b' took its bytes")));
}

TEST_F(HazardModel, TransientBufferReadInTheNextFrame) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  plain(Event::Kind::kFrame, 1);
  discard(b);
  barrier(b, kCompute, kWrite, kCompute, kRead);
  command({of(b, kCompute, kRead)});
  EXPECT_THAT(found(), ElementsAre(HasSubstr("frame 1, vkCmdDispatch: 'b' is read, and its contents are undefined\n"
                                             "  found:    nobody wrote it in this frame")));
}

TEST_F(HazardModel, TransientBufferWhoseMakerHadNothingToWrite) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  for (std::uint64_t frame = 1; frame < 3; ++frame) {
    plain(Event::Kind::kFrame, frame);
    discard(b);
    accept(b);
    barrier(b, kCompute, kWrite, kCompute, kRead);
    command({of(b, kCompute, kRead)});
  }
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(HazardModel, LastReadOfAFrameAndFirstWriteOfTheNext) {
  const ObjectIndex b = buffer("history");
  host(true, b);
  for (std::uint64_t frame = 0; frame < 3; ++frame) {
    plain(Event::Kind::kFrame, frame);
    command({of(b, kCompute, kWrite)});
    barrier(b, kCompute, kWrite, kFragment, kRead);
    command({of(b, kFragment, kRead)}, "vkCmdDraw");
    plain(Event::Kind::kSubmit, frame + 1);
    plain(Event::Kind::kWait, frame + 1);
  }
  EXPECT_THAT(
      found(),
      ElementsAre(HasSubstr("frame 1, vkCmdDispatch: 'history' is written while vkCmdDispatch in the frame before "
                            "may still write"),
                  HasSubstr("frame 1, vkCmdDispatch: 'history' is written while vkCmdDraw in the frame before "
                            "may still read")))
      << "waiting on the host orders nothing: a frame may be in flight";
}

TEST_F(HazardModel, LayoutThatAFrameLeavesToTheNext) {
  const ObjectIndex i = image("history");
  barrier(i, 0, 0, kCompute, kRead | kWrite, kUndefined, kGeneral);
  for (std::uint64_t frame = 0; frame < 3; ++frame) {
    plain(Event::Kind::kFrame, frame);
    command({of(i, kCompute, kWrite, kGeneral)});
    barrier(i, kCompute, kWrite, kFragment, kSampled, kGeneral, kReadOnly);
    command({of(i, kFragment, kSampled, kReadOnly)}, "vkCmdDraw");
    plain(Event::Kind::kSubmit, frame + 1);
  }
  EXPECT_THAT(found()[0], HasSubstr("frame 1, vkCmdDispatch: 'history' is not in the layout that the command names"));
}

TEST_F(HazardModel, HostReadsBeforeTheFence) {
  const ObjectIndex b = buffer("staging");
  command({of(b, kCopy, kCopyWrite)}, "vkCmdCopyImageToBuffer");
  barrier(kEverything, kCopy, kCopyWrite, kHost, VK_ACCESS_2_HOST_READ_BIT);
  plain(Event::Kind::kSubmit, 1);
  host(false, b);
  EXPECT_THAT(found(),
              ElementsAre("error: frame 0, host read: the host reads 'staging' while vkCmdCopyImageToBuffer may "
                          "still use it\n"
                          "  found:    a submission that nobody has waited for\n"
                          "  expected: a wait for its fence"));
}

TEST_F(HazardModel, HostReadsWithoutABarrierToIt) {
  const ObjectIndex b = buffer("staging");
  command({of(b, kCopy, kCopyWrite)}, "vkCmdCopyImageToBuffer");
  plain(Event::Kind::kSubmit, 1);
  plain(Event::Kind::kWait, 1);
  host(false, b);
  EXPECT_THAT(
      found(),
      ElementsAre("error: frame 0, host read: the host reads 'staging', and what vkCmdCopyImageToBuffer wrote is "
                  "not visible to it\n"
                  "  found:    a wait for the fence alone makes it available, not visible to the host\n"
                  "  expected: a barrier from COPY (TRANSFER_WRITE) to HOST (HOST_READ)"));
}

TEST_F(HazardModel, HostWritesWhileTheDeviceReads) {
  const ObjectIndex b = buffer("values");
  host(true, b);
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  plain(Event::Kind::kSubmit, 1);
  host(true, b);
  EXPECT_THAT(found(), ElementsAre(HasSubstr("the host writes 'values' while vkCmdDraw may still use it")));
}

TEST_F(HazardModel, DestroyedWhileInUse) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  plain(Event::Kind::kSubmit, 1);
  Event event;
  event.kind = Event::Kind::kDestroy;
  event.command = "vkDestroyBuffer";
  event.touches = {of(b, 0, 0)};
  stream_.events.push_back(event);
  EXPECT_THAT(found(), ElementsAre(HasSubstr("'b' is destroyed while vkCmdDispatch may still use it")));
}

TEST_F(HazardModel, CopyOutOfAnImageThatIsStillDrawnInto) {
  const ObjectIndex i = image("display.color");
  const ObjectIndex b = buffer("staging");
  barrier(i, 0, 0, kColor, kColorWrite, kUndefined, kTarget);
  clear(i, kColor, kColorWrite, kTarget);
  barrier(i, kFragment, kWrite, kCopy, kCopyRead, kTarget, kSource);
  command({of(i, kCopy, kCopyRead, kSource), of(b, kCopy, kCopyWrite)}, "vkCmdCopyImageToBuffer");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("changes its layout while vkCmdBeginRendering may still use")));
}

TEST_F(HazardModel, FramesThatRepeatAFaultTellItOnce) {
  const ObjectIndex b = buffer("b");
  for (std::uint64_t frame = 0; frame < 50; ++frame) {
    plain(Event::Kind::kFrame, frame);
    command({of(b, kCompute, kWrite)});
    command({of(b, kFragment, kRead)}, "vkCmdDraw");
    barrier(kEverything, kFragment, 0, kCompute, 0);
    barrier(kEverything, kCompute, kWrite, kCompute, kWrite);
  }
  EXPECT_EQ(found().size(), 1U);
}

TEST_F(HazardModel, BarriersOfOneCommandDoNotChain) {
  const ObjectIndex b = buffer("b");
  command({of(b, kCompute, kWrite)});
  Event event;
  event.kind = Event::Kind::kBarrier;
  event.command = "vkCmdPipelineBarrier2";
  event.dependencies = {{b, {}, kCompute, kCopy, kWrite, kCopyRead, kUndefined, kUndefined},
                        {b, {}, kCopy, kFragment, 0, kRead, kUndefined, kUndefined}};
  stream_.events.push_back(event);
  command({of(b, kFragment, kRead)}, "vkCmdDraw");
  EXPECT_THAT(found(), ElementsAre(HasSubstr("may still write")));
}

}  // namespace
}  // namespace heddle::vulkan::hazard
