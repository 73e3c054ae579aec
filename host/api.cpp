// SPDX-License-Identifier: Apache-2.0
// The C API of heddle.h on top of the host: hosts, graphs, images; api_scene.cpp has the scene.

#include "api.hpp"

#include "compare/metrics.hpp"
#include "graph/describe.hpp"
#include "graph/inspection.hpp"
#include "graph/report.hpp"
#include "graph/schema.hpp"
#include "graph/settings.hpp"
#include "plugin/list.hpp"
#include "scene/schema.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>

using namespace heddle::api;
using heddle::Error;
using heddle::Json;
using heddle::Severity;
using heddle::write_json;

namespace {

/// Of all artifacts in the cache: hundreds of environments, a small part of a disk.
constexpr std::uint64_t kMostArtifactBytes = std::uint64_t{4} << 30U;

std::vector<std::filesystem::path> split_path(std::string_view text) {
  std::vector<std::filesystem::path> folders;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(':'), text.size());
    if (end > 0) folders.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return folders;
}

std::string_view environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

/// The folder beside libheddle.so with plugins/ and graphs/: lib/heddle.
std::filesystem::path own_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&heddle_version), &info) == 0 || info.dli_fname == nullptr) return {};
  std::error_code ignored;
  const std::filesystem::path library = std::filesystem::canonical(info.dli_fname, ignored);
  return library.parent_path() / "heddle";
}

std::filesystem::path default_cache_folder() {
  if (const auto chosen = environment("HEDDLE_CACHE"); !chosen.empty()) return chosen;
  if (const auto cache = environment("XDG_CACHE_HOME"); !cache.empty()) return std::filesystem::path(cache) / "heddle";
  if (const auto home = environment("HOME"); !home.empty()) return std::filesystem::path(home) / ".cache" / "heddle";
  return std::filesystem::temp_directory_path() / "heddle-cache";
}

}  // namespace

std::string& heddle::api::hostless_error() {
  thread_local std::string error;
  return error;
}

namespace {

/// What was rendered so far goes on where it can: an executor is made once for a graph.
void resolve_into(heddle_graph& graph, heddle::graph::WrittenGraph written) {
  heddle::graph::ResolvedGraph resolved = heddle::graph::resolve(written, *graph.host->registry);
  for (const heddle::Diagnostic& warning : resolved.warnings)
    graph.host->log(Severity::kWarning, heddle::to_text(warning));
  std::vector<std::string> kept;
  for (const std::string& port : graph.kept) {
    const bool is_made = std::ranges::any_of(resolved.resources, [&](const heddle::graph::Resource& resource) {
      return resource.name == port && resource.producer != heddle::graph::kNoIndex;
    });
    if (is_made) {
      kept.push_back(port);
    } else {
      graph.host->log(Severity::kWarning,
                      fmt::format("warning: port '{}' is no longer kept: the graph has no pass that "
                                  "makes it now",
                                  port));
    }
  }
  if (graph.executor) {
    graph.executor->replace(std::move(resolved), kept);
  } else {
    graph.executor = std::make_unique<heddle::graph::Executor>(*graph.host->services, std::move(resolved));
  }
  graph.kept = std::move(kept);
  graph.written = std::move(written);
}

/// Whether two resolved graphs differ in parameter values alone; then these are set in place.
bool set_parameters_in_place(heddle_graph& graph, const heddle::graph::ResolvedGraph& resolved) {
  using heddle::graph::PassIndex;
  const heddle::graph::ResolvedGraph& present = graph.executor->graph();
  if (present.width != resolved.width || present.height != resolved.height || present.output != resolved.output ||
      present.passes.size() != resolved.passes.size() || present.resources.size() != resolved.resources.size()) {
    return false;
  }
  if (!std::ranges::equal(present.resources, resolved.resources, {}, &heddle::graph::Resource::name,
                          &heddle::graph::Resource::name))
    return false;  // another job's artifact
  for (std::size_t i = 0; i < resolved.passes.size(); ++i) {
    const auto& a = present.passes[i];
    const auto& b = resolved.passes[i];
    if (a.name != b.name || a.entry.technique != b.entry.technique || a.serves != b.serves || a.ports != b.ports ||
        a.inout_sources != b.inout_sources || a.dependencies != b.dependencies) {
      return false;
    }
    if (a.functions.size() != b.functions.size()) return false;
    for (std::size_t f = 0; f < a.functions.size(); ++f) {
      if (a.functions[f].role != b.functions[f].role || a.functions[f].join != b.functions[f].join ||
          a.functions[f].providers != b.functions[f].providers) {
        return false;
      }
    }
  }
  constexpr std::uint32_t kPlanned = HEDDLE_PARAMETER_REDECLARE | HEDDLE_PARAMETER_CONSTANT;
  for (PassIndex i = 0; i < resolved.passes.size(); ++i) {
    for (std::size_t p = 0; p < resolved.passes[i].parameters.size(); ++p) {
      const bool is_same = present.passes[i].parameters[p] == resolved.passes[i].parameters[p];
      if (!is_same && (resolved.passes[i].entry.technique->parameters[p].flags & kPlanned) != 0) return false;
    }
  }
  for (PassIndex i = 0; i < resolved.passes.size(); ++i) {
    for (std::size_t p = 0; p < resolved.passes[i].parameters.size(); ++p) {
      if (!(present.passes[i].parameters[p] == resolved.passes[i].parameters[p])) {
        graph.executor->set_parameter(i, p, resolved.passes[i].parameters[p]);
      }
    }
  }
  return true;
}

Json device_json(const heddle::vulkan::DeviceInfo& device) {
  Json json{{"index", device.index},
            {"name", device.name},
            {"driver", device.driver},
            {"driver_version", device.driver_version},
            {"type", device.type}};
  json["api"] = fmt::format("{}.{}.{}", VK_API_VERSION_MAJOR(device.api_version),
                            VK_API_VERSION_MINOR(device.api_version), VK_API_VERSION_PATCH(device.api_version));
  json["is_usable"] = device.is_usable;
  if (!device.is_usable) json["missing"] = device.missing;
  return json;
}

/// Runs a check for doctor: {"name": ..., "found": bool, "for": ..., "problem": ...}.
template <class Body>
Json checked(std::string_view name, std::string_view use, Body body) {
  Json json{{"name", name}, {"found", true}, {"for", use}};
  try {
    body();
  } catch (const Error& error) {
    json["found"] = false;
    json["problem"] = error.what();
  }
  return json;
}

Json counters_json(const heddle::vulkan::Counters& before, const heddle::vulkan::Counters& after) {
  return {{"commands", after.commands - before.commands},
          {"draws", after.draws - before.draws},
          {"dispatches", after.dispatches - before.dispatches},
          {"barriers", after.barriers - before.barriers},
          {"barrier_parts", after.barrier_parts - before.barrier_parts},
          {"renderings", after.renderings - before.renderings},
          {"submits", after.submits - before.submits},
          {"uploaded_bytes", after.uploaded_bytes - before.uploaded_bytes},
          {"read_back_bytes", after.read_back_bytes - before.read_back_bytes},
          {"pipelines_created", after.pipelines - before.pipelines},
          {"pipelines_total", after.pipelines},
          {"pipeline_total_ms", 1e-6 * static_cast<double>(after.pipeline_ns)},
          {"live_pipelines", after.live_pipelines},
          {"live_images", after.live_images},
          {"live_buffers", after.live_buffers},
          {"device_memory_bytes", after.device_memory_bytes}};
}

heddle::image::Image image_from(const heddle_image* given, std::string_view name) {
  const heddle_image taken = take(given, name);
  if (taken.pixels == nullptr || taken.width == 0 || taken.height == 0 || taken.channels == 0 || taken.channels > 4) {
    throw Error(HEDDLE_BAD_INPUT, fmt::format("{} is empty, or has other than 1 to 4 channels", name));
  }
  heddle::image::Image image{taken.width, taken.height, taken.channels, {}};
  image.pixels.assign(taken.pixels, taken.pixels + std::size_t{taken.width} * taken.height * taken.channels);
  return image;
}

}  // namespace

// ---- Host ----

const char* heddle_version(void) {
  return HEDDLE_VERSION;
}

heddle_status heddle_create(const heddle_host_options* options, heddle_host** out) {
  *out = nullptr;
  return guarded(hostless_error(), [&] {
    const heddle_host_options chosen = options != nullptr ? take(options, "options") : heddle_host_options{};
    auto host = std::make_unique<heddle_host>();
    if (chosen.log != nullptr) {
      host->log = [log = chosen.log, user = chosen.log_user](Severity severity, std::string_view text) {
        log(user, static_cast<std::uint32_t>(severity), std::string(text).c_str());
      };
    } else {
      host->log = [](Severity, std::string_view) {};
    }
    if (chosen.progress != nullptr) {
      host->progress = [tell = chosen.progress, user = chosen.progress_user](std::string_view activity,
                                                                             double fraction) {
        if (tell(user, std::string(activity).c_str(), fraction) != 0) {
          throw Error(HEDDLE_FAILED, fmt::format("cancelled at: {}", activity));
        }
      };
    }
    host->device_name = text_or_empty(chosen.device);
    host->validation = (chosen.flags & HEDDLE_HOST_VALIDATION) != 0;
    host->check = (chosen.flags & HEDDLE_HOST_CHECK) != 0;
    if (host->check && (chosen.flags & HEDDLE_HOST_LIVE) != 0) {
      throw Error(HEDDLE_BAD_INPUT, "a host that checks its frames cannot be live",
                  "leave out one of the two: what is proven is proven of frames that repeat");
    }
    std::vector<std::filesystem::path> folders;
    if (chosen.plugin_path != nullptr) {
      folders = split_path(chosen.plugin_path);
    } else {
      folders = split_path(environment("HEDDLE_PLUGIN_PATH"));
      folders.push_back(own_folder() / "plugins");
    }
    host->registry = std::make_unique<heddle::Registry>(std::move(folders));
    const std::filesystem::path cache = chosen.cache_path != nullptr ? chosen.cache_path : default_cache_folder();
    host->services = std::make_unique<heddle::graph::HostServices>(heddle::graph::HostServices{
        *host->registry, [raw = host.get()]() -> heddle::vulkan::Device& { return raw->open_device(); }, cache,
        host->log, &host->is_cancelled, host->progress,
        heddle::graph::ArtifactCache(cache.empty() ? cache : cache / "artifacts", kMostArtifactBytes),
        (chosen.flags & HEDDLE_HOST_REMAKE) != 0, host->check, (chosen.flags & HEDDLE_HOST_LIVE) != 0});
    *out = host.release();
  });
}

void heddle_destroy(heddle_host* host) {
  delete host;
}

const char* heddle_error(const heddle_host* host) {
  return host != nullptr ? host->error.c_str() : hostless_error().c_str();
}

void heddle_cancel(heddle_host* host) {
  static_assert(std::atomic<bool>::is_always_lock_free);
  host->is_cancelled.store(true);
}

heddle_status heddle_list(heddle_host* host, const char** out_json) {
  return guarded(host->error, [&] {
    host->list_text = heddle::list_json(*host->registry);
    *out_json = host->list_text.c_str();
  });
}

heddle_status heddle_schema(heddle_host* host, const char* kind, const char** out_json) {
  return guarded(host->error, [&] {
    const std::string_view name = kind;
    if (name != "graph" && name != "scene") {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("there is no schema of '{}'", name), "one of graph, scene");
    }
    host->schema_text = write_json(name == "graph" ? heddle::graph::schema(*host->registry)
                                                   : heddle::scene::overlay_schema(host->registry->components()),
                                   2);
    *out_json = host->schema_text.c_str();
  });
}

heddle_status heddle_devices(heddle_host* host, const char** out_json) {
  return guarded(host->error, [&] {
    Json devices = Json::array();
    for (const auto& device : heddle::vulkan::list_devices()) devices.push_back(device_json(device));
    host->devices_text = write_json(Json{{"devices", devices}}, 2);
    *out_json = host->devices_text.c_str();
  });
}

heddle_status heddle_doctor(heddle_host* host, const char** out_json) {
  return guarded(host->error, [&] {
    Json report{{"version", HEDDLE_VERSION}, {"abi", fmt::format("{}.{}", HEDDLE_ABI_MAJOR, HEDDLE_ABI_MINOR)}};
    Json checks = Json::array();
    checks.push_back(checked("Vulkan loader", "everything that renders", [] { (void)heddle::vulkan::list_devices(); }));
    checks.push_back(checked("Vulkan device", "everything that renders", [&] { (void)host->open_device(); }));
    checks.push_back(checked("VK_LAYER_KHRONOS_validation", "--validation", [] {
      const auto layers = heddle::vulkan::list_layers();
      if (std::find(layers.begin(), layers.end(), "VK_LAYER_KHRONOS_validation") == layers.end()) {
        throw Error(HEDDLE_FAILED, "the loader does not know the layer", "install the package vulkan-validationlayers");
      }
    }));
    checks.push_back(checked("OpenImageIO module", "reading and writing images, textures", [] {
      constexpr std::array<std::byte, 4> kNoImage{};
      try {
        (void)heddle::image::decode8(kNoImage, "doctor's probe");
      } catch (const Error& error) {
        if (error.status() != HEDDLE_BAD_INPUT) throw;  // bad input is the library's answer: it is there
      }
    }));
    report["checks"] = checks;
    if (host->device) report["device"] = device_json(host->device->info());
    Json techniques = Json::array();
    for (const heddle::Technique* technique : host->registry->techniques()) {
      Json entry{{"id", technique->id}};
      std::string problem;
      try {
        (void)host->registry->open(host->registry->find(technique->id));
        if (!host->device) problem = "there is no usable Vulkan device";
      } catch (const Error& error) {
        problem = error.what();
      }
      entry["runs"] = problem.empty();
      if (!problem.empty()) {
        entry["problem"] = problem;
        entry["instead"] = technique->fallback.empty()
                               ? fmt::format("technique = \"none\": the role '{}' is neutral", technique->role_name())
                               : technique->fallback;
      }
      techniques.push_back(entry);
    }
    for (const auto& [id, reason] : host->registry->left_out()) {
      const std::string role = id.substr(0, id.find('/'));
      techniques.push_back(Json{{"id", id},
                                {"runs", false},
                                {"problem", reason},
                                {"instead", fmt::format("another technique of the role '{}', or none", role)}});
    }
    report["techniques"] = techniques;
    host->doctor_text = write_json(report, 2);
    *out_json = host->doctor_text.c_str();
  });
}

// ---- Graph ----

namespace {

heddle::graph::WrittenGraph write_again(const heddle_graph& graph) {
  heddle::graph::WrittenGraph written = graph.read();
  for (const std::string& setting : graph.settings)
    heddle::graph::apply_setting(written, setting, own_folder() / "graphs");
  heddle::graph::read_jobs(written, own_folder() / "graphs");
  return written;
}

heddle_status make_graph(heddle_host* host, const char* const* settings, uint32_t setting_count, heddle_graph** out,
                         std::function<heddle::graph::WrittenGraph()> read) {
  *out = nullptr;
  return guarded(host->error, [&] {
    auto graph = std::make_unique<heddle_graph>();
    graph->host = host;
    graph->read = std::move(read);
    graph->settings.assign(settings, settings + setting_count);
    resolve_into(*graph, write_again(*graph));
    *out = graph.release();
  });
}

}  // namespace

heddle_status heddle_graph_load(heddle_host* host, const char* path, const char* const* settings,
                                uint32_t setting_count, heddle_graph** out) {
  return make_graph(host, settings, setting_count, out, [file = std::string(path)] {
    heddle::graph::WrittenGraph written = heddle::graph::read_graph(file, own_folder() / "graphs");
    written.folder = std::filesystem::path(written.file).parent_path();
    return written;
  });
}

heddle_status heddle_graph_parse(heddle_host* host, const char* text, const char* name, const char* folder,
                                 const char* const* settings, uint32_t setting_count, heddle_graph** out) {
  const std::string chosen = name != nullptr ? name : "graph";
  return make_graph(host, settings, setting_count, out, [text = std::string(text), chosen, at = text_or_empty(folder)] {
    heddle::graph::WrittenGraph written =
        heddle::graph::read_extended(heddle::graph::parse(text, chosen), at, own_folder() / "graphs");
    written.folder = at;
    return written;
  });
}

void heddle_graph_destroy(heddle_graph* graph) {
  delete graph;
}

heddle_status heddle_graph_explain(heddle_graph* graph, const char* format, const char** out) {
  return guarded(graph->host->error, [&] {
    graph->explanation = graph->executor->explain(format);
    *out = graph->explanation.c_str();
  });
}

heddle_status heddle_graph_explain_pass(heddle_graph* graph, const char* pass, const char* format, const char** out) {
  return guarded(graph->host->error, [&] {
    graph->pass_explanation = graph->executor->explain_pass(graph->written, pass, format);
    *out = graph->pass_explanation.c_str();
  });
}

heddle_status heddle_graph_describe(heddle_graph* graph, const char** out_json) {
  return guarded(graph->host->error, [&] {
    const heddle::graph::ResolvedGraph resolved = heddle::graph::resolve(graph->written, *graph->host->registry);
    graph->description = write_json(heddle::graph::describe(graph->written, resolved), 2);
    *out_json = graph->description.c_str();
  });
}

heddle_status heddle_graph_keep(heddle_graph* graph, const char* port) {
  return guarded(graph->host->error, [&] {
    graph->executor->keep(port);
    if (std::find(graph->kept.begin(), graph->kept.end(), port) == graph->kept.end()) graph->kept.emplace_back(port);
  });
}

heddle_status heddle_graph_set(heddle_graph* graph, const char* setting) {
  return guarded(graph->host->error, [&] {
    heddle::graph::WrittenGraph written = graph->written;
    heddle::graph::apply_setting(written, setting, own_folder() / "graphs");
    heddle::graph::read_jobs(written, own_folder() / "graphs");
    const heddle::graph::ResolvedGraph resolved = heddle::graph::resolve(written, *graph->host->registry);
    const std::string_view key = std::string_view(setting).substr(0, std::string_view(setting).find('=') + 1);
    // What a job makes by its settings is for the executor to find out.
    const bool is_of_job = key.find('#') != std::string_view::npos;
    if (!is_of_job && set_parameters_in_place(*graph, resolved)) {
      graph->written = std::move(written);
    } else {
      resolve_into(*graph, std::move(written));
    }
    // The last word on a key counts; frames that set one again and again add nothing.
    std::erase_if(graph->settings, [&](const std::string& said) { return said.starts_with(key); });
    graph->settings.emplace_back(setting);
  });
}

heddle_status heddle_graph_reload(heddle_graph* graph) {
  return guarded(graph->host->error, [&] {
    graph->host->registry->refresh();
    resolve_into(*graph, write_again(*graph));
  });
}

heddle_status heddle_graph_files(heddle_graph* graph, const char** out_json) {
  return guarded(graph->host->error, [&] {
    std::set<std::filesystem::path> files(graph->written.files.begin(), graph->written.files.end());
    const auto add_folder = [&](const std::filesystem::path& folder) {
      std::error_code error;
      for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
           entry.increment(error)) {
        // Not what editors leave beside them.
        const std::string kind = entry->path().extension().string();
        if (kind == ".glsl" || kind == ".json" || kind == ".toml") files.insert(entry->path());
      }
    };
    for (const std::filesystem::path& folder : graph->host->registry->shared_folders()) add_folder(folder);
    const auto add_passes = [&](const auto& self, const heddle::graph::ResolvedGraph& resolved) -> void {
      for (const heddle::graph::Pass& pass : resolved.passes) {
        add_folder(pass.entry.manifest->folder);
        files.insert(pass.entry.manifest->library);
        if (pass.role != nullptr) files.insert(pass.role->file);
        if (!resolved.is_job) continue;
        for (const heddle::graph::ParameterValue& value : pass.parameters)
          for (const std::string& name : value.names)
            if (std::error_code error; std::filesystem::is_regular_file(resolved.folder / name, error))
              files.insert(resolved.folder / name);
      }
      for (const heddle::graph::GraphJob& job : resolved.jobs) self(self, *job.graph);
    };
    add_passes(add_passes, graph->executor->graph());
    graph->files = paths_json(files);
    *out_json = graph->files.c_str();
  });
}

heddle_status heddle_graph_get(heddle_graph* graph, const char* key, const char** out_json) {
  return guarded(graph->host->error, [&] {
    const Json all =
        heddle::graph::settings(graph->written, heddle::graph::resolve(graph->written, *graph->host->registry));
    graph->got = write_json(heddle::graph::find_setting(all, text_or_empty(key)));
    *out_json = graph->got.c_str();
  });
}

namespace {

heddle::graph::FrameOptions frame_options(const heddle_render_options* options) {
  const heddle_render_options chosen = options != nullptr ? take(options, "options") : heddle_render_options{};
  if (!std::isfinite(chosen.time) || !std::isfinite(chosen.time_step)) {
    throw Error(HEDDLE_BAD_INPUT,
                fmt::format("time is {}, time_step {}: expected finite seconds", chosen.time, chosen.time_step));
  }
  heddle::graph::FrameOptions frame;
  frame.profile = (chosen.flags & HEDDLE_RENDER_PROFILE) != 0;
  frame.anew = frame.profile || (chosen.flags & HEDDLE_RENDER_ANEW) != 0;
  frame.cut = chosen.cut != 0;
  frame.time = chosen.time;
  frame.time_step = chosen.time_step;
  frame.seed = chosen.seed;
  return frame;
}

void must_be(const heddle_graph& graph, bool is_job) {
  const heddle::graph::ResolvedGraph& resolved = graph.executor->graph();
  if (resolved.is_job == is_job) return;
  heddle::Diagnostic diagnostic;
  diagnostic.where.file = resolved.file;
  diagnostic.message =
      is_job ? "this graph renders frames, and is no job" : "this graph is a job, and renders no frames";
  diagnostic.help = is_job ? "a job says kind = \"job\"; heddle_render, Graph.render and heddle run render frames"
                           : "heddle_job_run, Job.run and heddle run run it";
  throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
}

/// Poses the scene for a frame.
heddle::graph::FrameOptions prepare_frame(heddle_graph& graph, heddle_scene& scene,
                                          const heddle_render_options* options) {
  const heddle::graph::FrameOptions frame = frame_options(options);
  if (options != nullptr) scene.scene.set_time(frame.time);
  scene.scene.begin_frame(&graph);
  // A graph's first frame has no past either.
  if (frame.cut || graph.executor->stats().frame == 0) scene.scene.settle();
  return frame;
}

}  // namespace

heddle_status heddle_render(heddle_graph* graph, heddle_scene* scene, const heddle_render_options* options) {
  return guarded(graph->host->error, [&] {
    must_be(*graph, false);
    const heddle::graph::FrameOptions frame = prepare_frame(*graph, *scene, options);
    graph->executor->render(scene->scene, frame);
    scene->scene.end_frame(graph);
  });
}

heddle_status heddle_graph_check(heddle_graph* graph, heddle_scene* scene, const heddle_render_options* options,
                                 uint32_t frames, const char** out_json) {
  return guarded(graph->host->error, [&] {
    if (frames == 0) throw Error(HEDDLE_BAD_INPUT, "a check of 0 frames was asked for", "render three");
    if (!graph->host->check)
      throw Error(HEDDLE_BAD_INPUT, "a graph is checked on a host that was made without HEDDLE_HOST_CHECK");
    const heddle::graph::FrameOptions frame = frame_options(options);
    scene->scene.begin_move();
    if (options != nullptr) scene->scene.set_time(frame.time);
    const heddle::graph::CheckReport report = graph->executor->check(scene->scene, frame, frames);
    Json json{{"frames", report.frames},
              {"runs", report.runs},
              {"orders", report.orders},
              {"unordered_pairs", report.unordered_pairs},
              {"seen_both_ways", report.seen_both_ways}};
    json["poisons"] = Json::array();
    for (const std::uint32_t poison : report.poisons) json["poisons"].push_back(fmt::format("0x{:08X}", poison));
    json["compared"] = report.compared;
    json["lists"] = report.lists;
    json["overflowed"] = report.overflowed;
    graph->check_report = write_json(json, 2);
    *out_json = graph->check_report.c_str();
  });
}

heddle_status heddle_inspect(heddle_graph* graph, heddle_scene* scene, const heddle_render_options* options,
                             const uint32_t* pixels, uint32_t pixel_count, const char* format, const char** out) {
  return guarded(graph->host->error, [&] {
    const std::string_view kind = format;
    if (kind != "text" && kind != "json") {
      throw Error(HEDDLE_BAD_INPUT, fmt::format("unknown format '{}' of an inspection", kind), "one of text, json");
    }
    if (pixel_count == 0) throw Error(HEDDLE_BAD_INPUT, "no pixel was named to inspect");
    must_be(*graph, false);
    std::vector<heddle::graph::Pixel> wanted;
    for (uint32_t i = 0; i < pixel_count; ++i) wanted.push_back({pixels[2 * i], pixels[2 * i + 1]});
    const heddle::graph::FrameOptions frame = prepare_frame(*graph, *scene, options);
    const Json seen = graph->executor->inspect(scene->scene, frame, std::move(wanted));
    scene->scene.end_frame(graph);
    graph->inspection = kind == "json" ? write_json(seen, 2) : heddle::graph::inspection_text(seen);
    *out = graph->inspection.c_str();
  });
}

heddle_status heddle_read(heddle_graph* graph, const char* port, uint32_t layer, uint32_t mip, heddle_image* out) {
  return guarded(graph->host->error, [&] {
    graph->read_back = graph->executor->read(text_or_empty(port), layer, mip);
    const auto& read = graph->read_back;
    *out = {sizeof *out, read.width, read.height, read.channels, read.pixels.data()};
  });
}

heddle_status heddle_read_into(heddle_graph* graph, const char* port, uint32_t layer, uint32_t mip, float* pixels,
                               uint64_t capacity, heddle_image* out) {
  return guarded(graph->host->error, [&] {
    std::optional<std::span<float>> into;
    if (pixels != nullptr) into = std::span<float>(pixels, capacity);
    const auto read = graph->executor->read_into(text_or_empty(port), layer, mip, into);
    *out = {sizeof *out, read.width, read.height, read.channels, pixels};
  });
}

heddle_status heddle_read_texels(heddle_graph* graph, const char* port, uint32_t layer, uint32_t mip, void* bytes,
                                 uint64_t capacity, heddle_texels* out) {
  return guarded(graph->host->error, [&] {
    std::optional<std::span<std::byte>> into;
    if (bytes != nullptr) into = std::span(static_cast<std::byte*>(bytes), capacity);
    const auto read = graph->executor->read_texels(text_or_empty(port), layer, mip, into);
    *out = {sizeof *out,      read.width, read.height, static_cast<std::uint32_t>(read.format),
            read.texel_bytes, 0,          read.size,   bytes};
  });
}

heddle_status heddle_stats(heddle_graph* graph, const char** out_json) {
  return guarded(graph->host->error, [&] {
    const heddle::graph::FrameStats& stats = graph->executor->stats();
    Json json{
        {"frames", stats.frame}, {"wall_ms", stats.wall_ms}, {"submit_ms", stats.submit_ms}, {"stalls", stats.stalls}};
    const auto waits_json = [](const heddle::graph::WaitStats& waits) {
      return Json{{"waits", waits.waits}, {"reads", waits.late_reads}, {"stale", waits.stale_reads}};
    };
    json["late"] = waits_json(stats.waits);
    json["late"]["mode"] = graph->host->services->is_live ? "live" : "repeatable";
    json["late"]["total"] = waits_json(stats.total_waits);
    json["stages"] = Json::array();
    for (const auto& stage : stats.stages) {
      json["stages"].push_back(
          {{"pass", stage.pass}, {"stage", stage.stage}, {"wall_ms", stage.wall_ms}, {"cpu_ms", stage.cpu_ms}});
    }
    json["loops"] = Json::array();
    json["lists"] = Json::array();
    for (const auto& list : stats.lists) {
      json["lists"].push_back(
          {{"name", list.name}, {"capacity", list.capacity}, {"count", list.count}, {"overflow", list.overflow}});
    }
    json["counts"] = Json::array();
    for (const auto& count : stats.counts)
      json["counts"].push_back({{"pass", count.pass}, {"name", count.name}, {"count", count.count}});
    for (const auto& loop : stats.loops) {
      json["loops"].push_back({{"pass", loop.pass}, {"done", loop.done}, {"total", loop.total}});
    }
    json["counters"] = counters_json(stats.before, stats.after);
    json["instances"] = {{"drawn", stats.instances_drawn}, {"culled", stats.instances_culled}};
    json["memory"] = {{"transient_bytes", stats.heap_bytes},
                      {"transient_bytes_without_aliasing", stats.unaliased_bytes},
                      {"kept_bytes", stats.kept_bytes}};
    json["plan"] = {{"passes_made", stats.plan.passes_made},
                    {"passes_kept", stats.plan.passes_kept},
                    {"passes_redeclared", stats.plan.passes_redeclared},
                    {"pipelines_made", stats.plan.pipelines_made},
                    {"pipelines_kept", stats.plan.pipelines_kept},
                    {"pipelines_shared", stats.plan.pipelines_shared},
                    {"wall_ms", stats.plan.wall_ms}};
    json["artifacts"] = Json::array();
    for (const auto& use : stats.artifacts) {
      Json one = use.job.empty() ? Json{{"pass", use.pass}, {"stage", use.stage}}
                                 : Json{{"job", use.job}, {"pass", use.pass}, {"port", use.port}};
      one.update(Json{
          {"origin", use.is_reused ? "cache" : "made"}, {"key", use.key}, {"file", use.file}, {"bytes", use.bytes}});
      json["artifacts"].push_back(std::move(one));
    }
    json["libraries"] = stats.libraries;
    if (graph->host->device) json["device"] = device_json(graph->host->device->info());
    graph->stats = write_json(json, 2);
    *out_json = graph->stats.c_str();
  });
}

// ---- Jobs ----

namespace {

Json job_json(const heddle::graph::JobResult& result) {
  Json json{{"wall_ms", result.wall_ms}, {"errors", 0}, {"artifacts", Json::array()}, {"reports", Json::array()}};
  std::size_t errors = 0;
  for (const auto& [name, made] : result.parts) {
    Json one{{"name", name}, {"origin", made.is_reused ? "cache" : "made"}, {"key", made.key}, {"file", made.file}};
    if (made.type == heddle::PortType::kArtifact) {
      one["bytes"] = made.bytes->size();
      if (made.store != nullptr) {
        one["store"] = made.store->file.string();
        one["store_bytes"] = made.store->bytes;
      }
      json["artifacts"].push_back(std::move(one));
      continue;
    }
    one["rows"] = heddle::graph::report_rows(*made.bytes);
    errors += heddle::graph::count_errors(one["rows"]);
    json["reports"].push_back(std::move(one));
  }
  json["errors"] = errors;
  return json;
}

}  // namespace

heddle_status heddle_job_run(heddle_graph* job, heddle_scene* scene, const heddle_render_options* options,
                             const char** out_json) {
  return guarded(job->host->error, [&] {
    must_be(*job, true);
    const heddle::graph::FrameOptions frame = prepare_frame(*job, *scene, options);
    job->job_report = write_json(job_json(job->executor->run_job(scene->scene, frame)), 2);
    *out_json = job->job_report.c_str();
  });
}

heddle_status heddle_job_artifact(heddle_graph* job, const char* artifact, const void** out, uint64_t* out_bytes) {
  return guarded(job->host->error, [&] {
    must_be(*job, true);
    const heddle::graph::ResolvedGraph& graph = job->executor->graph();
    const auto& parts = job->executor->job_result().parts;
    std::vector<std::string> names;
    for (const auto& [name, made] : parts)
      if (made.type == heddle::PortType::kArtifact) names.push_back(name);
    std::string wanted = text_or_empty(artifact);
    if (artifact == nullptr && graph.output != heddle::graph::kNoIndex) wanted = graph.resources[graph.output].name;
    if (artifact == nullptr && graph.output == heddle::graph::kNoIndex && names.size() == 1) wanted = names.front();
    if (std::ranges::find(names, wanted) == names.end()) {
      heddle::Diagnostic diagnostic;
      diagnostic.where.file = graph.file;
      diagnostic.message = wanted.empty() ? fmt::format("the job left {} artifacts, and none was named", names.size())
                                          : fmt::format("the job left no artifact '{}'", wanted);
      diagnostic.expected = names.empty() ? "a job that has run" : "one of " + heddle::join_names(names);
      diagnostic.help = heddle::nearest_name(wanted, names).empty()
                            ? std::string{}
                            : fmt::format("did you mean '{}'?", heddle::nearest_name(wanted, names));
      throw Error(HEDDLE_BAD_INPUT, std::move(diagnostic));
    }
    const heddle::graph::Lasting& made = parts.at(wanted);
    *out = made.bytes->data();
    *out_bytes = made.bytes->size();
  });
}

// ---- Images ----

heddle_status heddle_image_read(heddle_host* host, const char* path, heddle_image* out) {
  return guarded(host->error, [&] {
    host->image = heddle::image::read(path);
    *out = {sizeof *out, host->image.width, host->image.height, host->image.channels, host->image.pixels.data()};
  });
}

heddle_status heddle_image_write(heddle_host* host, const char* path, const heddle_image* image) {
  return guarded(host->error, [&] { heddle::image::write(path, image_from(image, "image")); });
}

heddle_status heddle_image_compare(heddle_host* host, const heddle_image* a, const heddle_image* b,
                                   const char* difference_path, const char** out_json) {
  return guarded(host->error, [&] {
    const heddle::image::Image first = image_from(a, "image");
    const heddle::image::Image reference = image_from(b, "reference");
    host->compare_text = heddle::compare::to_json(heddle::compare::measure(first, reference));
    if (difference_path != nullptr) {
      heddle::image::write(difference_path, heddle::compare::difference(first, reference));
    }
    *out_json = host->compare_text.c_str();
  });
}
