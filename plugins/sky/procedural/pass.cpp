// SPDX-License-Identifier: Apache-2.0
// sky/procedural: a sun and clear air to the sky's radiance, irradiance and filtered radiance, made anew only when a
// parameter changed, and to a directional light.
#include "atmosphere.hpp"

#include <heddle/pass.hpp>

#include <optional>
#include <vector>

namespace {

using namespace heddle::pass;

constexpr double kHalfPi = 1.57079632679489662;
constexpr double kSamplesLadder[] = {8, 16, 32, 64, 128, 256};
constexpr double kFilterSamplesLadder[] = {32, 64, 128, 256, 512, 1024};

constexpr heddle_parameter kParameters[] = {
    parameter("sun_elevation", "rad", -kHalfPi, kHalfPi, 0.9, "of the sun above the horizon"),
    parameter("sun_azimuth", "rad", -8, 8, 0.7, "of the sun; 0 is -Z, pi/2 is +X"),
    parameter("sun_illuminance", "lx", 0, 1e9, 128000, "of the sun above the air, on a plane that faces it"),
    toggle("sun", true, "appends the sun to the lights"),
    parameter("mie_density", "1", 0, 100, 1, "haze: 1 is a clear day, 10 a hazy one"),
    color("ground_albedo", "1", 0, 1, {0.2, 0.2, 0.2}, "of the ground below the horizon"),
    parameter("altitude", "m", 0, 90000, 0, "of the viewer above that ground"),
    toggle("multiple_scattering", true, "light that was scattered twice and more, approximately"),
    knob(integer("samples", "1", 4, 512, 32, "stretches that each ray through the air is cut into"), kSamplesLadder),
    knob(integer("filter_samples", "1", 16, 2048, 256,
                 "directions that each filtered texel takes; irradiance sixteen times"),
         kFilterSamplesLadder),
};

constexpr VkFormat kFormat = VK_FORMAT_R32G32B32A32_SFLOAT;
constexpr std::uint32_t kSpecularLayers = 7;  // = sky_mapping.glsl

constexpr heddle_port kPorts[] = {
    value_out("lights", 0, "the scene's lights and the sun", nullptr, HEDDLE_INOUT),
    image_out_sized("transmittance", kFormat, 256, 64, "from a height to the top of the air", HEDDLE_PORT_KEPT),
    image_out_sized("multiple_scattering_table", kFormat, 32, 32, "isotropic source of later scattering, 1/sr",
                    HEDDLE_PORT_KEPT),
    image_out_sized("ground_irradiance", kFormat, 1, 1, "of flat ground from the sky, over the sun's illuminance",
                    HEDDLE_PORT_KEPT),
    image_out_sized("sky_map", kFormat, 128, 256, "radiance over the sun's illuminance, 1/sr", HEDDLE_PORT_KEPT),
    image_out_sized("specular", kFormat, 64, 96, "the same averaged over GGX lobes, a layer an alpha", HEDDLE_PORT_KEPT,
                    kSpecularLayers),
    image_out_sized("irradiance", kFormat, 32, 64, "irradiance over the sun's illuminance, by normal",
                    HEDDLE_PORT_KEPT),
};

constexpr heddle_access kSunAccesses[] = {value("lights")};
constexpr heddle_access kTransmittanceAccesses[] = {storage_write("transmittance")};
constexpr heddle_access kScatteringAccesses[] = {sampled_linear("transmittance"),
                                                 storage_write("multiple_scattering_table")};
constexpr heddle_access kGroundAccesses[] = {
    sampled_linear("transmittance"), sampled_linear("multiple_scattering_table"), storage_write("ground_irradiance")};
constexpr heddle_access kSkyMapAccesses[] = {sampled_linear("transmittance"),
                                             sampled_linear("multiple_scattering_table"), sampled("ground_irradiance"),
                                             storage_write("sky_map")};
constexpr heddle_access kFilterAccesses[] = {sampled_linear("sky_map"), storage_write("specular"),
                                             storage_write("irradiance")};
constexpr heddle_access kFunctionAccesses[] = {sampled_linear("sky_map"), sampled_linear("specular"),
                                               sampled_linear("irradiance")};

enum : std::uint32_t { kSun, kTransmittance, kMultipleScattering, kGround, kSkyMap, kFilter, kStageCount };
constexpr heddle_stage kStages[] = {
    cpu_stage("sun", kSunAccesses),
    gpu_stage("transmittance", kTransmittanceAccesses),
    gpu_stage("multiple_scattering", kScatteringAccesses),
    gpu_stage("ground", kGroundAccesses),
    gpu_stage("sky_map", kSkyMapAccesses),
    gpu_stage("filter", kFilterAccesses),
};
static_assert(std::size(kStages) == kStageCount);

constexpr heddle_shader kShaders[] = {
    compute_shader("transmittance", "transmittance", "transmittance.comp.glsl"),
    compute_shader("multiple_scattering", "multiple_scattering", "multiple_scattering.comp.glsl"),
    compute_shader("ground", "ground", "ground.comp.glsl"),
    compute_shader("sky_map", "sky_map", "sky_map.comp.glsl"),
    compute_shader("specular", "filter", "specular.comp.glsl"),
    compute_shader("irradiance", "filter", "irradiance.comp.glsl"),
};
constexpr heddle_function kFunctions[] = {function("sky", "sky.glsl", kFunctionAccesses)};

/// What the images depend on. Azimuth and illuminance are put in where the images are read.
std::vector<double> image_parameters(const PassHost& host) {
  std::vector<double> values;
  for (const char* name :
       {"sun_elevation", "mie_density", "altitude", "multiple_scattering", "samples", "filter_samples"}) {
    values.push_back(host.parameter(name));
  }
  for (const double channel : host.parameter3("ground_albedo")) values.push_back(channel);
  return values;
}

/// The sun as a light, or nothing when it is below the horizon.
std::optional<HeddleLight> sun_light(const PassHost& host, std::uint32_t id) {
  const double elevation = host.parameter("sun_elevation");
  const double azimuth = host.parameter("sun_azimuth");
  const glm::dvec3 color = host.parameter("sun_illuminance") *
                           sky_float64::sun_transmittance(host.parameter("altitude") * 1e-3, std::sin(elevation),
                                                          host.parameter("mie_density"));
  if (color.x <= 0.0 && color.y <= 0.0 && color.z <= 0.0) return std::nullopt;
  const glm::dvec3 to_sun(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                          -std::cos(azimuth) * std::cos(elevation));
  HeddleLight light{};
  light.type = HEDDLE_LIGHT_DIRECTIONAL;
  light.flags = HEDDLE_LIGHT_CASTS_SHADOW;
  light.radius = static_cast<float>(SKY_SUN_RADIUS);
  light.tangent[0] = static_cast<float>(std::cos(azimuth));
  light.tangent[2] = static_cast<float>(std::sin(azimuth));
  light.id = id;
  for (int i = 0; i < 3; ++i) {
    light.direction[i] = static_cast<float>(-to_sun[i]);
    light.intensity[i] = static_cast<float>(color[i]);
  }
  return light;
}

class ProceduralSky {
 public:
  heddle_status prepare(const PassHost&) {
    for (auto& made_from : made_from_) made_from.clear();
    return HEDDLE_OK;
  }

  std::uint32_t activity(const Frame& frame) {
    if (frame.stage() == kSun) return HEDDLE_RUN;
    return made_from_[frame.stage()] == image_parameters(frame.host()) ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  heddle_status execute(const Frame& frame) {
    const auto scene_lights = frame.value<HeddleLight>("lights");
    std::vector<HeddleLight> lights(scene_lights.begin(), scene_lights.end());
    if (frame.host().toggle("sun")) {
      if (const auto sun = sun_light(frame.host(), static_cast<std::uint32_t>(lights.size()))) lights.push_back(*sun);
    }
    return frame.set_value("lights", std::span<const HeddleLight>(lights));
  }

  heddle_status record(const Frame& frame) {
    const heddle_status status = record_stage(frame);
    if (status == HEDDLE_OK) made_from_[frame.stage()] = image_parameters(frame.host());
    return status;
  }

 private:
  static heddle_status record_stage(const Frame& frame) {
    switch (frame.stage()) {
      case kTransmittance:
        return frame.dispatch_over("transmittance", "transmittance");
      case kMultipleScattering:
        return frame.dispatch_over("multiple_scattering", "multiple_scattering_table");
      case kGround:
        return frame.dispatch("ground", 1);
      case kSkyMap:
        return frame.dispatch_over("sky_map", "sky_map");
      case kFilter: {
        const heddle_status status = frame.dispatch_over("specular", "specular");
        return status != HEDDLE_OK ? status : frame.dispatch_over("irradiance", "irradiance");
      }
      default:
        return HEDDLE_BUG;
    }
  }

  std::array<std::vector<double>, kStageCount> made_from_;  // parameters of each stage's images; empty: none yet
};

constexpr heddle_technique kProceduralSky =
    technique<ProceduralSky>("sky/procedural", "Clear sky: Rayleigh, Mie and ozone, with the sun as a light",
                             "Bruneton and Neyret 2008, Precomputed Atmospheric Scattering; Hillaire 2020, A "
                             "Scalable and Production Ready Sky "
                             "and Atmosphere Rendering Technique",
                             kPorts, kParameters, kStages, kShaders, kFunctions);

}  // namespace

HEDDLE_PLUGIN(kProceduralSky)
