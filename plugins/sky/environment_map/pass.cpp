// SPDX-License-Identifier: Apache-2.0
// sky/environment_map: the scene's environment as background and light; its images are made anew only when the
// environment or a parameter changed.
#include "environment.hpp"

#include <heddle/pass.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <string>

namespace {

using namespace heddle::pass;
namespace map = environment_map;

constexpr double kHalfPi = 1.57079632679489662;
constexpr const char* kResolutions[] = {"64", "128", "256", "512", nullptr};
constexpr std::uint32_t kResolutionSizes[] = {64, 128, 256, 512};
constexpr double kResolutionLadder[] = {0, 1, 2, 3};
constexpr double kSizeLadder[] = {16, 32, 64, 128, 256};
constexpr double kLevelsLadder[] = {4, 6, 8, 12, 16};
constexpr double kSamplesLadder[] = {16, 32, 64, 128, 256, 512, 1024};
constexpr double kBrightestLadder[] = {0, 64, 256, 1024};

constexpr std::uint32_t kMostLevels = 32;
constexpr std::uint64_t kBrightestHead = 144;  // 33 uint, and up to the next vec4
// A texel that spans a third of alpha is a detail of the lobe: one direction in its middle can stand for it.
constexpr double kTexelsToALobe = 3.0;

constexpr heddle_parameter kParameters[] = {
    knob(choice("resolution", kResolutions, 2, "side of the cube of mean radiance that is filtered",
                HEDDLE_PARAMETER_REDECLARE),
         kResolutionLadder),
    knob(integer("specular_size", "px", 8, 512, 64, "side of the filtered cubes", HEDDLE_PARAMETER_REDECLARE),
         kSizeLadder),
    knob(integer("levels", "1", 2, kMostLevels, 8, "filtered cubes, even in roughness", HEDDLE_PARAMETER_REDECLARE),
         kLevelsLadder),
    knob(integer("samples", "1", 8, 4096, 256, "directions that each filtered texel takes", HEDDLE_PARAMETER_REDECLARE),
         kSamplesLadder),
    knob(integer("brightest", "1", 0, 1024, 1024, "texels too bright for samples, each added exactly, at most",
                 HEDDLE_PARAMETER_REDECLARE),
         kBrightestLadder),
};

// Of the time that `integrate` takes with the defaults on one machine, roughly: importance tables and the cube; the
// rest follows.
constexpr double kImportanceShare = 0.05, kCubeShare = 0.6;

constexpr VkFormat kRgba = VK_FORMAT_R32G32B32A32_SFLOAT;
constexpr std::uint32_t kIrradianceSize = 32;    // the cosine lobe is far wider than its texels
constexpr std::uint32_t kIrradianceSource = 32;  // the same, for what it sums
constexpr std::uint32_t kImportanceWidth = 512, kImportanceHeight = 256;

constexpr heddle_port kPorts[] = {
    value_in("environment", "what the scene sends from infinitely far away"),
    image_out_sized("background", kRgba, 4, 4, "the image itself, padded by a texel on each side", HEDDLE_PORT_KEPT),
    image_out_sized("mean_radiance", kRgba, 256, 256, "cube of mean radiance with mips, without the brightest texels",
                    HEDDLE_PORT_KEPT | HEDDLE_PORT_CUBE, 6, 9),
    buffer_out("brightest", kBrightestHead, "uint brightest_first[33]; vec4 brightest[];",
               "what mean_radiance lacks, a list a level, first pair by level: direction, irradiance facing it",
               HEDDLE_PORT_KEPT),
    image_out_sized("specular", kRgba, 64, 64, "radiance averaged over GGX lobes, a cube for each roughness",
                    HEDDLE_PORT_KEPT | HEDDLE_PORT_CUBE, 48),
    image_out_sized("irradiance", kRgba, kIrradianceSize, kIrradianceSize, "irradiance by normal",
                    HEDDLE_PORT_KEPT | HEDDLE_PORT_CUBE, 6),
    image_out_sized("importance_rows", VK_FORMAT_R32_SFLOAT, 1, kImportanceHeight,
                    "share of luminance in the rows down to this one, to draw directions by", HEDDLE_PORT_KEPT),
    image_out_sized("importance_columns", VK_FORMAT_R32_SFLOAT, kImportanceWidth, kImportanceHeight,
                    "share of the row's luminance in the columns up to this one", HEDDLE_PORT_KEPT),
    value_out("placement", 64, "how the image is turned, and cd/m^2 of its 1",
              "vec4 environment_from_scene[3]; float environment_scale;"),
};

constexpr heddle_access kPadAccesses[] = {value("environment"), host_write("background")};
constexpr heddle_access kIntegrateAccesses[] = {
    value("environment"),     host_write("mean_radiance"),   host_write("brightest"),
    host_write("irradiance"), host_write("importance_rows"), host_write("importance_columns"),
};
constexpr heddle_access kFilterAccesses[] = {sampled_linear("mean_radiance"), storage_read("brightest"),
                                             storage_write("specular")};
constexpr heddle_access kPlaceAccesses[] = {value("environment"), value("placement")};
constexpr heddle_access kFunctionAccesses[] = {sampled_linear("background"), sampled_linear("specular"),
                                               sampled_linear("irradiance"), value("placement")};

enum : std::uint32_t { kPad, kIntegrate, kFilter, kPlace, kStageCount };
constexpr heddle_stage kStages[] = {
    cpu_stage("pad", kPadAccesses),
    cached_by("resolution levels brightest", cpu_stage("integrate", kIntegrateAccesses)),
    gpu_stage("filter", kFilterAccesses),
    cpu_stage("place", kPlaceAccesses),
};
constexpr heddle_shader kShaders[] = {compute_shader("filter", "filter", "filter.comp.glsl")};
constexpr heddle_function kFunctions[] = {function("sky", "sky.glsl", kFunctionAccesses)};

struct Placement {
  float environment_from_scene[3][4];
  float scale;
  float reserved[3];
};
static_assert(sizeof(Placement) == 64, "three vec4 and a float, std430");

/// The host's value: a record, and behind it the texels.
const HeddleEnvironment* environment_of(const Frame& frame) {
  const auto records = frame.value<HeddleEnvironment>("environment");
  return records.empty() ? nullptr : records.data();
}

std::uint32_t mips_of(std::uint32_t size) {
  std::uint32_t mips = 1;
  while ((size >> mips) > 0) ++mips;
  return mips;
}

void store(const map::Cube& cube, float* out) {
  for (const glm::dvec3& texel : cube.texels) {
    for (int c = 0; c < 3; ++c) *out++ = static_cast<float>(texel[c]);
    *out++ = 1.0F;
  }
}

class EnvironmentMap {
 public:
  heddle_status declare(const PassHost& host) {
    const heddle_shape environment = host.shape("environment");
    if (environment.width == 0) return host.fail(HEDDLE_BAD_INPUT, "the scene's environment is empty");
    heddle_shape background{};
    background.width = environment.width + 2;
    background.height = environment.height + 2;
    heddle_shape mean{};
    mean.width = mean.height = kResolutionSizes[host.choice("resolution")];
    mean.mips = mips_of(mean.width);
    heddle_shape specular{};
    specular.width = specular.height = static_cast<std::uint32_t>(host.integer("specular_size"));
    specular.layers = 6 * static_cast<std::uint32_t>(host.integer("levels"));
    heddle_shape brightest{};
    brightest.byte_size = kBrightestHead + std::uint64_t{32} * static_cast<std::uint64_t>(host.integer("brightest")) *
                                               static_cast<std::uint64_t>(host.integer("levels"));
    heddle_status status = host.set_shape("background", background);
    if (status == HEDDLE_OK) status = host.set_shape("mean_radiance", mean);
    if (status == HEDDLE_OK) status = host.set_shape("specular", specular);
    if (status == HEDDLE_OK) status = host.set_shape("brightest", brightest);
    return status;
  }

  heddle_status prepare(const PassHost&) {
    made_from_ = {};
    return HEDDLE_OK;
  }

  std::uint32_t activity(const Frame& frame) {
    if (frame.stage() == kPlace) return HEDDLE_RUN;
    const HeddleEnvironment* environment = environment_of(frame);
    std::uint32_t& made_from = made_from_[frame.stage()];
    if (environment == nullptr || environment->revision == made_from) {
      return environment == nullptr ? HEDDLE_RUN : HEDDLE_KEEP;
    }
    made_from = environment->revision;  // here, because an artifact comes without a call of execute
    return HEDDLE_RUN;
  }

  heddle_status execute(const Frame& frame) {
    const HeddleEnvironment* environment = environment_of(frame);
    if (environment == nullptr) return frame.host().fail(HEDDLE_BAD_INPUT, "the scene has no environment");
    if (frame.stage() == kPlace) return place(frame, *environment);
    const std::size_t count = std::size_t{environment->width} * environment->height * 4;
    const map::Equirectangular image{
        environment->width, environment->height, {reinterpret_cast<const float*>(environment + 1), count}};
    return frame.stage() == kPad ? pad(frame, image) : integrate(frame, image);
  }

  heddle_status record(const Frame& frame) { return frame.dispatch_over("filter", "specular"); }

 private:
  static heddle_status pad(const Frame& frame, const map::Equirectangular& image) {
    heddle_mapped background{};
    if (const heddle_status status = frame.map("background", background); status != HEDDLE_OK) return status;
    const std::vector<float> padded = map::pad(image);
    std::memcpy(background.data, padded.data(), padded.size() * sizeof(float));
    return HEDDLE_OK;
  }

  static heddle_status integrate(const Frame& frame, const map::Equirectangular& image) {
    heddle_mapped mean{}, brightest{}, irradiance{}, rows{}, columns{};
    const std::pair<const char*, heddle_mapped*> ports[] = {
        {"mean_radiance", &mean},   {"brightest", &brightest},        {"irradiance", &irradiance},
        {"importance_rows", &rows}, {"importance_columns", &columns},
    };
    for (const auto& [name, mapped] : ports)
      if (const heddle_status status = frame.map(name, *mapped); status != HEDDLE_OK) return status;

    const std::vector<float> padded = map::pad(image);
    const map::Padded radiance(padded, image.width, image.height);
    const map::Importance tables = map::importance(radiance, kImportanceWidth, kImportanceHeight);
    std::memcpy(rows.data, tables.rows.data(), tables.rows.size() * sizeof(float));
    std::memcpy(columns.data, tables.columns.data(), tables.columns.size() * sizeof(float));
    if (const heddle_status status = frame.progress(kImportanceShare); status != HEDDLE_OK) return status;

    map::Cube cube = map::cube_from_image(radiance, mean.shape.width);
    if (const heddle_status status = frame.progress(kImportanceShare + kCubeShare); status != HEDDLE_OK) return status;
    const std::vector<map::Delta> deltas =
        map::take_brightest(cube, static_cast<std::size_t>(frame.host().integer("brightest")));
    write_brightest(deltas, mean.shape.width, static_cast<std::uint32_t>(frame.host().integer("levels")),
                    static_cast<std::byte*>(brightest.data));

    auto* out = static_cast<float*>(mean.data);
    for (std::uint32_t mip = 0; mip < mean.shape.mips; ++mip) {
      store(cube, out);
      out += cube.texels.size() * 4;
      if (cube.size == kIrradianceSource)
        store(map::irradiance(cube, deltas, kIrradianceSize), static_cast<float*>(irradiance.data));
      if (cube.size > 1) cube = map::half(cube);
    }
    return frame.progress(1.0);
  }

  /// Wide lobes need fewer of them.
  static void write_brightest(const std::vector<map::Delta>& deltas, std::uint32_t resolution, std::uint32_t levels,
                              std::byte* out) {
    std::array<std::uint32_t, kMostLevels + 1> first{};
    auto* pair = reinterpret_cast<float*>(out + kBrightestHead);
    for (std::uint32_t level = 0; level < levels; ++level) {
      const double roughness = (level + 1.0) / levels;
      std::uint32_t halvings = 0;
      while ((resolution >> (halvings + 1)) * roughness * roughness / kHalfPi >= kTexelsToALobe) ++halvings;
      const std::vector<map::Delta> merged = map::merge(deltas, halvings);
      first[level + 1] = first[level] + static_cast<std::uint32_t>(merged.size());
      for (const map::Delta& delta : merged)
        for (const glm::dvec3& vector : {delta.direction, delta.irradiance}) {
          for (int c = 0; c < 3; ++c) *pair++ = static_cast<float>(vector[c]);
          *pair++ = 0.0F;
        }
    }
    std::memcpy(out, first.data(), sizeof first);
  }

  static heddle_status place(const Frame& frame, const HeddleEnvironment& environment) {
    Placement placement{};
    const float* q = environment.rotation;
    // Rows of the inverse of the unit quaternion's matrix: its columns.
    const double x = static_cast<double>(q[0]), y = static_cast<double>(q[1]), z = static_cast<double>(q[2]),
                 w = static_cast<double>(q[3]);
    const double rows[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
        {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
        {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)},
    };
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        placement.environment_from_scene[row][column] = static_cast<float>(rows[row][column]);
    placement.scale = environment.scale;
    return frame.set_value("placement", std::span<const Placement>(&placement, 1));
  }

  std::array<std::uint32_t, kStageCount> made_from_{};  // revisions, by stage; the host counts from 1
};

constexpr heddle_technique kEnvironmentMap = [] {
  heddle_technique t =
      technique<EnvironmentMap>("sky/environment_map", "The scene's environment image, filtered for all roughnesses",
                                "Karis 2013, Real Shading in Unreal Engine 4; Krivanek and Colbert 2008, Real-time "
                                "Shading with Filtered Importance Sampling",
                                kPorts, kParameters, kStages, kShaders, kFunctions);
  t.role_revision = 2;
  t.features = "environment";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kEnvironmentMap)
