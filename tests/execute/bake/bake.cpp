// SPDX-License-Identifier: Apache-2.0
// bake/numbers, sum: a cached stage that says when it runs, and asks for what it is told to. For tests.
#include <heddle/pass.hpp>

#include <string>

namespace {

using namespace heddle::pass;

// numbers[i] = first + i.
constexpr heddle_port kNumbersPorts[] = {
    buffer_out("numbers", 16, "float numbers[4];", "what is summed"),
    image_out_sized("color", VK_FORMAT_R32G32B32A32_SFLOAT, 1, 1, "the same as a texel"),
};
constexpr heddle_parameter kNumbersParameters[] = {parameter("first", "1", 0, 100, 1, "the first number")};
constexpr heddle_access kNumbersAccesses[] = {host_write("numbers"), host_write("color")};
constexpr heddle_stage kNumbersStages[] = {cpu_stage("make", kNumbersAccesses)};
struct Numbers {
  heddle_status execute(const Frame& frame) const {
    for (const char* port : {"numbers", "color"}) {
      heddle_mapped out;
      if (const heddle_status status = frame.map(port, out); status != HEDDLE_OK) return status;
      for (int i = 0; i < 4; ++i)
        static_cast<float*>(out.data)[i] = static_cast<float>(frame.host().parameter("first")) + static_cast<float>(i);
    }
    return HEDDLE_OK;
  }
};

// total = table[1] = list[1] = scale * (sum of numbers) + what the frame's info says (nothing); list[2] is not written.
constexpr const char* kQuestions[] = {"nothing", "parameter", "shape", "value", "service", "file", nullptr};
constexpr heddle_port kSumPorts[] = {
    [] {
      heddle_port p = buffer_in("numbers", "what is summed");
      p.glsl = "float numbers[4];";
      return p;
    }(),
    [] {
      heddle_port p = value_in("camera", "the frame's");
      p.glsl = "HeddleView camera;";
      return p;
    }(),
    value_out("total", 16, "the sum", "vec4 total;"),
    image_out_sized("table", VK_FORMAT_R32_SFLOAT, 2, 2, "the sum"),
    buffer_out("list", 16, "float list[4];", "the sum"),
    image_out("color", VK_FORMAT_R32G32B32A32_SFLOAT, "all of them"),
};
constexpr heddle_parameter kSumParameters[] = {
    parameter("scale", "1", 0, 100, 1, "a factor"),
    parameter("unheeded", "1", 0, 100, 1, "nothing depends on it"),
    choice("asks_for", kQuestions, 0, "what its key does not hold"),
};
constexpr heddle_access kSumAccesses[] = {host_read("numbers"), value("total"), host_write("table"),
                                          host_write("list")};
constexpr heddle_access kShowAccesses[] = {value("total"), sampled("table"), storage_read("list"), value("camera"),
                                           storage_write("color")};
constexpr heddle_stage kSumStages[] = {cached_by("scale asks_for", cpu_stage("sum", kSumAccesses)),
                                       gpu_stage("show", kShowAccesses)};
constexpr heddle_shader kSumShaders[] = {compute_shader("show", "show", "show.comp.glsl")};
struct Sum {
  heddle_status execute(const Frame& frame) const {
    const PassHost host = frame.host();
    heddle_mapped numbers, table, list;
    if (const heddle_status status = frame.map("numbers", numbers); status != HEDDLE_OK) return status;
    if (const heddle_status status = frame.map("table", table); status != HEDDLE_OK) return status;
    if (const heddle_status status = frame.map("list", list); status != HEDDLE_OK) return status;
    const heddle_frame_info& info = frame.info();
    double sum = static_cast<double>(info.index) + info.time + static_cast<double>(info.seed) + info.origin[0];
    for (int i = 0; i < 4; ++i) {
      host.inform("slice " + std::to_string(i));
      sum += host.parameter("scale") * static_cast<double>(static_cast<const float*>(numbers.data)[i]);
      if (const heddle_status status = frame.progress((i + 1) / 4.0); status != HEDDLE_OK) return status;
    }
    switch (host.choice("asks_for")) {
      case 1:
        sum += host.parameter("unheeded");
        break;
      case 2:
        (void)host.shape("color");
        break;
      case 3:
        (void)frame.value<HeddleView>("camera");
        break;
      case 4:
        (void)host.raw()->function_service(host.raw(), "surface_material");
        break;
      case 5:
        (void)host.resolve_path("secret.txt");
        break;
      default:
        break;
    }
    const float total[4] = {static_cast<float>(sum), 0, 0, 0};
    static_cast<float*>(table.data)[1] = static_cast<float*>(list.data)[1] = total[0];
    return frame.set_value<float>("total", total);
  }
  heddle_status record(const Frame& frame) const { return frame.dispatch_over("show", "color"); }
};

constexpr heddle_technique kNumbersTechnique =
    technique<Numbers>("bake/numbers", "Numbers", "definition", kNumbersPorts, kNumbersParameters, kNumbersStages);
constexpr heddle_technique kSumTechnique = technique<Sum>("bake/sum", "Their sum, kept on disk", "definition",
                                                          kSumPorts, kSumParameters, kSumStages, kSumShaders);

}  // namespace

HEDDLE_PLUGIN(kNumbersTechnique, kSumTechnique)
