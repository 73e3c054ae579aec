// SPDX-License-Identifier: Apache-2.0
// What the files of the C API share: the objects behind its handles, and how calls begin and end. Nothing throws out of
// them.
#pragma once

#include "graph/execute.hpp"
#include "image/image.hpp"
#include "json.hpp"
#include "scene/scene.hpp"
#include "scene/upload.hpp"

#include <heddle/heddle.h>

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <functional>
#include <set>

struct heddle_host {
  std::function<void(heddle::Severity, std::string_view)> log;
  std::function<void(std::string_view, double)> progress;  // empty: nobody is told
  std::string device_name;
  bool validation = false;
  bool check = false;
  std::atomic<bool> is_cancelled{false};
  std::unique_ptr<heddle::Registry> registry;
  std::unique_ptr<heddle::vulkan::Device> device;
  std::unique_ptr<heddle::graph::HostServices> services;
  std::string error;
  std::string list_text, devices_text, doctor_text, compare_text, schema_text;
  heddle::image::Image image;

  heddle::vulkan::Device& open_device() {
    if (!device)
      device =
          std::make_unique<heddle::vulkan::Device>(heddle::vulkan::DeviceOptions{device_name, validation, check, log});
    return *device;
  }
};

struct heddle_scene {
  heddle_host* host = nullptr;
  heddle::scene::Scene scene;
  heddle::scene::Snapshot snapshot;
  std::string description, files;
};

struct heddle_graph {
  heddle_host* host = nullptr;
  std::function<heddle::graph::WrittenGraph()> read;  // from its file or text
  std::vector<std::string> settings;                  // applied to what that reads, in their order
  heddle::graph::WrittenGraph written;
  std::vector<std::string> kept;
  std::unique_ptr<heddle::graph::Executor> executor;
  std::string explanation, pass_explanation, description, stats, check_report, inspection, files, got, job_report;
  heddle::graph::Executor::ReadBack read_back;
};

namespace heddle::api {

/// Message of this thread's last call without a host that failed.
std::string& hostless_error();

/// Runs `body`; what it throws becomes the host's message and a status.
template <class Body>
heddle_status guarded(std::string& error, Body body) {
  try {
    body();
    return HEDDLE_OK;
  } catch (const Error& thrown) {
    error = thrown.what();
    return thrown.status();
  } catch (const std::bad_alloc&) {
    error = "error: out of memory";
    return HEDDLE_FAILED;
  } catch (const std::exception& thrown) {
    error = fmt::format("error: {}", thrown.what());
    return HEDDLE_FAILED;
  }
}

/// Copies a caller's structure, older or newer, into the current definition; missing fields stay zero.
template <class Structure>
Structure take(const Structure* given, std::string_view name) {
  Structure taken{};
  if (given == nullptr) throw Error(HEDDLE_BUG, fmt::format("{} is NULL", name));
  std::uint32_t size = 0;
  std::memcpy(&size, given, sizeof size);
  if (size < sizeof size) throw Error(HEDDLE_BUG, fmt::format("{}.struct_size is {}: set it to sizeof", name, size));
  std::memcpy(&taken, given, std::min<std::size_t>(size, sizeof taken));
  return taken;
}

inline std::string text_or_empty(const char* text) {
  return text != nullptr ? text : "";
}

inline std::string paths_json(const std::set<std::filesystem::path>& paths) {
  Json json = Json::array();
  for (const std::filesystem::path& path : paths) json.push_back(path.string());
  return heddle::write_json(json);
}

}  // namespace heddle::api
