// SPDX-License-Identifier: Apache-2.0
// bake_visibility/hemicube: the scene drawn from every element, five faces each, many elements a submission; the pixels
// that nothing covers, weighted by the cosine in closed form, are what is open.
#include "hemicube.hpp"

#include "params.h"

#include "bake_parameters.hpp"
#include "bake_parts.hpp"
#include "point_sequences.hpp"

#include <heddle/slices.h>
#include <heddle/pass.hpp>
#include <heddle/views.hpp>

#include <bit>
#include <cstring>

namespace {

using namespace baked_visibility;
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what occludes: opaque and masked batches"),
    port("occlusion", HEDDLE_PORT_ARTIFACT, HEDDLE_OUT, "visibility and mean open direction of every element"),
    port("report", HEDDLE_PORT_REPORT, HEDDLE_OUT, "how much was asked, and what could not be done as wished"),
    buffer_out("elements", 48, "vec4 elements[];", "tangents and normal, and each's part of the surface's own normal"),
    buffer_out("weights", 4, "float weights[];", "of each pixel of a tile, of the cosine-weighted hemisphere"),
    buffer_out("sums", 32, "vec4 sums[];", "weight, open weight; open direction"),
    image_out_sized("depth_maps", VK_FORMAT_D32_SFLOAT, 1, 1, "five faces of an element of the slice, reversed depth"),
};

constexpr const char* kCasters[] = {"both_sides", "fronts", nullptr};
constexpr double kResolutionLadder[] = {8, 16, 32, 64, 128};
constexpr heddle_parameter kParameters[] = {
    knob(integer("resolution", "px", 4, 256, 32, "side of the upper face, the next even number",
                 HEDDLE_PARAMETER_REDECLARE),
         kResolutionLadder),
    elements_parameter(HEDDLE_PARAMETER_REDECLARE),
    spacing_parameter(HEDDLE_PARAMETER_REDECLARE),
    inset_parameter(HEDDLE_PARAMETER_REDECLARE),
    detail_parameter(HEDDLE_PARAMETER_REDECLARE),
    reach_parameter(HEDDLE_PARAMETER_REDECLARE),
    choice("casters", kCasters, 0, "what occludes of surfaces that are not double-sided: both sides, or fronts alone"),
    toggle("turned", true, "each hemicube about its normal by an angle of its own: noise in place of bands"),
    integer("batch", "1", 1, 1024, 256, "elements a submission, whose faces are there at a time",
            HEDDLE_PARAMETER_REDECLARE),
    toggle("find_open", true, "parts that nothing rises above are open without a look"),
    toggle("fill", true, "elements that see nothing, because they lie in something, take the mean of open neighbours"),
};

constexpr heddle_access kFit[] = {host_write("elements"), host_write("weights"), host_write("sums")};
constexpr heddle_access kDraw[] = {drawn("surfaces"), depth_cleared("depth_maps")};
constexpr heddle_access kSum[] = {storage_read("elements"), storage_read("weights"), sampled("depth_maps"),
                                  storage_read_write("sums")};  // what other slices wrote stays
constexpr heddle_access kFetch[] = {host_read("sums")};
constexpr heddle_access kKeep[] = {value("occlusion"), value("report")};
enum : std::uint32_t { kFitStage, kDrawStage, kSumStage, kFetchStage, kKeepStage };
constexpr heddle_stage kStages[] = {
    cpu_stage("fit", kFit),     gpu_stage("draw", kDraw), gpu_stage("sum", kSum),
    cpu_stage("fetch", kFetch), cpu_stage("keep", kKeep),
};
constexpr heddle_shader kShaders[] = {
    surfaces_shader("depth", "draw", ""),
    compute_shader("sum", "sum", "sum.comp.glsl"),
};

constexpr std::uint64_t kMostMapBytes = 256U << 20;  // of the faces of a slice
/// Of the scene's diameter: what float32 rounds in a few products and sums, a few times over. As far in front of its
/// surface an eye stands, so that its own plane lies below all pixels, and as far away is its near plane.
constexpr double kRounding = 0x1p-20;

/// The same point, the same angle, wherever it stands in the artifact.
double angle_of(const Element& element) {
  std::uint64_t bits = 0;
  for (int c = 0; c < 3; ++c) bits = bits * 0x100000001b3ULL + std::bit_cast<std::uint32_t>(element.position[c] + 0.0F);
  return 2 * std::numbers::pi * sampling::random_number(bits);
}

class Hemicube {
 public:
  heddle_status declare(const PassHost& host) {
    side_ = 2 * ((static_cast<std::uint32_t>(host.integer("resolution")) + 1) / 2);
    const std::uint64_t most = std::max<std::uint64_t>(kMostMapBytes / (12ULL * side_ * side_), 1);
    if (const heddle_status status = make_elements(host, set_); status != HEDDLE_OK) return status;
    const std::uint64_t count = std::max<std::uint64_t>(set_.elements.size(), 1);
    batch_ = static_cast<std::uint32_t>(std::min({static_cast<std::uint64_t>(host.integer("batch")), most, count}));
    heddle_shape maps{};
    maps.width = side_;
    maps.height = 3 * side_;
    maps.layers = batch_;
    heddle_shape elements{};
    elements.byte_size = 16ULL * HEMICUBE_VECTORS_PER_ELEMENT * count;
    heddle_shape weights{};
    weights.byte_size = 12ULL * side_ * side_;
    heddle_shape sums{};
    sums.byte_size = 16ULL * HEMICUBE_VECTORS_PER_SUM * count;
    for (const auto& [name, shape] : {std::pair("depth_maps", maps), std::pair("elements", elements),
                                      std::pair("weights", weights), std::pair("sums", sums)})
      if (const heddle_status status = host.set_shape(name, shape); status != HEDDLE_OK) return status;
    return HEDDLE_OK;
  }

  std::uint32_t activity(const Frame& frame) const {
    const bool is_always = frame.stage() == kFitStage || frame.stage() == kKeepStage;
    return is_always || !asked_.empty() ? HEDDLE_RUN : HEDDLE_NOTHING;
  }

  heddle_status record(const Frame& frame) { return frame.stage() == kDrawStage ? draw(frame) : sum(frame); }

  heddle_status execute(const Frame& frame) {
    switch (frame.stage()) {
      case kFitStage:
        return fit(frame);
      case kFetchStage:
        return fetch(frame);
      default:
        return keep(frame);
    }
  }

  /// What is done lies in the port `sums`, which the host keeps.
  heddle_status save_state(const Frame& frame) const {
    return frame.keep_state(std::span<const PartState>(parts_.states));
  }
  heddle_status load_state(const Frame&, std::span<const std::byte> state) const {
    std::vector<PartState> states(state.size());
    if (!states.empty()) std::memcpy(states.data(), state.data(), state.size());
    return parts_.began_as(states) ? HEDDLE_OK : HEDDLE_UNSUPPORTED;
  }

 private:
  // Of those that are asked.
  [[nodiscard]] std::uint32_t first_element(const Frame& frame) const { return frame.info().slice * batch_; }
  [[nodiscard]] std::uint32_t element_count(const Frame& frame) const {
    return std::min(batch_, static_cast<std::uint32_t>(asked_.size()) - first_element(frame));
  }

  static bool has_side(const Element& element) { return element.normal != glm::vec3(0.0F); }
  /// Tangents and normal.
  static glm::dmat3 axes_of(const PassHost& host, const Element& element) {
    if (!has_side(element)) return glm::dmat3(0.0);
    return hemicube::axes(glm::normalize(glm::dvec3(element.normal)), host.toggle("turned") ? angle_of(element) : 0.0);
  }

  heddle_status fit(const Frame& frame) {
    const PassHost host = frame.host();
    PartRules rules;
    rules.margin = 4 * lift();  // eyes stand in front of their elements, and float32 moves both
    rules.finds_open = host.toggle("find_open");
    rules.asked = {static_cast<double>(side_), host.parameter("casters"), host.parameter("turned")};
    if (const heddle_status status = parts_.begin(frame, set_, rules, sums_); status != HEDDLE_OK) return status;
    asked_ = parts_.asked(set_);
    std::vector<glm::vec4> rows;
    for (const std::uint32_t e : asked_) {
      const glm::dmat3 axes = axes_of(host, set_.elements[e]);
      const glm::dvec3 facing(set_.elements[e].facing);
      for (int axis = 0; axis < 3; ++axis)
        rows.emplace_back(glm::vec3(axes[axis]), static_cast<float>(glm::dot(facing, axes[axis])));
    }
    if (rows.empty()) rows.assign(HEMICUBE_VECTORS_PER_ELEMENT, glm::vec4(0.0F));
    const std::vector<double> exact = hemicube::weights(side_);
    const std::vector<float> weights(exact.begin(), exact.end());
    const auto put = [&](const char* port, const auto& values) {
      heddle_mapped out;
      const heddle_status status = frame.map(port, out);
      if (status == HEDDLE_OK) std::memcpy(out.data, values.data(), values.size() * sizeof values[0]);
      return status;
    };
    const std::vector<glm::vec4> none(HEMICUBE_VECTORS_PER_SUM * std::max<std::size_t>(set_.elements.size(), 1),
                                      glm::vec4(0.0F));
    for (const heddle_status status : {put("elements", rows), put("weights", weights), put("sums", none)})
      if (status != HEDDLE_OK) return status;
    return HEDDLE_OK;
  }

  [[nodiscard]] double lift() const { return kRounding * 2 * set_.radius; }
  /// One face of an element. Relative to the scene's centre, as all views are, so that instances are placed once.
  [[nodiscard]] HeddleView view_of(const Element& element, const glm::dmat3& axes, const hemicube::Face& face) const {
    const glm::dvec3 eye = glm::dvec3(element.position) + lift() * glm::normalize(glm::dvec3(element.facing));
    const glm::dmat3 turn(axes * face.right, axes * face.up, axes * -face.forward);
    glm::dmat4 rel_from_view(turn);
    rel_from_view[3] = glm::dvec4(eye, 1.0);
    const glm::dmat4 view_from_rel = glm::inverse(rel_from_view);
    const glm::dmat4 clip_from_rel = hemicube::projection(face.height == side_, lift()) * view_from_rel;
    HeddleView view{};
    const auto put = [](const glm::dmat4& matrix, float(&out)[16]) {
      for (int i = 0; i < 16; ++i) out[i] = static_cast<float>(matrix[i / 4][i % 4]);
    };
    put(clip_from_rel, view.clip_from_rel);
    put(clip_from_rel, view.previous_clip_from_rel);
    put(glm::inverse(clip_from_rel), view.rel_from_clip);
    put(view_from_rel, view.view_from_rel);
    put(rel_from_view, view.rel_from_view);
    view.half_size[0] = view.half_size[1] = 1.0F;
    view.near_distance = static_cast<float>(lift());
    view.extent[0] = side_;
    view.extent[1] = face.height;
    return view;
  }

  heddle_status draw(const Frame& frame) const {
    const auto views = Views::of(frame);
    if (!views) return HEDDLE_UNSUPPORTED;
    const auto faces = hemicube::faces(side_);
    std::uint64_t drawn = 0;
    for (std::uint32_t i = 0; i < element_count(frame); ++i) {
      const Element& element = set_.elements[asked_[first_element(frame) + i]];
      if (!has_side(element)) continue;
      const glm::dmat3 axes = axes_of(frame.host(), element);
      for (const hemicube::Face& face : faces) {
        const HeddleView view = view_of(element, axes, face);
        heddle_draw drawing = Frame::drawing("depth");
        drawing.view = &view;
        drawing.include = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_MASKED;
        drawing.layer = i;
        drawing.y = face.first_row;
        drawing.width = side_;
        drawing.height = face.height;
        drawing.cull = frame.host().choice("casters") == 1 ? HEDDLE_CULL_MATERIAL : HEDDLE_CULL_DEFAULT;
        const heddle_placed_draw placed{sizeof placed, 1, &drawing, {set_.origin.x, set_.origin.y, set_.origin.z}};
        if (const heddle_status status = views->draw(placed); status != HEDDLE_OK) return status;
        ++drawn;
      }
    }
    heddle::pass::count(frame.host(), "faces", drawn);
    return HEDDLE_OK;
  }

  heddle_status sum(const Frame& frame) const {
    const HemicubePush push{first_element(frame), side_, 0, 0};
    if (const heddle_status status = frame.dispatch("sum", element_count(frame), 1, 1, push); status != HEDDLE_OK)
      return status;
    const std::uint64_t done = std::uint64_t{first_element(frame)} + element_count(frame);
    if (const heddle_status status = frame.progress(static_cast<double>(done) / static_cast<double>(asked_.size()));
        status != HEDDLE_OK)
      return status;
    if (done == asked_.size()) return HEDDLE_OK;
    const auto* slices = frame.host().service<heddle_slices_service>(HEDDLE_SLICES_SERVICE);
    if (slices == nullptr)
      return frame.host().fail(HEDDLE_UNSUPPORTED, "this host has no service " HEDDLE_SLICES_SERVICE);
    const heddle_status status = slices->begin_with(frame.host().raw(), frame.raw(), "draw");
    return status == HEDDLE_OK ? HEDDLE_MORE : status;
  }

  heddle_status fetch(const Frame& frame) {
    heddle_mapped out;
    if (const heddle_status status = frame.map("sums", out); status != HEDDLE_OK) return status;
    const auto* sums = static_cast<const glm::vec4*>(out.data);
    for (std::size_t i = 0; i < asked_.size(); ++i) {
      if (!has_side(set_.elements[asked_[i]])) continue;
      const glm::dvec4 weights(sums[HEMICUBE_VECTORS_PER_SUM * i]), bent(sums[HEMICUBE_VECTORS_PER_SUM * i + 1]);
      sums_[asked_[i]] = {weights.x, weights.y, {bent.x, bent.y, bent.z}};
    }
    return HEDDLE_OK;
  }

  heddle_status keep(const Frame& frame) {
    if (const heddle_status status = parts_.keep(frame, set_, sums_); status != HEDDLE_OK) return status;
    const Blind blind = set_values(set_, sums_, frame.host().toggle("fill"), std::size_t{3} * side_ * side_);
    for (const std::string& remark : set_.remarks)
      if (const heddle_status status = frame.add_row("report", HEDDLE_SEVERITY_WARNING, remark); status != HEDDLE_OK)
        return status;
    const auto faces =
        HEMICUBE_FACES * std::ranges::count_if(asked_, [&](std::uint32_t e) { return has_side(set_.elements[e]); });
    const heddle_status status = frame.add_row("report", HEDDLE_SEVERITY_INFO, "visibility is baked",
                                               {{"elements", static_cast<double>(set_.elements.size())},
                                                {"pixels", 3.0 * side_ * side_},
                                                {"faces", static_cast<double>(faces)},
                                                {"submissions", std::ceil(static_cast<double>(asked_.size()) / batch_)},
                                                {"parts", static_cast<double>(set_.parts.size())},
                                                {"mapped", static_cast<double>(set_.mapped)},
                                                {"refined", static_cast<double>(set_.refined)},
                                                {"missed", static_cast<double>(set_.missed)},
                                                {"parts_known", parts_.count(PartState::kKnown)},
                                                {"parts_open", parts_.count(PartState::kOpen)},
                                                {"spacing", set_.spacing},
                                                {"reached", set_.reached},
                                                {"closed", static_cast<double>(blind.closed)},
                                                {"without_side", static_cast<double>(blind.without_side)}});
    if (status != HEDDLE_OK) return status;
    return frame.set_value<std::byte>("occlusion", to_bytes(set_.baked));
  }

  std::uint32_t side_ = 32, batch_ = 1;
  ElementSet set_;
  Parts parts_;
  std::vector<std::uint32_t> asked_;  // elements, in the order in which the ports hold them
  std::vector<Sums> sums_;
};

constexpr heddle_technique kHemicube = [] {
  heddle_technique t =
      technique<Hemicube>("bake_visibility/hemicube", "Occlusion of all surfaces by five drawings from every element",
                          "Cohen and Greenberg 1985, The Hemi-Cube; Hill 2004, Hardware Accelerating Art Production",
                          kPorts, kParameters, kStages, kShaders);
  t.components = fine_instances::kComponent;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kHemicube)
