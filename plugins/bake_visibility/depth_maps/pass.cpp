// SPDX-License-Identifier: Apache-2.0
// bake_visibility/depth_maps: the scene seen from directions all around, a few at a time, one orthographic depth map
// each; every element of every surface looks into all of them. What looks, where sums are kept and how often they are
// read back is the pipeline's: four of them, the default one being all on the GPU. Parts of the scene that nothing can
// occlude, that an earlier bake has answered, or that more directions no longer change are not looked at.
#include "compare.hpp"

#include "bake_directions.hpp"
#include "bake_parameters.hpp"
#include "bake_parts.hpp"
#include "depth_maps.hpp"

#include <heddle/slices.h>
#include <heddle/pass.hpp>
#include <heddle/views.hpp>

#include <cstring>

namespace {

using namespace baked_visibility;
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what occludes: opaque and masked batches"),
    port("occlusion", HEDDLE_PORT_ARTIFACT, HEDDLE_OUT, "visibility and mean open direction of every element"),
    port("report", HEDDLE_PORT_REPORT, HEDDLE_OUT, "how much was asked, and what could not be done as wished"),
    value_out("directions", 64, "of each: three rows of its view, and where it is", "vec4 directions[];"),
    buffer_out("elements", 48, "vec4 elements[];", "position and normals, relative to the scene's bounding sphere"),
    buffer_out("sums", 32, "vec4 sums[];", "weight, open weight, tests; open direction"),
    image_out_sized("depth_maps", VK_FORMAT_D32_SFLOAT, 1, 1, "of the directions of a slice, reversed depth"),
    image_out_sized("target", VK_FORMAT_R8G8B8A8_UNORM, 1, 1, "split_ramp, gpu_compare: halves of weight and sample"),
};

constexpr const char* kPipelines[] = {"float_sums", "split_ramp", "gpu_compare", "cpu_compare", nullptr};
enum : std::uint32_t { kFloatSums, kSplitRamp, kGpuCompare, kCpuCompare };
constexpr const char* kSets[] = {"fibonacci", "random", nullptr};
constexpr const char* kDepthFormats[] = {"d32", "d16", "d8", "d24", nullptr};
enum : std::uint32_t { kD32, kD16, kD8, kD24 };
constexpr const char* kCasters[] = {"both_sides", "fronts", nullptr};

constexpr double kDirectionLadder[] = {64, 256, 1024, 4096};
constexpr double kResolutionLadder[] = {256, 512, 1024, 2048};
constexpr double kFormatLadder[] = {2, 1, 3, 0};
constexpr heddle_parameter kParameters[] = {
    knob(integer("directions", "1", 1, 16384, 512, "over the whole sphere, shared by all elements"), kDirectionLadder),
    knob(integer("resolution", "px", 16, 4096, 1024, "side of a depth map", HEDDLE_PARAMETER_REDECLARE),
         kResolutionLadder),
    elements_parameter(HEDDLE_PARAMETER_REDECLARE),
    spacing_parameter(HEDDLE_PARAMETER_REDECLARE),
    inset_parameter(HEDDLE_PARAMETER_REDECLARE),
    detail_parameter(HEDDLE_PARAMETER_REDECLARE),
    reach_parameter(HEDDLE_PARAMETER_REDECLARE),
    parameter("bias", "px", 0, 16, 1, "texels of a depth map along the surface that an element reaches over"),
    parameter("bias_limit", "1", 0, 1000, 8,
              "largest slope that the bias follows; 0: all, and leaks at grazing angles"),
    knob(choice("depth_format", kDepthFormats, 0, "float32, or 24, 16 or 8 bits over the scene's diameter",
                HEDDLE_PARAMETER_REDECLARE),
         kFormatLadder),
    choice("casters", kCasters, 0, "what occludes of surfaces that are not double-sided: both sides, or fronts alone"),
    choice("pipeline", kPipelines, 0,
           "float_sums: all on the GPU; split_ramp: 8-bit sums of `passes` directions, read back; gpu_compare: 8 bits, "
           "read back for each direction; cpu_compare: depth maps read back",
           HEDDLE_PARAMETER_REDECLARE),
    integer("batch", "1", 1, 64, 8, "float_sums: directions whose depth maps are there at a time",
            HEDDLE_PARAMETER_REDECLARE),
    integer("passes", "1", 1, 17, 16, "split_ramp: directions that 8 bits add up; at 15 each 17 fill them",
            HEDDLE_PARAMETER_REDECLARE),
    choice("set", kSets, 0, "of directions: even, or independent of each other"),
    integer("seed", "1", 0, 1'000'000, 0, "turns the even set, chooses the random one"),
    toggle("find_open", true, "parts that nothing rises above are open without a look"),
    parameter(
        "settled", "1", 0, 1, 0,
        "parts whose visibility the last half of their directions changed by less are done; 0: none before the end"),
    toggle("fill", true, "elements that see nothing, because they lie in something, take the mean of open neighbours"),
};

constexpr heddle_access kFit[] = {value("directions"), host_write("elements")};
constexpr heddle_access kBegin[] = {host_write("sums")};
constexpr heddle_access kDraw[] = {drawn("surfaces"), depth_cleared("depth_maps")};
constexpr heddle_access kSample[] = {storage_read("elements"), value("directions"), sampled("depth_maps"),
                                     storage_read_write("sums")};
constexpr heddle_access kSplit[] = {storage_read("elements"), value("directions"), sampled("depth_maps"), [] {
                                      heddle_access a = color_cleared("target", {0, 0, 0, 0});
                                      a.blend = HEDDLE_BLEND_ADD;
                                      return a;
                                    }()};
constexpr heddle_access kCollect[] = {host_read("target")};
constexpr heddle_access kCompare[] = {host_read("depth_maps")};
constexpr heddle_access kLook[] = {host_read("sums")};
constexpr heddle_access kKeep[] = {value("occlusion"), value("report")};
enum : std::uint32_t {
  kFitStage,
  kBeginStage,
  kSettleStage,
  kDrawStage,
  kSampleStage,
  kSplitStage,
  kCollectStage,
  kCompareStage,
  kFetchStage,
  kKeepStage
};
constexpr heddle_stage kStages[] = {
    cpu_stage("fit", kFit),         cpu_stage("begin", kBegin),     cpu_stage("settle", kLook),
    gpu_stage("draw", kDraw),       gpu_stage("sample", kSample),   gpu_stage("split", kSplit),
    cpu_stage("collect", kCollect), cpu_stage("compare", kCompare), cpu_stage("fetch", kLook),
    cpu_stage("keep", kKeep),
};
constexpr heddle_shader kShaders[] = {
    surfaces_shader("depth", "draw", ""),
    compute_shader("sample", "sample", "sample.comp.glsl"),
    fullscreen_shader("split", "split", "split.frag.glsl"),
};

constexpr std::uint64_t kMostMapBytes = 256U << 20;  // of the depth maps of a slice
constexpr double kBorderTexels = 2;  // around the bounding sphere: elements on its rim have a texel (H11)
/// Of the scene's diameter: what float32 rounds in a few products and sums, a few times over.
constexpr double kRounding = 0x1p-20;

/// Directions before the first look at what they have changed; the next ones come when there are twice as many.
constexpr std::uint32_t kFirstCheck = 32;

/// What outlasts a process, before the parts' states, the sums, and where parts may settle the last visibilities.
struct Progress {
  std::uint64_t read_backs = 0, read_bytes = 0, tests = 0, pairs = 0;  // pairs: of an element and a direction
  std::uint32_t done = 0;                                              // directions
  std::uint32_t next_check = kFirstCheck;
  std::uint32_t checks = 0, maps = 0;
};

class DepthMaps {
 public:
  heddle_status declare(const PassHost& host) {
    pipeline_ = host.choice("pipeline");
    const auto side = static_cast<std::uint32_t>(host.integer("resolution"));
    const std::uint64_t most = std::max<std::uint64_t>(kMostMapBytes / (4ULL * side * side), 1);
    const std::int32_t wanted = pipeline_ == kFloatSums   ? host.integer("batch")
                                : pipeline_ == kSplitRamp ? host.integer("passes")
                                                          : 1;
    batch_ = static_cast<std::uint32_t>(std::min<std::uint64_t>(static_cast<std::uint64_t>(wanted), most));
    if (const heddle_status status = make_elements(host, set_); status != HEDDLE_OK) return status;
    const std::uint64_t count = std::max<std::uint64_t>(set_.elements.size(), 1);
    heddle_shape maps{};
    maps.format = host.choice("depth_format") == kD16 ? VK_FORMAT_D16_UNORM : VK_FORMAT_D32_SFLOAT;
    maps.width = maps.height = side;
    maps.layers = batch_;
    heddle_shape elements{};
    elements.byte_size = 16ULL * BAKE_VECTORS_PER_ELEMENT * count;
    heddle_shape sums{};
    sums.byte_size = 16ULL * BAKE_VECTORS_PER_SUM * (pipeline_ == kFloatSums ? count : 1);
    heddle_shape directions{};
    directions.byte_size = 16ULL * BAKE_VECTORS_PER_DIRECTION * static_cast<std::uint64_t>(host.integer("directions"));
    heddle_shape target{};
    target.width = target.height = 1;
    if (is_split()) {
      target.width = BAKE_TARGET_WIDTH;
      target.height = static_cast<std::uint32_t>((count + BAKE_TARGET_WIDTH - 1) / BAKE_TARGET_WIDTH);
    }
    for (const auto& [name, shape] :
         {std::pair("depth_maps", maps), std::pair("elements", elements), std::pair("sums", sums),
          std::pair("directions", directions), std::pair("target", target)})
      if (const heddle_status status = host.set_shape(name, shape); status != HEDDLE_OK) return status;
    return HEDDLE_OK;
  }

  std::uint32_t activity(const Frame& frame) const {
    const bool is_due = [&] {
      switch (frame.stage()) {
        case kBeginStage:
        case kSampleStage:
        case kFetchStage:
          return pipeline_ == kFloatSums;
        case kSettleStage:
          return pipeline_ == kFloatSums && is_check_due();
        case kSplitStage:
        case kCollectStage:
          return is_split();
        case kCompareStage:
          return pipeline_ == kCpuCompare;
        default:
          return true;
      }
    }();
    const bool is_always = frame.stage() == kFitStage || frame.stage() == kKeepStage;
    return is_due && (is_always || !ranges_.empty()) ? HEDDLE_RUN : HEDDLE_NOTHING;
  }

  heddle_status record(const Frame& frame) {
    switch (frame.stage()) {
      case kDrawStage:
        return draw(frame);
      case kSampleStage:
        return sample(frame);
      default:
        return split(frame);
    }
  }

  heddle_status execute(const Frame& frame) {
    switch (frame.stage()) {
      case kFitStage:
        return fit(frame);
      case kBeginStage:
        return begin(frame);
      case kCollectStage:
        return collect(frame);
      case kCompareStage:
        return compare(frame);
      case kSettleStage:
        return settle(frame);
      case kFetchStage:
        return fetch(frame);
      default:
        return keep(frame);
    }
  }

  heddle_status save_state(const Frame& frame) const {
    for (const heddle_status status :
         {frame.keep_state(std::span(&progress_, 1)), frame.keep_state(std::span<const PartState>(parts_.states)),
          frame.keep_state(std::span<const Sums>(sums_)), frame.keep_state(std::span<const float>(before_))})
      if (status != HEDDLE_OK) return status;
    return HEDDLE_OK;
  }
  heddle_status load_state(const Frame&, std::span<const std::byte> state) {
    std::vector<PartState> states(parts_.states.size());
    const auto bytes_of = [](auto& items) { return std::as_writable_bytes(std::span(items)); };
    std::span<Progress> progress(&progress_, 1);
    const std::array<std::span<std::byte>, 4> all{bytes_of(progress), bytes_of(states), bytes_of(sums_),
                                                  bytes_of(before_)};
    std::size_t size = 0;
    for (const auto& one : all) size += one.size();
    if (state.size() != size) return HEDDLE_UNSUPPORTED;
    std::memcpy(states.data(), state.data() + sizeof progress_, states.size());
    if (!parts_.began_as(states)) return HEDDLE_UNSUPPORTED;
    for (const auto& one : all) {
      if (!one.empty()) std::memcpy(one.data(), state.data(), one.size());
      state = state.subspan(one.size());
    }
    parts_.states = std::move(states);
    ranges_ = parts_.ranges(set_);
    return HEDDLE_OK;
  }

 private:
  [[nodiscard]] bool is_split() const { return pipeline_ == kSplitRamp || pipeline_ == kGpuCompare; }
  [[nodiscard]] std::uint32_t direction_count() const {
    return std::min(batch_, static_cast<std::uint32_t>(views_.size()) - progress_.done);
  }

  [[nodiscard]] BakePush push(const Frame& frame, std::uint32_t first, std::uint32_t count) const {
    const PassHost host = frame.host();
    const std::uint32_t format = host.choice("depth_format");
    // README equation (4): depth is 1 over the length of a view.
    const double texel = 2.0 * half_size_ / host.integer("resolution");
    const double steps = format == kD16 ? 65535 : format == kD8 ? 255 : format == kD24 ? 16777215 : 0;
    BakePush push{};
    push.element_count = static_cast<std::uint32_t>(set_.elements.size());
    push.first_direction = first;
    push.direction_count = count;
    push.bias_slope = static_cast<float>(host.parameter("bias") * texel / length_);
    push.bias_constant = static_cast<float>(kRounding + (steps > 0 ? 1 / steps : 0.0));
    push.bias_limit = static_cast<float>(host.parameter("bias_limit"));
    push.depth_steps = format == kD8 || format == kD24 ? static_cast<float>(steps) : 0.0F;
    return push;
  }

  /// README equation (2): one view a direction, all of one size, around the scene's bounding sphere.
  heddle_status fit(const Frame& frame) {
    const PassHost host = frame.host();
    const double side = host.integer("resolution");
    half_size_ = set_.radius * side / std::max(side - 2 * kBorderTexels, 1.0);
    length_ = 2 * half_size_;
    const auto wanted = static_cast<std::uint32_t>(host.integer("directions"));
    const std::vector<glm::dvec3> all = baked_visibility::directions(
        wanted, static_cast<DirectionSet>(host.choice("set")), static_cast<std::uint32_t>(host.integer("seed")));
    views_.clear();
    rows_.clear();
    for (const glm::dvec3& s : all) {
      // Relative to the sphere's centre: the instances that the host places there serve all views.
      HeddleView view =
          depth_maps::orthographic_view(depth_maps::axes_along(-s), glm::dvec3(0.0), glm::dvec2(half_size_), length_, 0,
                                        static_cast<std::uint32_t>(side))
              .draw;
      // The near plane is half a length in front of the centre: depth is 1/2 there.
      glm::dmat4 shift(1.0);
      shift[3][2] = -0.5;
      const auto move = [&](float(&matrix)[16]) {
        glm::dmat4 m(glm::make_mat4(matrix));
        m = shift * m;
        for (int i = 0; i < 16; ++i) matrix[i] = static_cast<float>(m[i / 4][i % 4]);
      };
      move(view.clip_from_rel);
      move(view.previous_clip_from_rel);
      const glm::dmat4 inverse = glm::inverse(glm::dmat4(glm::make_mat4(view.clip_from_rel)));
      for (int i = 0; i < 16; ++i) view.rel_from_clip[i] = static_cast<float>(inverse[i / 4][i % 4]);
      views_.push_back(view);
      // The numbers that the map is drawn with (H18), not others of the same matrix.
      for (const int r : {0, 1, 2}) {
        glm::vec4 row;
        for (int c = 0; c < 4; ++c) row[c] = view.clip_from_rel[4 * c + r];
        rows_.push_back(row);
      }
      rows_.emplace_back(glm::vec3(s), 0.0F);
    }
    heddle_mapped out;
    if (const heddle_status status = frame.map("elements", out); status != HEDDLE_OK) return status;
    elements_.assign(std::max<std::size_t>(set_.elements.size(), 1) * BAKE_VECTORS_PER_ELEMENT, glm::vec4(0.0F));
    for (std::size_t e = 0; e < set_.elements.size(); ++e) {
      elements_[BAKE_VECTORS_PER_ELEMENT * e] = glm::vec4(set_.elements[e].position, 1.0F);
      elements_[BAKE_VECTORS_PER_ELEMENT * e + 1] = glm::vec4(set_.elements[e].normal, 0.0F);
      elements_[BAKE_VECTORS_PER_ELEMENT * e + 2] = glm::vec4(set_.elements[e].facing, 0.0F);
    }
    std::memcpy(out.data, elements_.data(), elements_.size() * sizeof(glm::vec4));
    progress_ = {};
    before_.assign(host.parameter("settled") > 0 ? set_.elements.size() : 0, 0.0F);
    PartRules rules;
    // Within a texel of its centre a surface below a tangent plane comes to lie in front of it, and no farther (the
    // middle of a texel is 1 / sqrt(2) from its corners).
    rules.margin = 2 * half_size_ / side + 4 * kRounding * length_;
    rules.finds_open = host.toggle("find_open");
    rules.asked.push_back(batch_);
    for (const char* name : {"directions", "resolution", "bias", "bias_limit", "depth_format", "casters", "pipeline",
                             "set", "seed", "settled"})
      rules.asked.push_back(host.parameter(name));
    if (const heddle_status status = parts_.begin(frame, set_, rules, sums_); status != HEDDLE_OK) return status;
    ranges_ = parts_.ranges(set_);
    return frame.set_value<glm::vec4>("directions", rows_);
  }

  /// Nothing is summed yet.
  static heddle_status begin(const Frame& frame) {
    heddle_mapped out;
    if (const heddle_status status = frame.map("sums", out); status != HEDDLE_OK) return status;
    std::memset(out.data, 0, out.shape.byte_size);
    return HEDDLE_OK;
  }

  heddle_status draw(const Frame& frame) const {
    const auto views = Views::of(frame);
    if (!views) return HEDDLE_UNSUPPORTED;
    const std::uint32_t first = progress_.done, count = direction_count();
    for (std::uint32_t i = 0; i < count; ++i) {
      heddle_draw drawing = Frame::drawing("depth");
      drawing.view = &views_[first + i];
      drawing.include = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_MASKED;
      drawing.layer = i;
      drawing.cull = frame.host().choice("casters") == 1 ? HEDDLE_CULL_MATERIAL : HEDDLE_CULL_DEFAULT;
      heddle_placed_draw placed{sizeof placed, 1, &drawing, {set_.origin.x, set_.origin.y, set_.origin.z}};
      if (const heddle_status status = views->draw(placed); status != HEDDLE_OK) return status;
    }
    heddle::pass::count(frame.host(), "depth_maps", count);
    return HEDDLE_OK;
  }

  /// After a slice.
  void count_directions() {
    const std::uint32_t count = direction_count();
    for (const auto& [first, end] : ranges_) progress_.pairs += std::uint64_t{end - first} * count;
    progress_.done += count;
    progress_.maps += count;
  }
  [[nodiscard]] bool is_done() const { return progress_.done == views_.size() || ranges_.empty(); }
  [[nodiscard]] bool is_check_due() const {
    return !before_.empty() && progress_.done >= progress_.next_check && !is_done();
  }

  /// Parts that about half of their directions have changed by less than `settled` are asked no more.
  void check(const Frame& frame) {
    const auto most = static_cast<float>(frame.host().parameter("settled"));
    for (std::size_t p = 0; p < set_.parts.size(); ++p) {
      if (parts_.states[p] != PartState::kAsked) continue;
      float change = 0;
      for (std::uint32_t i = 0; i < set_.parts[p].count; ++i) {
        const std::uint32_t e = set_.parts[p].first + i;
        const double visibility = sums_[e].weight > 0 ? sums_[e].open / sums_[e].weight : 1.0;
        change = std::max(change, std::abs(static_cast<float>(visibility) - before_[e]));
        before_[e] = static_cast<float>(visibility);
      }
      if (progress_.checks > 0 && change < most) parts_.states[p] = PartState::kSettled;
    }
    ++progress_.checks;
    while (progress_.next_check <= progress_.done) progress_.next_check *= 2;
    ranges_ = parts_.ranges(set_);
  }

  /// The next slice begins with `stage`; none if that was the last.
  heddle_status go_on(const Frame& frame, const char* stage = "draw") const {
    const double share =
        ranges_.empty() ? 1.0 : static_cast<double>(progress_.done) / static_cast<double>(views_.size());
    if (const heddle_status status = frame.progress(share); status != HEDDLE_OK) return status;
    if (is_done()) return HEDDLE_OK;
    const auto* slices = frame.host().service<heddle_slices_service>(HEDDLE_SLICES_SERVICE);
    if (slices == nullptr)
      return frame.host().fail(HEDDLE_UNSUPPORTED, "this host has no service " HEDDLE_SLICES_SERVICE);
    const heddle_status status = slices->begin_with(frame.host().raw(), frame.raw(), stage);
    return status == HEDDLE_OK ? HEDDLE_MORE : status;
  }

  heddle_status sample(const Frame& frame) {
    for (const auto& [first, end] : ranges_) {
      BakePush one = push(frame, progress_.done, direction_count());
      one.first_element = first;
      one.element_count = end;
      const std::uint32_t groups = (end - first + BAKE_GROUP_SIZE - 1) / BAKE_GROUP_SIZE;
      if (first != ranges_.front()[0]) frame.barrier();
      if (const heddle_status status = frame.dispatch("sample", groups, 1, 1, one); status != HEDDLE_OK) return status;
    }
    count_directions();
    return go_on(frame, is_check_due() ? "settle" : "draw");
  }

  heddle_status split(const Frame& frame) const {
    for (std::uint32_t i = 0; i < direction_count(); ++i) {
      BakePush one = push(frame, progress_.done + i, 1);
      one.layer = i;
      if (const heddle_status status = frame.fullscreen("split", 0, one); status != HEDDLE_OK) return status;
    }
    return HEDDLE_OK;
  }

  heddle_status map_and_count(const Frame& frame, const char* name, heddle_mapped& out) {
    const heddle_status status = frame.map(name, out);
    ++progress_.read_backs;
    progress_.read_bytes += out.row_bytes * out.shape.height * std::max(out.shape.layers, 1U);
    return status;
  }

  heddle_status collect(const Frame& frame) {
    heddle_mapped target;
    if (const heddle_status status = map_and_count(frame, "target", target); status != HEDDLE_OK) return status;
    const auto* texels = static_cast<const std::uint8_t*>(target.data);
    for (const auto& [first, end] : ranges_)
      collect_split({texels + std::size_t{4} * first, std::size_t{4} * (end - first)},
                    std::span(sums_).subspan(first, end - first));
    return add_up(frame);
  }

  heddle_status compare(const Frame& frame) {
    heddle_mapped maps;
    if (const heddle_status status = map_and_count(frame, "depth_maps", maps); status != HEDDLE_OK) return status;
    const std::size_t direction = std::size_t{BAKE_VECTORS_PER_DIRECTION} * progress_.done;
    const DepthMap map{maps.data, maps.shape.format == VK_FORMAT_D16_UNORM, maps.shape.width};
    for (const auto& [first, end] : ranges_)
      progress_.tests += compare_depths(
          map, std::span(rows_).subspan(direction, BAKE_VECTORS_PER_DIRECTION), push(frame, progress_.done, 1),
          std::span(elements_).subspan(std::size_t{BAKE_VECTORS_PER_ELEMENT} * first,
                                       std::size_t{BAKE_VECTORS_PER_ELEMENT} * (end - first)),
          std::span(sums_).subspan(first, end - first));
    return add_up(frame);
  }

  /// After a slice of pipelines whose sums are here.
  heddle_status add_up(const Frame& frame) {
    count_directions();
    if (is_check_due()) check(frame);
    return go_on(frame);
  }

  /// float_sums: between two slices, the sums of all directions so far.
  heddle_status settle(const Frame& frame) {
    heddle_mapped out;
    if (const heddle_status status = read_sums(frame, out); status != HEDDLE_OK) return status;
    const std::vector<PartState> before = parts_.states;
    check(frame);
    for (std::size_t p = 0; p < set_.parts.size(); ++p)
      if (parts_.states[p] != before[p]) count_tests(out, set_.parts[p].first, set_.parts[p].count);
    return HEDDLE_OK;
  }

  heddle_status fetch(const Frame& frame) {
    heddle_mapped out;
    if (const heddle_status status = read_sums(frame, out); status != HEDDLE_OK) return status;
    for (const auto& [first, end] : ranges_) count_tests(out, first, end - first);
    return HEDDLE_OK;
  }

  heddle_status read_sums(const Frame& frame, heddle_mapped& out) {
    if (const heddle_status status = frame.map("sums", out); status != HEDDLE_OK) return status;
    ++progress_.read_backs;
    progress_.read_bytes += out.shape.byte_size;
    const auto* sums = static_cast<const glm::vec4*>(out.data);
    for (const auto& [first, end] : ranges_)
      for (std::uint32_t e = first; e < end; ++e) {
        const glm::dvec4 weights(sums[BAKE_VECTORS_PER_SUM * e]), bent(sums[BAKE_VECTORS_PER_SUM * e + 1]);
        sums_[e] = {weights.x, weights.y, {bent.x, bent.y, bent.z}};
      }
    return HEDDLE_OK;
  }
  void count_tests(const heddle_mapped& out, std::uint32_t first, std::uint32_t count) {
    const auto* sums = static_cast<const glm::vec4*>(out.data);
    for (std::uint32_t e = first; e < first + count; ++e)
      progress_.tests += static_cast<std::uint64_t>(sums[BAKE_VECTORS_PER_SUM * e].z);
  }

  /// README equation (1), and the artifact.
  heddle_status keep(const Frame& frame) {
    const PassHost host = frame.host();
    if (const heddle_status status = parts_.keep(frame, set_, sums_); status != HEDDLE_OK) return status;
    const Blind blind = set_values(set_, sums_, host.toggle("fill"), views_.size());
    for (const std::string& remark : set_.remarks)
      if (const heddle_status status = frame.add_row("report", HEDDLE_SEVERITY_WARNING, remark); status != HEDDLE_OK)
        return status;
    heddle_status status = frame.add_row(
        "report", HEDDLE_SEVERITY_INFO, "visibility is baked",
        {{"elements", static_cast<double>(set_.elements.size())},
         {"directions", static_cast<double>(views_.size())},
         {"spacing", set_.spacing},
         {"reached", set_.reached},
         {"texel", 2.0 * half_size_ / host.integer("resolution")},
         {"parts", static_cast<double>(set_.parts.size())},
         {"mapped", static_cast<double>(set_.mapped)},
         {"refined", static_cast<double>(set_.refined)},
         {"missed", static_cast<double>(set_.missed)},
         {"parts_known", parts_.count(PartState::kKnown)},
         {"parts_open", parts_.count(PartState::kOpen)},
         {"parts_settled", parts_.count(PartState::kSettled)},
         {"maps", static_cast<double>(progress_.maps)},
         {"pairs", static_cast<double>(progress_.pairs)},
         {"closed", static_cast<double>(blind.closed)},
         {"without_side", static_cast<double>(blind.without_side)},
         {"read_backs", static_cast<double>(progress_.read_backs)},
         {"read_bytes", static_cast<double>(progress_.read_bytes)},
         {"tests",
          pipeline_ == kSplitRamp || pipeline_ == kGpuCompare ? std::nan("") : static_cast<double>(progress_.tests)}});
    if (status != HEDDLE_OK) return status;
    return frame.set_value<std::byte>("occlusion", to_bytes(set_.baked));
  }

  std::uint32_t pipeline_ = kFloatSums, batch_ = 1;
  ElementSet set_;
  double half_size_ = 1, length_ = 2;  // metres, of all views
  std::vector<HeddleView> views_;
  std::vector<glm::vec4> rows_, elements_;  // as shaders see them
  std::vector<Sums> sums_;                  // of all elements; float_sums: as of the last look
  Parts parts_;
  std::vector<std::array<std::uint32_t, 2>> ranges_;  // of elements that are asked
  std::vector<float> before_;                         // visibility at the last check; empty: parts do not settle
  Progress progress_;
};

constexpr heddle_technique kDepthMaps = [] {
  heddle_technique t =
      technique<DepthMaps>("bake_visibility/depth_maps", "Occlusion of all surfaces by depth maps from all around",
                           "Hill 2004, Hardware Accelerating Art Production", kPorts, kParameters, kStages, kShaders);
  t.components = fine_instances::kComponent;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kDepthMaps)
