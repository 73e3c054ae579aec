// SPDX-License-Identifier: Apache-2.0
// chain/work: a known amount of work, or a dispatch of no group at all. For benchmarks.
#include <heddle/pass.hpp>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("previous", "the pass before", HEDDLE_PORT_OPTIONAL),
    image_out("result", VK_FORMAT_R32_SFLOAT, "what was made"),
};
constexpr heddle_parameter kParameters[] = {
    integer("iterations", "1", 0, 60000, 1, "steps of the logistic map"),
    toggle("is_empty", false, "dispatch no group"),
};
constexpr heddle_access kAccesses[] = {sampled("previous"), storage_write("result")};
constexpr heddle_stage kStages[] = {gpu_stage("work", kAccesses)};
constexpr heddle_shader kShaders[] = {compute_shader("work", "work", "work.comp.glsl")};

struct Work {
  explicit Work(const PassHost& host) : is_empty(host.toggle("is_empty")) {}
  heddle_status record(const Frame& frame) {
    return is_empty ? frame.dispatch("work", 0) : frame.dispatch_over("work", "result");
  }
  bool is_empty;
};

constexpr heddle_technique kWork =
    technique<Work>("chain/work", "Steps of the logistic map", "Verhulst 1838", kPorts, kParameters, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kWork)
