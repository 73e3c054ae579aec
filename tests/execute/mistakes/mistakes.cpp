// SPDX-License-Identifier: Apache-2.0
// mistakes/one: fails where `in` says, with as many errors as `errors` says. For tests.
#include <heddle/pass.hpp>

#include <stdexcept>
#include <string>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_in("first", "whatever is to run before", HEDDLE_PORT_OPTIONAL),
    image_in("second", "the same", HEDDLE_PORT_OPTIONAL),
    image_out("image", VK_FORMAT_R32_SFLOAT, "the sum, plus 1"),
};
constexpr const char* kIn[] = {"nothing", "create", "declare", "prepare", nullptr};
enum : std::uint32_t { kNothing, kCreate, kDeclare, kPrepare };
constexpr heddle_parameter kParameters[] = {choice("in", kIn, kNothing, "where it fails"),
                                            integer("errors", "1", 1, 100, 1, "that it reports there")};
constexpr heddle_access kSum[] = {sampled("first"), sampled("second"), storage_write("image")};
constexpr heddle_stage kStages[] = {gpu_stage("sum", kSum)};
constexpr heddle_shader kShaders[] = {compute_shader("sum", "sum", "sum.comp.glsl")};

struct One {
  explicit One(const PassHost& host) {
    if (fail(host, kCreate) != HEDDLE_OK) throw std::runtime_error("no object is made");
  }
  static heddle_status declare(const PassHost& host) { return fail(host, kDeclare); }
  static heddle_status prepare(const PassHost& host) { return fail(host, kPrepare); }
  static heddle_status record(const Frame& frame) { return frame.dispatch_over("sum", "image"); }

 private:
  static heddle_status fail(const PassHost& host, std::uint32_t in) {
    if (host.choice("in") != in) return HEDDLE_OK;
    heddle_status status = HEDDLE_OK;
    for (std::int32_t i = 1; i <= host.integer("errors"); ++i)
      status = host.fail(HEDDLE_BAD_INPUT, std::string("wrong in ") + kIn[in] + ", " + std::to_string(i));
    return status;
  }
};

constexpr heddle_technique kOne =
    technique<One>("mistakes/one", "A pass that fails", "definition", kPorts, kParameters, kStages, kShaders);

}  // namespace

HEDDLE_PLUGIN(kOne)
