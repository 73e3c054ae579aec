// SPDX-License-Identifier: Apache-2.0
#include "session.hpp"

#include <cstdlib>
#include <ctime>
#include <stdexcept>

namespace heddle::bench {
namespace {

std::filesystem::path heddle_folder() {
  return std::filesystem::canonical("/proc/self/exe").parent_path().parent_path();
}

/// As the application's host has it, so that what one compiled the other finds.
std::filesystem::path cache_folder() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return std::filesystem::path(value != nullptr ? value : "");
  };
  if (const auto chosen = variable("HEDDLE_CACHE"); !chosen.empty()) return chosen;
  if (const auto cache = variable("XDG_CACHE_HOME"); !cache.empty()) return cache / "heddle";
  if (const auto home = variable("HOME"); !home.empty()) return home / ".cache" / "heddle";
  return std::filesystem::temp_directory_path() / "heddle-cache";
}

}  // namespace

double thread_cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double now_ms() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Session::Session(Options options)
    : options_(std::move(options)),
      folder_(heddle_folder()),
      registry_({folder_ / "bench" / "plugins", folder_ / "plugins"}),
      services_{registry_, [this]() -> vulkan::Device& { return device(); }, cache_folder(),
                [](Severity, std::string_view) {}} {
  // The host's own parts are in this program too, which does not lie beside the module.
  setenv("HEDDLE_IMAGE_MODULE", (folder_.parent_path() / "libheddle_image.so").c_str(), 0);
}

int Session::runs(int usual) const {
  return options_.runs > 0 ? options_.runs : options_.is_small ? 3 : usual;
}

vulkan::Device& Session::device() {
  if (!device_) device_ = std::make_unique<vulkan::Device>(vulkan::DeviceOptions{options_.device, false, false, {}});
  return *device_;
}

heddle_host* Session::host() {
  if (!host_) {
    heddle_host_options options{};
    options.struct_size = sizeof options;
    options.device = options_.device.empty() ? nullptr : options_.device.c_str();
    heddle_host* made = nullptr;
    if (heddle_create(&options, &made) != HEDDLE_OK) throw std::runtime_error(heddle_error(nullptr));
    host_.reset(made);
  }
  return host_.get();
}

void Session::check(heddle_status status) {
  if (status != HEDDLE_OK) throw Error(status, heddle_error(host_.get()));
}

Owned<heddle_graph> Session::parse_graph(const std::string& text, const std::vector<std::string>& settings) {
  std::vector<const char*> words;
  for (const std::string& setting : settings) words.push_back(setting.c_str());
  heddle_graph* made = nullptr;
  check(heddle_graph_parse(host(), text.c_str(), "benchmark.toml", (folder_ / "graphs").c_str(), words.data(),
                           static_cast<std::uint32_t>(words.size()), &made));
  return Owned<heddle_graph>(made);
}

Owned<heddle_scene> Session::make_scene() {
  heddle_scene* made = nullptr;
  check(heddle_scene_create(host(), &made));
  return Owned<heddle_scene>(made);
}

void Session::render(heddle_graph* graph, heddle_scene* scene) {
  check(heddle_render(graph, scene, nullptr));
}

Json Session::stats(heddle_graph* graph) {
  const char* text = nullptr;
  check(heddle_stats(graph, &text));
  return parse_json(text);
}

void fill_with_boxes(Session& session, heddle_scene* scene, const std::vector<std::array<double, 3>>& places,
                     double size) {
  heddle_material material{};
  material.struct_size = sizeof material;
  std::fill(std::begin(material.textures), std::end(material.textures), HEDDLE_NONE);
  HeddleMaterial& record = material.record;
  record.base_color[0] = record.base_color[1] = record.base_color[2] = 0.5F;
  record.base_color[3] = record.roughness = record.normal_scale = record.occlusion_strength = 1.0F;
  record.ior = 1.5F;
  record.alpha_cutoff = 0.5F;
  record.uv_rotation_scale[0] = record.uv_rotation_scale[3] = 1.0F;
  std::uint32_t material_id = 0, mesh_id = 0, id = 0;
  session.check(heddle_scene_add_material(scene, "grey", &material, &material_id));

  std::vector<float> positions;
  std::vector<std::uint32_t> indices;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const bool is_far : {false, true}) {
      const auto first = static_cast<std::uint32_t>(positions.size() / 3);
      for (const std::array<float, 2> corner :
           {std::array{-0.5F, -0.5F}, std::array{0.5F, -0.5F}, std::array{0.5F, 0.5F}, std::array{-0.5F, 0.5F}}) {
        std::array<float, 3> p{};
        p[axis] = is_far ? 0.5F : -0.5F;
        p[(axis + 1) % 3] = corner[0];
        p[(axis + 2) % 3] = corner[1];
        positions.insert(positions.end(), p.begin(), p.end());
      }
      // The far side of an axis is wound the other way.
      for (const std::uint32_t i : {0U, 1U, 2U, 0U, 2U, 3U}) indices.push_back(first + (is_far ? i : 3U - i));
    }
  }
  heddle_mesh mesh{};
  mesh.struct_size = sizeof mesh;
  mesh.vertex_count = static_cast<std::uint32_t>(positions.size() / 3);
  mesh.index_count = static_cast<std::uint32_t>(indices.size());
  mesh.positions = positions.data();
  mesh.indices = indices.data();
  session.check(heddle_scene_add_mesh(scene, "box", &mesh, material_id, &mesh_id));
  for (const std::array<double, 3>& place : places) {
    const double matrix[16] = {size, 0, 0, 0, 0, size, 0, 0, 0, 0, size, 0, place[0], place[1], place[2], 1};
    session.check(heddle_scene_add_instance(scene, nullptr, mesh_id, matrix, &id));
  }
  heddle_light sun{};
  sun.struct_size = sizeof sun;
  sun.record.type = HEDDLE_LIGHT_DIRECTIONAL;
  sun.record.flags = HEDDLE_LIGHT_CASTS_SHADOW;
  sun.record.direction[0] = 0.6F;
  sun.record.direction[1] = -0.8F;
  sun.record.tangent[2] = 1.0F;
  std::fill(std::begin(sun.record.intensity), std::end(sun.record.intensity), 1e5F);
  session.check(heddle_scene_add_light(scene, "sun", &sun, &id));
}

}  // namespace heddle::bench
