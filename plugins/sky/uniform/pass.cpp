// SPDX-License-Identifier: Apache-2.0
// sky/uniform: the same radiance from every direction, for furnace tests and evenly lit pictures. A function's text.
#include <heddle/pass.hpp>

namespace {

using namespace heddle::pass;

constexpr heddle_parameter kParameters[] = {
    color("radiance", "cd/m^2", 0, 1e9, {1, 1, 1}, "from every direction"),
};
constexpr heddle_function kFunctions[] = {function("sky", "uniform.glsl")};

constexpr heddle_technique kUniformSky =
    technique<Nothing>("sky/uniform", "The same radiance from every direction", "definition", kParameters, kFunctions);

}  // namespace

HEDDLE_PLUGIN(kUniformSky)
