// SPDX-License-Identifier: Apache-2.0
// Every graph that comes with Heddle, and every technique in the default one: the check finds nothing in several
// frames, bytes depend neither on the order nor on memory, and each single barrier is needed: whichever is taken away
// or weakened in the recorded stream, the hazard checker misses it.
#include "graph/execute.hpp"
#include "graph/execute_state.hpp"
#include "graph/written.hpp"
#include "scene/arrays.hpp"
#include "vulkan/hazard_model.hpp"
#include "vulkan/hazard_recorder.hpp"

#include <gmock/gmock.h>

#include <functional>

namespace heddle {
namespace {

using testing::IsEmpty;
namespace hazard = vulkan::hazard;

/// A floor and a leaning triangle over it, a sun, and a lamp.
scene::Scene small_scene() {
  scene::Scene made;
  scene::Material& material = made.materials.emplace_back();
  material.name = "grey";
  material.textures.fill(HEDDLE_NONE);
  material.record = {};
  std::fill_n(material.record.base_color, 4, 0.5F);
  material.record.base_color[3] = material.record.roughness = material.record.normal_scale = 1.0F;
  material.record.occlusion_strength = material.record.uv_rotation_scale[0] = 1.0F;
  material.record.uv_rotation_scale[3] = 1.0F;
  material.record.ior = 1.5F;
  const std::vector<float> positions{-4, 0, -4, -4, 0, 4, 4, 0, 4, 4, 0, -4, -1, 0, 0, 1, 0, 0, 0, 2, -0.5F};
  const std::vector<std::uint32_t> indices{0, 1, 2, 0, 2, 3, 4, 5, 6};
  heddle_mesh mesh{};
  mesh.struct_size = sizeof mesh;
  mesh.vertex_count = static_cast<std::uint32_t>(positions.size() / 3);
  mesh.index_count = static_cast<std::uint32_t>(indices.size());
  mesh.positions = positions.data();
  mesh.indices = indices.data();
  made.meshes.push_back(scene::make_mesh(mesh, "shape", 0, material));
  made.instances.push_back({"shape", 0});
  for (const std::uint32_t type : {HEDDLE_LIGHT_DIRECTIONAL, HEDDLE_LIGHT_SPOT}) {
    scene::Light& light = made.lights.emplace_back();
    light.position = {0, 3, 1};
    light.record.type = type;
    light.record.flags = HEDDLE_LIGHT_CASTS_SHADOW;
    light.record.direction[1] = -1;
    light.record.tangent[0] = 1;
    std::fill_n(light.record.intensity, 3, 10.0F);
    light.record.cos_inner = 0.9F;
    light.record.cos_outer = 0.6F;
    light.record.id = static_cast<std::uint32_t>(made.lights.size() - 1);
  }
  made.content_revision = 1;
  return made;
}

/// All frames are rendered: loops begin anew in each.
graph::FrameOptions anew() {
  graph::FrameOptions options;
  options.anew = true;
  return options;
}

struct Variant {
  std::string name, file;
  std::vector<std::string> settings;
};
void PrintTo(const Variant& variant, std::ostream* out) {
  *out << variant.name;
}

class ShippedGraph : public testing::TestWithParam<Variant> {
 protected:
  ShippedGraph()
      : registry_({HEDDLE_BUILD_DIR "/lib/heddle/plugins"}),
        device_(device_options()),
        services_{registry_, [this]() -> vulkan::Device& { return device_; },
                  std::filesystem::temp_directory_path() / "heddle_check_cache", [](Severity, std::string_view) {}},
        scene_(small_scene()) {}

  static vulkan::DeviceOptions device_options() {
    vulkan::DeviceOptions options;
    options.check = true;
    return options;
  }

  graph::ResolvedGraph resolved() {
    graph::WrittenGraph written = graph::read_graph(HEDDLE_SOURCE_DIR "/scripts/graphs/" + GetParam().file);
    graph::apply_setting(written, "extent=[64, 48]");
    for (const std::string& setting : GetParam().settings) graph::apply_setting(written, setting);
    return graph::resolve(written, registry_);
  }

  Registry registry_;
  vulkan::Device device_;
  graph::HostServices services_;
  scene::Scene scene_;
};

TEST_P(ShippedGraph, FramesHaveNoHazardAndNoWrongNumber) {
  graph::Executor executor(services_, resolved());
  for (int frame = 0; frame < 3; ++frame) EXPECT_NO_THROW(executor.render(scene_, anew()));
  // Loops go on where they were, or are complete; then they begin anew.
  for (int frame = 0; frame < 2; ++frame) EXPECT_NO_THROW(executor.render(scene_, {}));
  EXPECT_NO_THROW(executor.render(scene_, anew()));
}

TEST_P(ShippedGraph, BytesDependNeitherOnTheOrderNorOnMemory) {
  graph::Executor executor(services_, resolved());
  const graph::CheckReport report = executor.check(scene_, {}, 2);
  EXPECT_EQ(report.seen_both_ways, report.unordered_pairs);
  EXPECT_EQ(report.poisons.size(), device_.info().is_lavapipe ? 2U : 0U);
  RecordProperty("orders", static_cast<int>(report.orders));
  RecordProperty("unordered_pairs", static_cast<int>(report.unordered_pairs));
}

/// Stages that have nothing to do leave barriers that nobody would miss.
class IdleStages : public ShippedGraph {};

TEST_P(IdleStages, HaveNoHazardAndBytesThatDependOnNothingElse) {
  graph::Executor executor(services_, resolved());
  for (int frame = 0; frame < 3; ++frame) EXPECT_NO_THROW(executor.render(scene_, anew()));
  EXPECT_NO_THROW((void)executor.check(scene_, {}, 2));
}

INSTANTIATE_TEST_SUITE_P(Check, IdleStages,
                         testing::Values(Variant{"tiled_without_lists", "tiled.toml", {}},
                                         Variant{"reduced_depth", "deferred.toml", {"ao.technique=ssao"}},
                                         // Only the first frame begins the mean that the others are blended into.
                                         Variant{"blended",
                                                 "supersampled.toml",
                                                 {"aa.technique=multiframe", "aa.params.samples=3",
                                                  "aa.params.accumulator=rgba32f", "aa.params.accumulation=blend"}}),
                         [](const auto& tested) { return tested.param.name; });

/// After each frame the application copies the output out, as heddle_read does, but brings no barrier of its own.
void add_read_backs(hazard::Stream& stream, const std::string& name) {
  const auto output = std::find_if(stream.objects.begin(), stream.objects.end(),
                                   [&](const hazard::Object& object) { return object.name == name; });
  hazard::Event copy;
  copy.command = "vkCmdCopyImageToBuffer";
  hazard::Touch touch;
  touch.object = static_cast<hazard::ObjectIndex>(output - stream.objects.begin());
  touch.stages = VK_PIPELINE_STAGE_2_COPY_BIT;
  touch.access = VK_ACCESS_2_TRANSFER_READ_BIT;
  touch.layout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  copy.touches = {touch};
  for (std::size_t i = 0; i < stream.events.size(); ++i) {
    const hazard::Event& event = stream.events[i];
    if (event.kind != hazard::Event::Kind::kFrame || event.number == 0) continue;
    stream.events.insert(stream.events.begin() + static_cast<std::ptrdiff_t>(i++), copy);
  }
}

/// Plays the stream with one dependency changed; an empty answer: nothing was found.
std::vector<Diagnostic> found_in(const hazard::Stream& stream) {
  hazard::Model model;
  model.play(stream);
  return model.take_findings();
}

TEST_P(ShippedGraph, EveryBarrierIsMissedWhenItIsTakenAwayOrWeakened) {
  graph::Executor executor(services_, resolved());
  for (int frame = 0; frame < 3; ++frame) executor.render(scene_, anew());
  hazard::Stream stream = device_.recorder()->stream();
  const graph::ResolvedGraph& rendered = executor.graph();
  add_read_backs(stream, rendered.resources[rendered.output].name);
  ASSERT_THAT(found_in(stream), IsEmpty());

  using Change = std::function<bool(hazard::Event&, std::size_t)>;  // false: would change nothing
  const std::vector<std::pair<std::string, Change>> changes{
      {"taken away",
       [](hazard::Event& event, std::size_t i) {
         event.dependencies.erase(event.dependencies.begin() + static_cast<std::ptrdiff_t>(i));
         return true;
       }},
      {"from no stage",
       [](hazard::Event& event, std::size_t i) {
         event.dependencies[i].source_stages = VK_PIPELINE_STAGE_2_TOP_OF_PIPE_BIT;
         return true;
       }},
      {"to no stage",
       [](hazard::Event& event, std::size_t i) {
         event.dependencies[i].target_stages = VK_PIPELINE_STAGE_2_BOTTOM_OF_PIPE_BIT;
         return true;
       }},
      {"from no access",
       [](hazard::Event& event, std::size_t i) {
         if (!hazard::is_write(event.dependencies[i].source_access)) return false;
         event.dependencies[i].source_access = 0;
         return true;
       }},
      {"to no access",
       [](hazard::Event& event, std::size_t i) {
         hazard::Dependency& dependency = event.dependencies[i];
         // A write after reads in the same layout needs their end alone.
         if (!hazard::is_write(dependency.source_access) && dependency.old_layout == dependency.new_layout)
           return false;
         dependency.target_access = 0;
         return true;
       }},
      {"to another layout",
       [](hazard::Event& event, std::size_t i) {
         hazard::Dependency& dependency = event.dependencies[i];
         if (dependency.new_layout == VK_IMAGE_LAYOUT_UNDEFINED) return false;
         dependency.new_layout = dependency.new_layout == VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL
                                     ? VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL
                                     : VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
         return true;
       }},
      {"from another layout",
       [](hazard::Event& event, std::size_t i) {
         hazard::Dependency& dependency = event.dependencies[i];
         if (dependency.old_layout == VK_IMAGE_LAYOUT_UNDEFINED) return false;
         dependency.old_layout = dependency.old_layout == VK_IMAGE_LAYOUT_PREINITIALIZED
                                     ? VK_IMAGE_LAYOUT_GENERAL
                                     : VK_IMAGE_LAYOUT_PREINITIALIZED;
         return true;
       }},
  };
  // The middle frame: what came before it and what comes after it are there.
  const auto frame_starts = [&](std::uint64_t number) {
    return static_cast<std::size_t>(std::find_if(stream.events.begin(), stream.events.end(),
                                                 [&](const auto& event) {
                                                   return event.kind == hazard::Event::Kind::kFrame &&
                                                          event.number == number;
                                                 }) -
                                    stream.events.begin());
  };
  // Frames and iterations of loops end with a fence, which makes what they wrote available; and a stage that is kept
  // records nothing behind its barriers. So the accesses of a barrier can only be missed where something of this
  // submission is written before it, or touched behind it until the object's next barrier.
  const auto is_written_before = [&](std::size_t e, hazard::ObjectIndex object) {
    for (std::size_t b = e; b-- > 0 && stream.events[b].kind != hazard::Event::Kind::kWait;)
      for (const hazard::Touch& touch : stream.events[b].touches)
        if (touch.object == object && hazard::is_write(touch.access)) return true;
    return false;
  };
  const auto is_touched_behind = [&](std::size_t e, hazard::ObjectIndex object) {
    for (std::size_t b = e + 1; b < frame_starts(2); ++b) {
      for (const hazard::Touch& touch : stream.events[b].touches)
        if (touch.object == object) return true;
      for (const hazard::Dependency& dependency : stream.events[b].dependencies)
        if (dependency.object == object) return false;
    }
    return false;
  };
  std::size_t planted = 0;
  for (std::size_t e = frame_starts(1); e < frame_starts(2); ++e) {
    const hazard::Event original = stream.events[e];
    const std::string& label = stream.labels[original.label].text;
    if (original.kind != hazard::Event::Kind::kBarrier || label == "the start of the frame") continue;
    for (std::size_t i = 0; i < original.dependencies.size(); ++i) {
      for (const auto& [what, change] : changes) {
        hazard::Event changed = original;
        if (!change(changed, i)) continue;
        const hazard::Dependency& dependency = original.dependencies[i];
        if (what == "from no access" && !is_written_before(e, dependency.object)) continue;
        if (what == "to no access" && !is_touched_behind(e, dependency.object)) continue;
        ++planted;
        stream.events[e] = std::move(changed);
        EXPECT_FALSE(found_in(stream).empty())
            << label << ": barrier of "
            << (dependency.object == hazard::kEverything ? "everything" : stream.objects[dependency.object].name) << ' '
            << what << "; it is from " << hazard::stages_text(dependency.source_stages) << " ("
            << hazard::access_text(dependency.source_access) << ") to " << hazard::stages_text(dependency.target_stages)
            << " (" << hazard::access_text(dependency.target_access) << "), "
            << hazard::layout_text(dependency.old_layout) << " -> " << hazard::layout_text(dependency.new_layout);
        stream.events[e] = original;
      }
    }
  }
  EXPECT_GE(planted, 20U);
  RecordProperty("planted", static_cast<int>(planted));
}

INSTANTIATE_TEST_SUITE_P(
    Check, ShippedGraph,
    testing::Values(Variant{"deferred", "deferred.toml", {}}, Variant{"studio", "studio.toml", {}},
                    Variant{"furnace", "furnace.toml", {}}, Variant{"reference_ao", "reference_ao.toml", {}},
                    Variant{"no_ao", "deferred.toml", {"ao.technique=none"}},
                    Variant{"no_sky", "deferred.toml", {"sky.technique=none"}},
                    Variant{"no_shadow", "deferred.toml", {"shadow.technique=none", "contact.technique=none"}},
                    Variant{"float32", "deferred.toml", {"gbuffer.params.precision=float32"}},
                    Variant{"tiled", "tiled.toml", {"light_assignment.params.fewest=0"}},
                    Variant{"supersampled", "supersampled.toml", {"aa.params.samples=2"}},
                    Variant{"progressive", "supersampled.toml", {"aa.params.samples=3", "aa.params.mode=progressive"}},
                    Variant{"multiframe",
                            "supersampled.toml",
                            {"aa.technique=multiframe", "aa.params.samples=3", "aa.params.accumulator=rgba16f"}}),
    [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace heddle
