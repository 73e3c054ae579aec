// SPDX-License-Identifier: Apache-2.0
// job_probe/...: jobs in slices on the CPU and on the GPU, jobs that look at a mesh, at textures of lights or need a
// camera, and who reads what they leave. For tests.
#include <heddle/slices.h>
#include <heddle/pass.hpp>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

namespace {

using namespace heddle::pass;

/// Ends the process without a word at one slice, or lets it meet Ctrl-C there; for tests that start processes.
void raise_at(std::uint32_t slice) {
  const auto is_due = [&](const char* variable) {
    const char* wanted = std::getenv(variable);
    return wanted != nullptr && std::atoi(wanted) == static_cast<int>(slice);
  };
  if (is_due("HEDDLE_PROBE_KILL_AT")) std::raise(SIGKILL);
  if (is_due("HEDDLE_PROBE_INTERRUPT_AT")) std::raise(SIGINT);
}

// ---- count: table[i] = first + i, and base[i] and bytes of a file added, `size` numbers in `slices` slices
constexpr heddle_port kCountPorts[] = {
    artifact_in("base", "numbers to add", HEDDLE_PORT_OPTIONAL),
    artifact_out("table", "the numbers"),
    report_out("report", "a row a slice"),
};
constexpr heddle_parameter kCountParameters[] = {
    parameter("first", "1", 0, 100, 1, "the first number"),
    integer("size", "1", 1, 1024, 8, "how many numbers"),
    integer("slices", "1", 1, 64, 4, "in how many slices"),
    toggle("fails", false, "the report has an error"),
    toggle("forgets", false, "load_state has no use for what was kept"),
    text("file", "whose first byte is added"),
    text("other_file", "is asked for under another name than a parameter's"),
};
constexpr heddle_access kCountAccesses[] = {value("base"), value("table"), value("report")};
constexpr heddle_stage kCountStages[] = {cpu_stage("count", kCountAccesses)};
struct Count {
  heddle_status execute(const Frame& frame) {
    const PassHost host = frame.host();
    const std::uint32_t slice = frame.info().slice;
    const auto size = static_cast<std::uint32_t>(host.integer("size"));
    const auto slices = static_cast<std::uint32_t>(host.integer("slices"));
    if (slice == 0) numbers.clear();
    raise_at(slice);
    host.inform("slice " + std::to_string(slice));
    double added = 0;
    if (const std::string file = host.text("file"); !file.empty()) {
      const std::string path = host.resolve_path(file);
      if (path.empty()) return HEDDLE_BUG;
      added = std::ifstream(path, std::ios::binary).get();
    }
    if (!host.text("other_file").empty() && host.resolve_path("./" + host.text("other_file")).empty())
      return HEDDLE_BUG;
    const auto base = frame.value<double>("base");
    for (auto i = static_cast<std::uint32_t>(numbers.size()); i < size * (slice + 1) / slices; ++i)
      numbers.push_back(host.parameter("first") + i + added + (i < base.size() ? base[i] : 0.0));
    heddle_status status = frame.add_row("report", HEDDLE_SEVERITY_INFO, "a slice is done",
                                         {{"slice", static_cast<double>(slice)}, {"of", "count"}});
    if (status == HEDDLE_OK) status = frame.progress((slice + 1.0) / slices);
    if (status != HEDDLE_OK) return status;
    if (slice + 1 < slices) return HEDDLE_MORE;
    if (host.toggle("fails"))
      status = frame.add_row("report", HEDDLE_SEVERITY_ERROR, "it was asked to fail", {{"limit", std::nan("")}});
    return status == HEDDLE_OK ? frame.set_value<double>("table", numbers) : status;
  }
  heddle_status save_state(const Frame& frame) const { return frame.keep_state<double>(numbers); }
  heddle_status load_state(const Frame& frame, std::span<const std::byte> state) {
    if (frame.host().toggle("forgets")) return HEDDLE_UNSUPPORTED;
    numbers.resize(state.size() / sizeof(double));
    std::memcpy(numbers.data(), state.data(), state.size());
    return HEDDLE_OK;
  }
  std::vector<double> numbers;
};

// ---- plain: the same in one go, stopped where it asks; without states
constexpr heddle_port kPlainPorts[] = {artifact_out("table", "four numbers")};
constexpr heddle_access kPlainAccesses[] = {value("table")};
constexpr heddle_stage kPlainStages[] = {cpu_stage("make", kPlainAccesses)};
struct Plain {
  heddle_status execute(const Frame& frame) const {
    const std::uint32_t slice = frame.info().slice;
    frame.host().inform("slice " + std::to_string(slice));
    if (const heddle_status status = frame.progress(slice / 4.0); status != HEDDLE_OK) return status;
    if (slice < 3) return HEDDLE_MORE;
    const std::array<double, 4> numbers{1, 2, 3, 4};
    return frame.set_value<double>("table", numbers);
  }
};

// ---- gpu: sums of slices on the device, read back into a table
constexpr heddle_port kGpuPorts[] = {
    buffer_out("sums", 32, "uint sums[8];", "what the device adds up"),
    artifact_out("table", "the sums"),
};
constexpr heddle_parameter kGpuParameters[] = {integer("slices", "1", 1, 64, 5, "in how many slices")};
constexpr heddle_access kClearAccesses[] = {storage_write("sums")};
constexpr heddle_access kAddAccesses[] = {access("sums", HEDDLE_ACCESS_STORAGE_READ_WRITE)};
constexpr heddle_access kKeepAccesses[] = {host_read("sums"), value("table")};
constexpr heddle_stage kGpuStages[] = {gpu_stage("clear", kClearAccesses), gpu_stage("add", kAddAccesses),
                                       cpu_stage("keep", kKeepAccesses)};
constexpr heddle_shader kGpuShaders[] = {compute_shader("clear", "clear", "clear.comp.glsl"),
                                         compute_shader("add", "add", "add.comp.glsl")};
struct Gpu {
  heddle_status record(const Frame& frame) const {
    if (frame.stage() == 0) return frame.dispatch("clear", 1);
    const std::uint32_t slice = frame.info().slice;
    raise_at(slice);
    frame.host().inform("slice " + std::to_string(slice));
    const heddle_status status = frame.dispatch("add", 1, 1, 1, slice);
    if (status != HEDDLE_OK) return status;
    return slice + 1 < static_cast<std::uint32_t>(frame.host().integer("slices")) ? HEDDLE_MORE : HEDDLE_OK;
  }
  heddle_status execute(const Frame& frame) const {
    heddle_mapped sums;
    if (const heddle_status status = frame.map("sums", sums); status != HEDDLE_OK) return status;
    const auto* first = static_cast<const std::uint32_t*>(sums.data);
    const std::vector<double> table(first, first + 8);
    return frame.set_value<double>("table", table);
  }
  // What it needs is in the buffer and in info.slice, which the host keeps.
  heddle_status save_state(const Frame&) const { return HEDDLE_OK; }
  heddle_status load_state(const Frame&, std::span<const std::byte>) const { return HEDDLE_OK; }
};

// ---- pair: the same sums, cleared and added to on the device in each slice, and gathered on the CPU
constexpr heddle_parameter kPairParameters[] = {
    integer("slices", "1", 1, 64, 5, "in how many slices"),
    text("first", "the stage that slices begin with"),
};
struct Pair {
  heddle_status record(const Frame& frame) {
    if (frame.stage() == 0) return frame.dispatch("clear", 1);
    frame.host().inform("adds part " + std::to_string(frame.info().slice));
    return frame.dispatch("add", 1, 1, 1, frame.info().slice);
  }
  heddle_status execute(const Frame& frame) {
    const std::uint32_t slice = frame.info().slice;
    raise_at(slice);
    frame.host().inform("slice " + std::to_string(slice));
    heddle_mapped sums;
    if (const heddle_status status = frame.map("sums", sums); status != HEDDLE_OK) return status;
    for (std::size_t i = 0; i < table.size(); ++i) table[i] += static_cast<const std::uint32_t*>(sums.data)[i];
    if (slice + 1 == static_cast<std::uint32_t>(frame.host().integer("slices")))
      return frame.set_value<double>("table", table);
    const auto* slices = frame.host().service<heddle_slices_service>(HEDDLE_SLICES_SERVICE);
    const std::string first = frame.host().text("first");
    const heddle_status status =
        slices->begin_with(frame.host().raw(), frame.raw(), first.empty() ? "clear" : first.c_str());
    return status == HEDDLE_OK ? HEDDLE_MORE : status;
  }
  heddle_status save_state(const Frame& frame) const { return frame.keep_state<double>(table); }
  heddle_status load_state(const Frame&, std::span<const std::byte> state) {
    std::memcpy(table.data(), state.data(), state.size());
    return HEDDLE_OK;
  }
  std::array<double, 8> table{};
};

// ---- areas: of the scene's triangles; one without area is an error
constexpr heddle_port kAreasPorts[] = {
    surfaces_in("surfaces", "what is measured"),
    artifact_out("table", "areas, m^2"),
    report_out("report", "triangles without area"),
};
constexpr heddle_access kAreasAccesses[] = {host_read("surfaces"), value("table"), value("report")};
constexpr heddle_stage kAreasStages[] = {cpu_stage("measure", kAreasAccesses)};
struct Areas {
  heddle_status execute(const Frame& frame) const {
    const heddle_snapshot* mesh = nullptr;
    heddle_alpha_test alpha = nullptr;
    if (const heddle_status status = frame.snapshot("surfaces", mesh, alpha); status != HEDDLE_OK) return status;
    frame.host().inform("measures");
    std::vector<double> areas;
    for (std::uint32_t t = 0; t < mesh->triangle_count; ++t) {
      double edge[2][3];
      const auto corner = [&](int k) {
        return mesh->positions + std::size_t{3} * mesh->indices[3 * t + static_cast<std::uint32_t>(k)];
      };
      for (int e = 0; e < 2; ++e)
        for (int c = 0; c < 3; ++c)
          edge[e][c] = static_cast<double>(corner(e + 1)[c]) - static_cast<double>(corner(0)[c]);
      const double x = edge[0][1] * edge[1][2] - edge[0][2] * edge[1][1];
      const double y = edge[0][2] * edge[1][0] - edge[0][0] * edge[1][2];
      const double z = edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0];
      areas.push_back(0.5 * std::sqrt(x * x + y * y + z * z));
      if (areas.back() > 0) continue;
      const heddle_status status = frame.add_row("report", HEDDLE_SEVERITY_ERROR, "a triangle has no area",
                                                 {{"triangle", static_cast<double>(t)}});
      if (status != HEDDLE_OK) return status;
    }
    return frame.set_value<double>("table", areas);
  }
};

// ---- look: needs the frame's camera
constexpr heddle_port kLookPorts[] = {
    [] {
      heddle_port p = value_in("camera", "the frame's");
      p.glsl = "HeddleView camera;";
      return p;
    }(),
    artifact_out("table", "nothing"),
};
constexpr heddle_access kLookAccesses[] = {value("camera"), value("table")};
constexpr heddle_stage kLookStages[] = {cpu_stage("look", kLookAccesses)};
struct Look {
  heddle_status execute(const Frame&) const { return HEDDLE_OK; }
};

// ---- film: the sum of all texels of the textures of lights, their levels too
constexpr heddle_port kFilmPorts[] = {
    [] {
      heddle_port p = value_in("light_textures", "images on rectangle lights");
      p.glsl = "vec4 light_textures[];";
      return p;
    }(),
    artifact_out("table", "how many textures, and their sum"),
};
constexpr heddle_access kFilmAccesses[] = {value("light_textures"), value("table")};
constexpr heddle_stage kFilmStages[] = {cpu_stage("add", kFilmAccesses)};
struct Film {
  heddle_status execute(const Frame& frame) const {
    frame.host().inform("adds texels");
    const auto floats = frame.value<float>("light_textures");
    const auto heads = frame.value<HeddleLightTexture>("light_textures");
    const std::size_t first = heads.empty() ? 0 : heads[0].first;
    double sum = 0;
    for (std::size_t i = 4 * first; i < floats.size(); ++i) sum += i % 4 == 3 ? 0.0 : static_cast<double>(floats[i]);
    const std::array<double, 2> numbers{static_cast<double>(first), sum};
    return frame.set_value<double>("table", numbers);
  }
};

// ---- picture: an image of the frame's size, 0.25 everywhere
constexpr heddle_port kPicturePorts[] = {image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "a quarter")};
constexpr heddle_access kPictureAccesses[] = {host_write("color")};
constexpr heddle_stage kPictureStages[] = {cpu_stage("paint", kPictureAccesses)};
struct Picture {
  heddle_status execute(const Frame& frame) const {
    heddle_mapped out;
    if (const heddle_status status = frame.map("color", out); status != HEDDLE_OK) return status;
    auto* texels = static_cast<float*>(out.data);
    std::fill(texels, texels + std::size_t{4} * out.shape.width * out.shape.height, 0.25F);
    return HEDDLE_OK;
  }
};

// ---- show: the first two numbers of a table, how many there are, and how often it was created
constexpr heddle_port kShowPorts[] = {
    artifact_in("links", "a table"),
    image_out_sized("color", VK_FORMAT_R32G32B32A32_SFLOAT, 1, 1, "its numbers"),
};
constexpr heddle_parameter kShowParameters[] = {toggle("fails", false, "it cannot be planned")};
constexpr heddle_access kShowAccesses[] = {value("links"), host_write("color")};
constexpr heddle_stage kShowStages[] = {cpu_stage("show", kShowAccesses)};
struct Show {
  heddle_status declare(const PassHost& host) {
    if (host.toggle("fails")) return host.fail(HEDDLE_UNSUPPORTED, "it was asked to fail");
    const auto links = host.artifact<double>("links");
    if (links.size_bytes() != host.shape("links").byte_size)
      return host.fail(HEDDLE_BUG, "the artifact is not there before declare");
    // An image as wide as the table is long, as tables become textures.
    heddle_shape shape{};
    shape.width = static_cast<std::uint32_t>(links.size());
    return host.set_shape("color", shape);
  }
  heddle_status execute(const Frame& frame) const {
    const auto links = frame.value<double>("links");
    heddle_mapped out;
    if (const heddle_status status = frame.map("color", out); status != HEDDLE_OK) return status;
    auto* texels = static_cast<float*>(out.data);
    for (std::size_t i = 0; i < links.size(); ++i)
      for (std::size_t c = 0; c < 4; ++c)
        texels[4 * i + c] = static_cast<float>(c == 0 ? links[i] : c == 1 ? static_cast<double>(links.size()) : 0.0);
    return HEDDLE_OK;
  }
};

template <typename Pass, std::size_t kPorts, std::size_t kStages>
constexpr heddle_technique make(const char* id, const heddle_port (&ports)[kPorts],
                                const heddle_stage (&stages)[kStages]) {
  heddle_technique t = technique<Pass>(id, "A probe of jobs", "definition");
  t.ports = list(ports, t.port_count);
  t.stages = list(stages, t.stage_count);
  return t;
}
constexpr heddle_technique kCount = [] {
  heddle_technique t = make<Count>("job_probe/count", kCountPorts, kCountStages);
  t.parameters = list(kCountParameters, t.parameter_count);
  return t;
}();
constexpr heddle_technique kPlain = make<Plain>("job_probe/plain", kPlainPorts, kPlainStages);
constexpr heddle_technique kGpu = [] {
  heddle_technique t = make<Gpu>("job_probe/gpu", kGpuPorts, kGpuStages);
  t.parameters = list(kGpuParameters, t.parameter_count);
  t.shaders = list(kGpuShaders, t.shader_count);
  return t;
}();
constexpr heddle_technique kPair = [] {
  heddle_technique t = make<Pair>("job_probe/pair", kGpuPorts, kGpuStages);
  t.parameters = list(kPairParameters, t.parameter_count);
  t.shaders = list(kGpuShaders, t.shader_count);
  return t;
}();
constexpr heddle_technique kAreas = [] {
  heddle_technique t = make<Areas>("job_probe/areas", kAreasPorts, kAreasStages);
  t.features = "surfaces";
  return t;
}();
constexpr heddle_technique kLook = make<Look>("job_probe/look", kLookPorts, kLookStages);
constexpr heddle_technique kFilm = make<Film>("job_probe/film", kFilmPorts, kFilmStages);
constexpr heddle_technique kPicture = make<Picture>("job_probe/picture", kPicturePorts, kPictureStages);
constexpr heddle_technique kShow = [] {
  heddle_technique t = make<Show>("job_probe/show", kShowPorts, kShowStages);
  t.parameters = list(kShowParameters, t.parameter_count);
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kCount, kPlain, kGpu, kPair, kAreas, kLook, kFilm, kPicture, kShow)
