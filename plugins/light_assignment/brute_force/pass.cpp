// SPDX-License-Identifier: Apache-2.0
// light_assignment/brute_force: every light is tried at every point. A function's text.
#include <heddle/pass.hpp>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {value_in("lights", "every light of the frame")};
constexpr heddle_access kAccesses[] = {value("lights")};
constexpr heddle_function kFunctions[] = {function("light_assignment", "brute_force.glsl", kAccesses)};

constexpr heddle_technique kBruteForce = [] {
  heddle_technique t = technique<Nothing>("light_assignment/brute_force", "Every light tried at every point",
                                          "definition", kPorts, kFunctions);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  t.features = "lights";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kBruteForce)
