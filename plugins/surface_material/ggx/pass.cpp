// SPDX-License-Identifier: Apache-2.0
// surface_material/ggx: the functions surface_material and surface_material_environment, and the table they read.
#include <heddle/pass.hpp>

#include <cstring>

#include "albedo_map.hpp"
#include "ggx.hpp"

namespace {
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    image_out_sized("albedo_table", VK_FORMAT_R32G32_SFLOAT, heddle::ggx::kTableWidth, heddle::ggx::kTableSize,
                    "albedo lost to single scattering, and with Schlick's weight [1]; columns NoV, rows roughness",
                    HEDDLE_PORT_KEPT),
};
constexpr heddle_parameter kParameters[] = {
    // A constant: lavapipe 22.3 specializes shaders by uniforms that branches depend on, and crashes over a second
    // set's.
    toggle("multiple_scattering", true, "give back the energy that a single bounce on rough surfaces loses",
           HEDDLE_PARAMETER_CONSTANT),
};
constexpr heddle_access kUpload[] = {host_write("albedo_table")};
constexpr heddle_stage kStages[] = {cpu_stage("upload", kUpload)};
constexpr heddle_access kReads[] = {sampled_linear("albedo_table")};

class Ggx {
 public:
  heddle_status prepare(const PassHost&) {
    is_uploaded_ = false;
    return HEDDLE_OK;
  }
  std::uint32_t activity(const Frame&) const { return is_uploaded_ ? HEDDLE_KEEP : HEDDLE_RUN; }
  heddle_status execute(const Frame& frame) {
    heddle_mapped table{};
    if (const heddle_status status = frame.map("albedo_table", table); status != HEDDLE_OK) return status;
    constexpr std::size_t kRowBytes = heddle::ggx::kTableWidth * 2 * sizeof(float);
    for (std::size_t row = 0; row < heddle::ggx::kTableSize; ++row)
      std::memcpy(static_cast<char*>(table.data) + row * table.row_bytes,
                  heddle::ggx::albedo_texels() + row * heddle::ggx::kTableWidth * 2, kRowBytes);
    is_uploaded_ = true;
    return HEDDLE_OK;
  }

 private:
  bool is_uploaded_ = false;
};

// The service's address is known when the library is loaded, not when it is compiled.
const heddle_function kFunctions[] = {
    function("surface_material", "surface_material.glsl", kReads, nullptr, heddle::ggx::service()),
};

const heddle_technique kGgx =
    technique<Ggx>("surface_material/ggx", "GGX with all bounces, and a diffuse layer that takes what is left",
                   "Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces; Kulla and Conty 2017, "
                   "Revisiting Physically Based Shading at Imageworks",
                   kPorts, kParameters, kStages, kFunctions);

}  // namespace

HEDDLE_PLUGIN(kGgx)
