// SPDX-License-Identifier: Apache-2.0
// ray_tracing/path_tracer: the scene -> radiance with all its bounces, its parts, and how wrong it is, on the CPU. The
// physical reference of what lights, shadows and occlusion mean.
#include "content_hash.hpp"
#include "film.hpp"

#include <heddle/counters.h>
#include <heddle/functions.h>
#include <heddle/parallel.h>
#include <heddle/pass.hpp>

#include <glm/gtc/type_ptr.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <span>

namespace {

using namespace heddle::path_tracer;
using namespace heddle::pass;
using glm::dvec3;

constexpr VkFormat kRgba = VK_FORMAT_R32G32B32A32_SFLOAT, kR = VK_FORMAT_R32_SFLOAT;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what is seen and reflects; blended ones too"),
    value_in("camera", "where from"),
    value_in("lights", "every light of the frame"),
    value_in("light_textures", "images on rectangle lights", HEDDLE_PORT_OPTIONAL),
    value_in("environment", "for its size: the sky is looked at as finely", HEDDLE_PORT_OPTIONAL),
    image_out_sized("sky_map", kRgba, 512, 256, "what the role sky answers, equirectangular [cd/m^2]",
                    HEDDLE_PORT_KEPT),
    image_out("radiance", kRgba, "towards the camera [cd/m^2]; a: share of the pixel that surfaces cover",
              HEDDLE_PORT_KEPT),
    image_out("variance", kRgba, "of radiance, as an estimate [cd^2/m^4]", HEDDLE_PORT_KEPT),
    image_out("emission", kRgba, "what glows, and the background [cd/m^2]", HEDDLE_PORT_KEPT),
    image_out("direct", kRgba, "light that was reflected once [cd/m^2]", HEDDLE_PORT_KEPT),
    image_out("indirect_diffuse", kRgba, "reflected more often, at last by a diffuse lobe [cd/m^2]", HEDDLE_PORT_KEPT),
    image_out("indirect_specular", kRgba, "reflected more often, at last by a specular lobe [cd/m^2]",
              HEDDLE_PORT_KEPT),
    image_out("occlusion", kR, "1 open, 0 closed, within occlusion_radius; 1 unless `visibility`", HEDDLE_PORT_KEPT),
    image_out("shadow", kR, "1 lit by shadow_light, 0 in shadow; 1 unless `visibility`", HEDDLE_PORT_KEPT),
};

constexpr const char* kPoints[] = {"sobol", "independent", nullptr};
constexpr const char* kFilters[] = {"box", "point", nullptr};
constexpr const char* kGlow[] = {"lights", "seen", nullptr};
constexpr double kSampleLadder[] = {1, 4, 16, 64, 256, 1024, 4096};
constexpr double kBounceLadder[] = {1, 2, 4, 8, 16, 0};
constexpr double kSkyLadder[] = {64, 128, 256, 512, 1024};

constexpr heddle_parameter kParameters[] = {
    knob(integer("samples", "1", 1, 1000000, 64,
                 "paths a pixel; powers of four times 2 fill the square most evenly; a checkpoint of more "
                 "is shown whole"),
         kSampleLadder),
    parameter("target_error", "1", 0, 1, 0,
              "ends once the standard error, over all pixels, is this share of the mean radiance; 0: never before "
              "`samples`"),
    integer("samples_per_frame", "1", 0, 1000000, 0, "how many of them in one frame; 0: all"),
    choice("points", kPoints, 0, "sobol: Owen-scrambled Sobol points; independent: numbers without plan"),
    choice("filter", kFilters, 0, "box: rays anywhere in the pixel; point: through its centre, as rasterizers look"),
    knob(integer("bounces", "1", 0, 65535, 0, "reflections of light, at most; 0: as many as there are"), kBounceLadder),
    integer("roulette_from", "1", 1, 65535, 4, "reflections that no path is ended before by chance"),
    integer("metal_branches", "1", 1, 64, 2, "paths that go on from the first surface, where that is metal"),
    toggle("multiple_scattering", true, "as surface_material/ggx's parameter, which must be the same"),
    choice("emission", kGlow, 0,
           "what glows lights others (lights), or is seen by the camera alone, where lights stand for it (seen)"),
    toggle("blended_shadows", true, "light that passes through blended surfaces is tinted by them; else it is not"),
    toggle("visibility", false, "makes `occlusion` and `shadow` too, for up to two more rays a sample"),
    parameter("occlusion_radius", "m", 1e-6, 1e9, 0.5, "distance from which on a surface no longer occludes"),
    integer("shadow_light", "1", -2, 1000000, -1,
            "whose shadow: the light's number; -1: the first that casts one; -2: of all, by what each sends"),
    knob(integer("sky_resolution", "px", 8, 8192, 256,
                 "rows of the image of the sky; an environment of more rows has its own"),
         kSkyLadder),
    integer("threads", "1", 0, 1024, 0, "that trace; 0: one a processor. Changes no bit"),
    toggle("replay", false,
           "asks Embree alone for all rays once more, in the same threads: counters say how long that takes"),
    text("checkpoint",
         "file that samples are kept in and taken from; a folder (with / at its end): one for each scene and settings",
         HEDDLE_PARAMETER_REDECLARE),
};

constexpr heddle_access kSkyAccesses[] = {storage_write("sky_map")};
constexpr heddle_access kTraceAccesses[] = {
    host_read("sky_map"),    host_read("surfaces"),          value("camera"),
    value("lights"),         value("light_textures"),        value("environment"),
    host_write("radiance"),  host_write("variance"),         host_write("emission"),
    host_write("direct"),    host_write("indirect_diffuse"), host_write("indirect_specular"),
    host_write("occlusion"), host_write("shadow"),
};
enum : std::uint32_t { kSky, kTrace };
constexpr heddle_stage kStages[] = {gpu_stage("sky", kSkyAccesses), cpu_stage("trace", kTraceAccesses)};
constexpr heddle_shader kShaders[] = {compute_shader("sky", "sky", "sky.comp.glsl", "sky surface_material")};

/// Paths, at most, and tiles that are traced before the host is asked whether to go on: within about a second.
constexpr std::uint32_t kPathsAStep = 1U << 16U, kTilesAStep = 64;
/// Of what a sample is: to be raised with every change of its bytes, so that no checkpoint mixes two.
constexpr int kVersion = 5;
/// Samples of each pixel between two looks at the error.
constexpr std::uint32_t kLeastRound = kReplicates;

/// Rays of a view, from the origin of the triangles.
class Camera {
 public:
  Camera(const HeddleView& view, const dvec3& origin)
      : scale_(2.0 / glm::dvec2(view.extent[0], view.extent[1])),
        jitter_(view.jitter[0], view.jitter[1]),
        half_size_(view.half_size[0], -view.half_size[1]),
        near_(static_cast<double>(view.near_distance)),
        is_flat_(view.is_orthographic != 0),
        axes_(glm::dmat4(glm::make_mat4(view.rel_from_view))),
        origin_(origin + dvec3(glm::dmat4(glm::make_mat4(view.rel_from_view))[3])) {}

  /// `place`: in the pixel, from its upper left corner.
  [[nodiscard]] Ray ray(std::uint32_t x, std::uint32_t y, const glm::dvec2& place) const {
    const glm::dvec2 at = ((glm::dvec2(x, y) + place - jitter_) * scale_ - 1.0) * half_size_;
    const dvec3 start = is_flat_ ? dvec3(at, -near_) : dvec3(at, -1.0) * near_;
    return {origin_ + axes_ * start, glm::normalize(axes_ * (is_flat_ ? dvec3(0, 0, -1) : dvec3(at, -1.0)))};
  }

 private:
  glm::dvec2 scale_, jitter_, half_size_;
  double near_;
  bool is_flat_;
  glm::dmat3 axes_;
  dvec3 origin_;
};

/// The mapped outputs.
struct Outputs {
  heddle_mapped radiance, variance, emission, direct, indirect_diffuse, indirect_specular, occlusion, shadow;

  heddle_status map(const Frame& frame) {
    const std::pair<const char*, heddle_mapped*> all[] = {{"radiance", &radiance},
                                                          {"variance", &variance},
                                                          {"emission", &emission},
                                                          {"direct", &direct},
                                                          {"indirect_diffuse", &indirect_diffuse},
                                                          {"indirect_specular", &indirect_specular},
                                                          {"occlusion", &occlusion},
                                                          {"shadow", &shadow}};
    for (const auto& [name, mapped] : all)
      if (const heddle_status status = frame.map(name, *mapped); status != HEDDLE_OK) return status;
    return HEDDLE_OK;
  }

  void write(const Film& film) const {
    for (std::uint32_t y = 0; y < radiance.shape.height; ++y)
      for (std::uint32_t x = 0; x < radiance.shape.width; ++x) {
        const PixelSums& sums = film.at(x, y);
        const std::uint32_t samples = film.samples_at(x, y);
        const double scale = samples > 0 ? 1.0 / samples : 0.0;
        const double coverage = std::clamp(sums.coverage * scale, 0.0, 1.0);
        put(radiance, x, y, sums.mean(samples), coverage);
        put(variance, x, y, sums.variance(samples), 1.0);
        put(emission, x, y, sums.emission * scale, coverage);
        put(direct, x, y, sums.direct * scale, coverage);
        put(indirect_diffuse, x, y, sums.indirect_diffuse * scale, coverage);
        put(indirect_specular, x, y, sums.indirect_specular * scale, coverage);
        *at(occlusion, x, y, 1) = static_cast<float>(sums.occlusion * scale);
        *at(shadow, x, y, 1) = static_cast<float>(sums.shadow * scale);
      }
  }

 private:
  static float* at(const heddle_mapped& image, std::uint32_t x, std::uint32_t y, std::uint32_t channels) {
    return reinterpret_cast<float*>(static_cast<std::byte*>(image.data) + y * image.row_bytes) +
           std::size_t{x} * channels;
  }
  static void put(const heddle_mapped& image, std::uint32_t x, std::uint32_t y, const dvec3& value, double alpha) {
    float* out = at(image, x, y, 4);
    for (glm::length_t c = 0; c < 3; ++c) out[c] = static_cast<float>(value[c]);
    out[3] = static_cast<float>(alpha);
  }
};

class PathTracer {
 public:
  heddle_status declare(const PassHost& host) {
    const std::string written = host.text("checkpoint");
    checkpoint_place_ = written.empty() ? written : host.resolve_path(written);
    is_folder_ = written.ends_with('/');
    film_ = {};
    const heddle_shape environment = host.shape("environment");
    heddle_shape map{};
    map.height = static_cast<std::uint32_t>(host.integer("sky_resolution"));
    map.width = 2 * map.height;
    if (environment.is_bound != 0 && environment.height > map.height) {
      map.width = environment.width;
      map.height = environment.height;
    }
    return host.set_shape("sky_map", map);
  }

  heddle_status prepare(const PassHost&) {
    is_drawn_ = is_done_ = false;
    return HEDDLE_OK;
  }

  std::uint32_t activity(const Frame& frame) {
    if (frame.info().is_still == 0) is_drawn_ = is_done_ = false;
    if (frame.stage() == kTrace) tell_of_material(frame.host());
    return (frame.stage() == kSky ? is_drawn_ : is_done_) ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  heddle_status record(const Frame& frame) {
    is_drawn_ = true;
    return frame.dispatch_over("sky", "sky_map");
  }

  heddle_status execute(const Frame& frame) {
    heddle_mapped sky;
    Outputs outputs;
    heddle_status status = frame.map("sky_map", sky);
    if (status == HEDDLE_OK) status = outputs.map(frame);
    if (status == HEDDLE_OK) status = read_scene(frame, sky);
    if (status != HEDDLE_OK) return status;
    const HeddleView view = frame.value<HeddleView>("camera").front();
    const std::uint32_t width = outputs.radiance.shape.width, height = outputs.radiance.shape.height;
    describe(frame, view);
    const std::uint64_t key = key_of();
    counts_ = {};
    replay_ = {};
    std::uint64_t taken_up = 0;
    if (!film_.is_of(width, height, key)) {
      film_.reset(width, height, key);
      checkpoint_ = checkpoint_of();
      status = take_up(frame.host(), taken_up);
      if (status != HEDDLE_OK) {
        film_ = {};  // no frame may write over what was refused
        geometry_.set_alpha_test(nullptr, nullptr);
        return status;
      }
    }
    tell_of_more(frame.host());
    const std::uint32_t before = film_.samples();
    status = trace(frame, view);
    const bool is_new = film_.samples() != before || status != HEDDLE_OK;
    if (is_new && !checkpoint_.empty()) keep(frame.host());
    count(frame.host(), film_.samples() - before, taken_up);
    geometry_.set_alpha_test(nullptr, nullptr);
    if (status != HEDDLE_OK) return status;
    outputs.write(film_);
    return HEDDLE_OK;
  }

 private:
  /// The service's BRDF is told here whether it compensates, the shaders' in its own pass: said once for each time that
  /// the two come apart.
  void tell_of_material(const PassHost& host) {
    const auto* functions = host.service<heddle_functions_service>(HEDDLE_FUNCTIONS_SERVICE);
    std::array<double, 3> other{};
    const bool is_other =
        functions != nullptr &&
        functions->provider_parameter(host.raw(), "surface_material", 0, "multiple_scattering", other.data()) == 1 &&
        (other[0] != 0.0) != host.toggle("multiple_scattering");
    if (is_other && !is_told_of_material_) {
      host.warn(std::string("multiple_scattering is ") + (other[0] != 0.0 ? "false" : "true") + " here and " +
                (other[0] != 0.0 ? "true" : "false") +
                " in the pass of role surface_material: paths are reflected by another material than the one that "
                "shaders have; give both the same value");
    }
    is_told_of_material_ = is_other;
  }

  /// Fewer samples asked for than there are: said once for each number.
  void tell_of_more(const PassHost& host) {
    const std::int64_t wanted = host.integer("samples");
    const bool is_less = wanted < static_cast<std::int64_t>(film_.samples());
    if (is_less && wanted != told_samples_) {
      host.warn("`samples` asks for " + std::to_string(wanted) + " paths a pixel and " +
                std::to_string(film_.samples()) +
                " are taken: all of them stay in the picture, for sums cannot be divided again; it begins anew with "
                "another view, scene, seed or setting");
    }
    told_samples_ = is_less ? wanted : -1;
  }

  heddle_status read_scene(const Frame& frame, const heddle_mapped& sky) {
    const PassHost& host = frame.host();
    const auto* materials = host.service<heddle_materials_service>(HEDDLE_MATERIALS_SERVICE);
    if (materials == nullptr)
      return host.fail(HEDDLE_UNSUPPORTED, "needs the host's service " HEDDLE_MATERIALS_SERVICE);
    integrator_.material = host.function_service<heddle_surface_material_service>("surface_material");
    if (integrator_.material == nullptr) {
      return host.fail(HEDDLE_BAD_INPUT,
                       "needs a surface_material that answers on the CPU too; found none above it: add a pass of role "
                       "'surface_material', technique 'ggx'");
    }
    if (frame.value<HeddleView>("camera").empty()) return host.fail(HEDDLE_BUG, "camera has no value");
    const heddle_snapshot* snapshot = nullptr;
    heddle_alpha_test alpha_test = nullptr;
    if (const heddle_status status = frame.snapshot("surfaces", snapshot, alpha_test); status != HEDDLE_OK)
      return status;
    if (!surfaces_.update(host.raw(), *materials, *snapshot)) return HEDDLE_BUG;
    if (!geometry_.update(*snapshot)) return host.fail(HEDDLE_FAILED, geometry_.error());
    geometry_.set_alpha_test(snapshot, alpha_test);
    // In large worlds both origins are far from the scene's zero: their difference is taken in float64.
    frame_origin_ = glm::make_vec3(frame.info().origin) - glm::make_vec3(snapshot->origin);

    const auto* texels = static_cast<const float*>(sky.data);
    ContentHash sky_hash;
    sky_hash.add_bytes(texels, std::size_t{16} * sky.shape.width * sky.shape.height);
    if (sky_hash.value() != sky_hash_) {
      sky_.set(sky.shape.width, sky.shape.height, texels);
      sky_hash_ = sky_hash.value();
    }
    heddle_scene_look look{};
    look.struct_size = sizeof look;
    if (const heddle_status status = materials->look(host.raw(), &look); status != HEDDLE_OK) return status;
    if (look.revision != look_revision_ || snapshot->revision != snapshot_revision_) {
      look_revision_ = look.revision;
      snapshot_revision_ = snapshot->revision;
      scene_hash_ = hash_of(*snapshot);
    }

    const auto lights = frame.value<HeddleLight>("lights");
    const auto textures = frame.value<glm::vec4>("light_textures");
    const bool glows = host.choice("emission") == 0;
    if (const heddle_status status = check_shadow_light(host, lights); status != HEDDLE_OK) return status;
    ContentHash light_hash;
    light_hash.add(scene_hash_);
    light_hash.add(sky_.shines());
    light_hash.add(frame_origin_);
    light_hash.add(glows);
    light_hash.add_bytes(lights.data(), lights.size_bytes());
    light_hash.add_bytes(textures.data(), textures.size_bytes());
    if (light_hash.value() != light_hash_) {
      emitters_.update(lights, textures, frame_origin_, geometry_, surfaces_, sky_, glows);
      light_hash_ = light_hash.value();
    }
    integrator_.geometry = &geometry_;
    integrator_.surfaces = &surfaces_;
    integrator_.emitters = &emitters_;
    Settings& settings = integrator_.settings;
    settings.points = static_cast<Points>(host.choice("points"));
    settings.most_bounces = static_cast<std::uint32_t>(host.integer("bounces"));
    settings.roulette_from = static_cast<std::uint32_t>(host.integer("roulette_from"));
    settings.metal_branches = static_cast<std::uint32_t>(host.integer("metal_branches"));
    settings.has_multiple_scattering = host.toggle("multiple_scattering");
    settings.glows = glows;
    settings.has_blended_shadows = host.toggle("blended_shadows");
    settings.finds_visibility = host.toggle("visibility");
    settings.occlusion_radius = host.parameter("occlusion_radius");
    settings.shadow_light = static_cast<std::int32_t>(host.integer("shadow_light"));
    return HEDDLE_OK;
  }

  static heddle_status check_shadow_light(const PassHost& host, std::span<const HeddleLight> lights) {
    const std::int64_t wanted = host.integer("shadow_light");
    const auto is_it = [&](const HeddleLight& light) { return std::int64_t{light.id} == wanted; };
    if (wanted < 0 || std::ranges::any_of(lights, is_it)) return HEDDLE_OK;
    std::string there = "there are no lights";
    if (lights.size() == 1) there = "there is 1 light, number " + std::to_string(lights[0].id);
    if (lights.size() > 1) {
      const auto [low, high] = std::ranges::minmax_element(lights, {}, &HeddleLight::id);
      there = "there are " + std::to_string(lights.size()) + " lights, numbers " + std::to_string(low->id) + " to " +
              std::to_string(high->id);
    }
    return host.fail(HEDDLE_BAD_INPUT, "shadow_light: no light has the number " + std::to_string(wanted) + "; " +
                                           there +
                                           "; give one of them, -1 for the first that casts a shadow, or -2 for all");
  }

  [[nodiscard]] std::uint64_t hash_of(const heddle_snapshot& snapshot) const {
    ContentHash hash;
    const std::size_t vertices = snapshot.vertex_count, triangles = snapshot.triangle_count;
    hash.add_bytes(snapshot.positions, vertices * 12);
    hash.add_bytes(snapshot.normals, vertices * 12);
    hash.add_bytes(snapshot.uvs, vertices * 8);
    hash.add_bytes(snapshot.indices, triangles * 12);
    hash.add_bytes(snapshot.materials, triangles * 4);
    hash.add_bytes(snapshot.flags, triangles * 4);
    hash.add(surfaces_.hash());
    return hash.value();
  }

  /// All that a sample depends on, but for its number, as JSON: the key is made of nothing else, so that two keys that
  /// differ can say in what.
  void describe(const Frame& frame, const HeddleView& view) {
    const PassHost& host = frame.host();
    recipe_.clear();
    const auto add = [&](const char* name, const std::string& text) { recipe_.emplace_back(name, text); };
    const auto add_hash = [&](const char* name, const ContentHash& hash) {
      char text[24];
      std::snprintf(text, sizeof text, "\"%016llx\"", static_cast<unsigned long long>(hash.value()));
      add(name, text);
    };
    ContentHash scene, lights, sky, camera, material;
    scene.add(scene_hash_);
    scene.add(frame_origin_);
    const auto records = frame.value<HeddleLight>("lights");
    const auto textures = frame.value<glm::vec4>("light_textures");
    lights.add_bytes(records.data(), records.size_bytes());
    lights.add_bytes(textures.data(), textures.size_bytes());
    sky.add(sky_hash_);
    camera.add(view.rel_from_view);
    camera.add(view.half_size);
    camera.add(view.near_distance);
    camera.add(view.is_orthographic);
    camera.add(view.extent);
    camera.add(view.jitter);
    add_answers(material);
    add("version", std::to_string(kVersion));
    add("extent", "\"" + std::to_string(view.extent[0]) + " x " + std::to_string(view.extent[1]) + "\"");
    add_hash("scene", scene);
    add_hash("lights", lights);
    add_hash("sky", sky);
    add_hash("view", camera);
    add_hash("surface_material", material);
    add("seed", std::to_string(frame.info().seed));
    add("points", std::string("\"") + kPoints[host.choice("points")] + "\"");
    add("filter", std::string("\"") + kFilters[host.choice("filter")] + "\"");
    add("emission", std::string("\"") + kGlow[host.choice("emission")] + "\"");
    for (const char* name : {"bounces", "roulette_from", "metal_branches", "shadow_light"})
      add(name, std::to_string(host.integer(name)));
    for (const char* name : {"multiple_scattering", "blended_shadows", "visibility"})
      add(name, host.toggle(name) ? "true" : "false");
    char radius[32];
    std::snprintf(radius, sizeof radius, "%.17g", host.parameter("occlusion_radius"));
    add("occlusion_radius", radius);
  }

  /// What surface_material says of a few points: another one, or another version of it, hardly says the same.
  void add_answers(ContentHash& hash) const {
    const double view[3] = {0.6, 0.0, 0.8}, light[3] = {-0.48, 0.36, 0.8}, u[2] = {0.3, 0.7};
    for (const double metalness : {0.0, 0.5})
      for (const double roughness : {0.3, 0.8}) {
        heddle_surface_point point{};
        point.struct_size = sizeof point;
        point.base_color[0] = 0.8;
        point.base_color[1] = 0.5;
        point.base_color[2] = 0.2;
        point.metalness = metalness;
        point.roughness = roughness;
        point.ior = 1.5;
        double rgb[3], albedo[3], drawn[3], pdf = 0.0;
        const heddle_surface_material_service& service = *integrator_.material;
        service.evaluate(&point, view, light, 0, 1, rgb);
        service.albedo(&point, view[2], 0, 1, albedo);
        service.sample(&point, view, u, 0.4, drawn, &pdf);
        hash.add(rgb);
        hash.add(albedo);
        hash.add(drawn);
        hash.add(pdf);
      }
  }

  [[nodiscard]] std::uint64_t key_of() const {
    ContentHash hash;
    for (const auto& [name, text] : recipe_) {
      hash.add_bytes(name.data(), name.size());
      hash.add_bytes(text.data(), text.size());
    }
    return hash.value();
  }

  heddle_status trace(const Frame& frame, const HeddleView& view) {
    const PassHost& host = frame.host();
    const auto wanted = static_cast<std::uint32_t>(host.integer("samples"));
    const auto a_frame = static_cast<std::uint32_t>(host.integer("samples_per_frame"));
    const double target = host.parameter("target_error");
    const std::uint32_t first = film_.samples();
    const std::uint32_t last =
        a_frame == 0 ? wanted : std::min(wanted, first + std::min(a_frame, wanted - std::min(first, wanted)));
    is_done_ = has_reached(target);
    // Rounds double, so that looking at the error costs little; none is shorter than what gives every scrambling a
    // point.
    for (std::uint32_t done = first; !is_done_ && done < last;) {
      const std::uint32_t round = target > 0.0 ? std::max(kLeastRound, done / kLeastRound * kLeastRound) : last;
      done = std::min(last - done < round ? last : done + round, last);
      if (const heddle_status status = trace_to(frame, view, done, first, last); status != HEDDLE_OK) return status;
      is_done_ = has_reached(target);
    }
    is_done_ = is_done_ || film_.samples() >= wanted;
    return HEDDLE_OK;
  }

  [[nodiscard]] bool has_reached(double target) const {
    // Fewer than 8 points a scrambling say too little about their own error.
    return target > 0.0 && film_.samples() >= 8 * kReplicates && film_.error().relative <= target;
  }

  /// Until every pixel has `samples`, in steps of at most kPathsAStep paths: a few samples of all tiles, then the next.
  /// Each pixel's samples are summed in their order whatever the steps, so that these change no bit.
  heddle_status trace_to(const Frame& frame, const HeddleView& view, std::uint32_t samples, std::uint32_t first,
                         std::uint32_t last) {
    struct Thread {
      Counts counts;
      Queries queries;
      std::uint64_t replayed_hits = 0, replay_ns = 0;
    };
    struct Work {
      PathTracer* self;
      Camera camera;
      std::uint32_t samples, first_tile;
      std::uint64_t seed;
      bool is_box;
      std::vector<Thread> threads;
    };
    const PassHost& host = frame.host();
    const auto* parallel = host.service<heddle_parallel_service>(HEDDLE_PARALLEL_SERVICE);
    const auto threads = static_cast<std::uint32_t>(host.integer("threads"));
    const std::uint32_t before = film_.samples(), tiles = film_.tile_count();
    Work work{this, Camera(view, frame_origin_), before, 0, frame.info().seed, host.choice("filter") == 0, {}};
    work.threads.resize(parallel != nullptr ? parallel->most_threads(host.raw(), threads) : 1);
    const bool replays = host.toggle("replay");
    for (Thread& thread : work.threads) thread.counts.record = replays ? &thread.queries : nullptr;
    const auto trace_tile = [](void* user, std::uint64_t index, std::uint32_t thread) {
      auto& job = *static_cast<Work*>(user);
      job.self->trace_tile(job.first_tile + static_cast<std::uint32_t>(index), job.samples, job.camera, job.seed,
                           job.is_box, job.threads[thread].counts);
    };
    const auto replay = [](void* user, std::uint64_t index, std::uint32_t) {
      auto& job = *static_cast<Work*>(user);
      Thread& recorded = job.threads[index];
      const std::uint64_t start = thread_ns();
      recorded.replayed_hits += job.self->geometry_.replay(recorded.queries.list);
      recorded.replay_ns += thread_ns() - start;
    };
    const std::uint64_t pixels =
        std::min<std::uint64_t>(std::uint64_t{view.extent[0]} * view.extent[1],
                                std::uint64_t{std::min(kTilesAStep, tiles)} * Film::kTile * Film::kTile);
    const auto slice =
        static_cast<std::uint32_t>(std::max<std::uint64_t>(kPathsAStep / std::max<std::uint64_t>(pixels, 1), 1));
    heddle_status status = HEDDLE_OK;
    while (work.samples < samples && status == HEDDLE_OK) {
      const std::uint32_t from = work.samples;
      work.samples += std::min(slice, samples - from);
      for (work.first_tile = 0; work.first_tile < tiles && status == HEDDLE_OK; work.first_tile += kTilesAStep) {
        const std::uint32_t count = std::min(kTilesAStep, tiles - work.first_tile);
        if (parallel != nullptr) {
          status = parallel->for_each(host.raw(), threads, count, trace_tile, &work);
        } else {
          for (std::uint32_t i = 0; i < count; ++i) trace_tile(&work, i, 0);
        }
        if (replays && status == HEDDLE_OK) {
          if (parallel != nullptr) {
            status = parallel->for_each(host.raw(), threads, work.threads.size(), replay, &work);
          } else {
            replay(&work, 0, 0);
          }
          for (Thread& thread : work.threads) thread.queries.list.clear();
        }
        const double share = static_cast<double>(work.first_tile + count) / tiles;
        const double done = (from - first + share * (work.samples - from)) / std::max(last - first, 1U);
        if (status == HEDDLE_OK) status = frame.progress(std::min(done, 1.0));
      }
    }
    for (const Thread& thread : work.threads) {
      counts_.rays += thread.counts.rays;
      counts_.shadow_rays += thread.counts.shadow_rays;
      counts_.visibility_rays += thread.counts.visibility_rays;
      replay_.hits += thread.queries.hits;
      replay_.replayed_hits += thread.replayed_hits;
      replay_.ns += thread.replay_ns;
    }
    return status;
  }

  /// What the calling thread has run: what others do to the machine counts little.
  static std::uint64_t thread_ns() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<std::uint64_t>(now.tv_sec) * 1000000000U + static_cast<std::uint64_t>(now.tv_nsec);
  }

  void trace_tile(std::uint32_t tile, std::uint32_t samples, const Camera& camera, std::uint64_t seed, bool is_box,
                  Counts& counts) {
    const std::uint32_t first = film_.tile_samples(tile);
    if (first >= samples) return;
    const Points points = integrator_.settings.points;
    film_.for_tile(tile, [&](std::uint32_t x, std::uint32_t y, PixelSums& sums) {
      const std::uint64_t pixel = sampling::pixel_seed(seed, x, y);
      for (std::uint32_t i = first; i < samples; ++i) {
        const Sampler sampler(points, pixel, i);
        const Ray ray = camera.ray(x, y, is_box ? sampler.pair(0) : glm::dvec2(0.5));
        sums.add(i, integrator_.estimate(ray, sampler, counts));
      }
    });
    film_.set_tile_samples(tile, samples);
  }

  [[nodiscard]] std::filesystem::path checkpoint_of() const {
    if (!is_folder_) return checkpoint_place_;
    char name[32];
    std::snprintf(name, sizeof name, "%016llx.path", static_cast<unsigned long long>(film_.key()));
    return checkpoint_place_ / name;
  }

  /// What is at the checkpoint's place is never written over unless it is this film's own.
  heddle_status take_up(const PassHost& host, std::uint64_t& taken_up) {
    if (checkpoint_.empty()) return HEDDLE_OK;
    const std::string shown = "checkpoint '" + checkpoint_.string() + "'";
    std::string found;
    switch (film_.load(checkpoint_, found)) {
      case Film::Found::kLoaded:
        taken_up = film_.samples();
        if (const std::int64_t wanted = host.integer("samples"); wanted < static_cast<std::int64_t>(taken_up))
          host.warn(shown + " holds " + std::to_string(taken_up) + " samples and `samples` asks for " +
                    std::to_string(wanted) + ": all that it holds are shown; for fewer give another checkpoint");
        told_samples_ = host.integer("samples");
        return HEDDLE_OK;
      case Film::Found::kForeign:
        return host.fail(HEDDLE_BAD_INPUT, shown +
                                               " is there and is no checkpoint of this technique: it stays as it is; "
                                               "give another name, or a folder with / at its end");
      case Film::Found::kOther:
        return host.fail(HEDDLE_BAD_INPUT,
                         shown + " was made of something else (" + differences(found) +
                             "): it stays as it is; give another name, delete it, or give a folder, with / at its end, "
                             "which keeps one for each scene and settings");
      case Film::Found::kDamaged:
        return set_aside(host, shown);
      case Film::Found::kNothing:
        break;
    }
    return HEDDLE_OK;
  }

  /// Name and both values, first the found one, of what a file's line of settings says otherwise than the recipe.
  [[nodiscard]] std::string differences(const std::string& line) const {
    if (line.empty()) return "its format is of another version";
    std::string all;
    for (const auto& [name, text] : recipe_) {
      const std::string label = "\"" + name + "\": ";
      const std::size_t at = line.find(label);
      std::string there = "nothing";
      if (at != std::string::npos) {
        const std::size_t begin = at + label.size();
        there = line.substr(begin, std::min(line.find(", \"", begin), line.find('}', begin)) - begin);
      }
      if (there == text) continue;
      const bool is_hash = name == "scene" || name == "lights" || name == "sky" || name == "view" ||
                           name == "surface_material";  // say nothing to people
      all += (all.empty() ? "" : ", ") + (name == "scene" ? "another scene, or seen from elsewhere"
                                          : is_hash       ? "another " + name
                                                          : name + " " + there + " instead of " + text);
    }
    return all.empty() ? "its key" : all;
  }

  /// A damaged file gets a name that nothing has yet.
  heddle_status set_aside(const PassHost& host, const std::string& shown) const {
    std::filesystem::path aside = checkpoint_;
    aside += ".damaged";
    std::error_code code;
    for (int i = 2; std::filesystem::exists(aside, code); ++i) {
      aside = checkpoint_;
      aside += ".damaged" + std::to_string(i);
    }
    std::filesystem::rename(checkpoint_, aside, code);
    if (code) return host.fail(HEDDLE_FAILED, shown + " is damaged, and cannot be set aside: " + code.message());
    host.warn(shown + " is damaged: it is '" + aside.filename().string() + "' now, and its samples are taken anew");
    return HEDDLE_OK;
  }

  void keep(const PassHost& host) {
    const FilmError error = film_.error();
    char figures[160];
    std::snprintf(figures, sizeof figures, "\"samples\": %u, \"standard_error\": %.9g, \"relative_error\": %.9g",
                  film_.samples(), std::isfinite(error.standard_error) ? error.standard_error : -1.0,
                  std::isfinite(error.relative) ? error.relative : -1.0);
    std::string line = std::string("{\"technique\": \"ray_tracing/path_tracer\", ") + figures;
    for (const auto& [name, text] : recipe_) line += ", \"" + name + "\": " + text;
    line += "}\n";
    if (const std::string problem = film_.save(checkpoint_, line); !problem.empty())
      host.warn("checkpoint is not kept: " + problem);
  }

  void count(const PassHost& host, std::uint32_t samples, std::uint64_t taken_up) const {
    const auto* counters = host.service<heddle_counters_service>(HEDDLE_COUNTERS_SERVICE);
    if (counters == nullptr) return;
    const std::pair<const char*, std::uint64_t> all[] = {{"samples", samples},
                                                         {"samples_taken_up", taken_up},
                                                         {"rays", counts_.rays},
                                                         {"shadow_rays", counts_.shadow_rays},
                                                         {"visibility_rays", counts_.visibility_rays},
                                                         {"glowing_triangles", emitters_.triangle_count()}};
    for (const auto& [name, value] : all) counters->add(host.raw(), name, value);
    if (host.toggle("replay")) {
      counters->add(host.raw(), "hits", replay_.hits);
      counters->add(host.raw(), "replayed_hits", replay_.replayed_hits);
      counters->add(host.raw(), "replay_us", replay_.ns / 1000);
    }
    const FilmError error = film_.error();
    if (std::isfinite(error.relative))
      counters->add(host.raw(), "relative_error_ppm", static_cast<std::uint64_t>(std::llround(error.relative * 1e6)));
  }

  Geometry geometry_;
  Surfaces surfaces_;
  Emitters emitters_;
  SkyMap sky_;
  Integrator integrator_;
  Film film_;
  Counts counts_;
  struct {
    std::uint64_t hits = 0, replayed_hits = 0, ns = 0;
  } replay_;
  dvec3 frame_origin_{0.0};
  std::uint64_t sky_hash_ = 0, scene_hash_ = 0, light_hash_ = 0, look_revision_ = 0, snapshot_revision_ = 0;
  std::vector<std::pair<std::string, std::string>> recipe_;  // describe()
  std::filesystem::path checkpoint_place_, checkpoint_;
  bool is_folder_ = false;
  bool is_told_of_material_ = false;
  std::int64_t told_samples_ = -1;  // fewer than there are, that was warned of
  bool is_drawn_ = false, is_done_ = false;
};

constexpr heddle_technique kPathTracer = [] {
  heddle_technique t = technique<PathTracer>(
      "ray_tracing/path_tracer", "Every path of light to the camera, unbiased, on the CPU",
      "Kajiya 1986, The Rendering Equation; Veach 1997, Robust Monte Carlo Methods for Light Transport Simulation",
      kPorts, kParameters, kStages, kShaders);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kPathTracer)
