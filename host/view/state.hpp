// SPDX-License-Identifier: Apache-2.0
// What the two threads tell each other: a report of everything that can be shown, made by the one that renders and
// copied by the one that has the window. Read this first.
#pragma once

#include "json.hpp"
#include "profile/statistics.hpp"

#include <heddle/heddle.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace heddle::view {

/// A and B.
using Variant = std::size_t;
constexpr std::size_t kVariants = 2;
constexpr std::array<const char*, kVariants> kVariantNames{"A", "B"};

/// The graph's output, as a file of 8 bits would hold it.
struct Picture {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> rgba;  // top row first; one channel as grey; alpha 255: a window has nothing behind it
  std::uint64_t serial = 0;        // of its content
};

/// One step of a knob's ladder, timed.
struct Cost {
  Json value;
  profile::Estimate ms;  // frame, from its first submission to its last fence
  std::string error;     // why it has no time
};
struct Costs {
  std::vector<Cost> steps;
  std::string situation;  // what was measured: settings beside the knob, camera, time, scene
};

/// A stage's times in frames that were submitted stage by stage, medians over the frames.
struct StageTime {
  std::string pass, stage;
  double wall_ms = 0, cpu_ms = 0;
};
struct Times {
  std::vector<StageTime> stages;
  profile::Estimate frame_ms, looked_at_ms;  // frames that measure nothing else; frames that these times are of
};

struct Loop {
  std::string pass;
  std::uint32_t done = 0, total = 0;
};

struct VariantReport {
  bool is_there = false;
  std::string graph;
  std::vector<std::string> settings;  // that were made, in their order
  Json description;                   // heddle_graph_describe
  std::uint64_t revision = 0;         // counts changes of the graph that succeeded
  std::string error;    // of the last frame, or of reading files again; the picture is then an earlier one
  std::string refused;  // of the last order that could not be done; everything is then as before it
  std::shared_ptr<const Picture> picture;
  double submit_ms = 0;  // of the last frame
  double read_ms = 0;    // until its picture was here, and compared with the one before
  std::vector<Loop> loops;
  std::string situation;               // as of Costs, knobs included
  std::map<std::string, Costs> costs;  // by the knob's key
  Times times;
  std::string explanation;  // of `explained_pass`, "": of the graph, at `explained_revision`
  std::string explained_pass;
  std::uint64_t explained_revision = 0;
  std::string inspection;  // text of heddle_inspect
};

struct Report {
  std::array<VariantReport, kVariants> variants;
  std::shared_ptr<const Json> list;   // heddle_list
  std::shared_ptr<const Json> scene;  // heddle_scene_describe
  heddle_camera camera{};             // in use
  std::string device;
  double time = 0;
  bool is_playing = false;
  std::uint64_t frames = 0;      // rendered, of A and B
  std::uint64_t submits = 0;     // of those frames
  std::uint64_t read_bytes = 0;  // of pictures, from the device
  double read_ms = 0;
  std::uint64_t orders_done = 0;
  std::string activity;               // what takes long now; empty: nothing
  bool is_settled = false;            // nothing is left to render
  std::vector<std::string> messages;  // the last lines that the host told
  std::string warnings;               // those since the last order
};

}  // namespace heddle::view
