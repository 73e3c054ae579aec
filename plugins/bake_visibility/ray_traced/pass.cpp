// SPDX-License-Identifier: Apache-2.0
// bake_visibility/ray_traced: a ray from every element in every direction, on the CPU. The reference of its role.
#include "bake_directions.hpp"
#include "bake_parameters.hpp"
#include "bake_parts.hpp"
#include "embree_triangles.hpp"

#include <heddle/parallel.hpp>
#include <heddle/pass.hpp>

#include <cstring>
#include <memory>

namespace {

using namespace baked_visibility;
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what occludes: opaque and masked batches"),
    port("occlusion", HEDDLE_PORT_ARTIFACT, HEDDLE_OUT, "visibility and mean open direction of every element"),
    port("report", HEDDLE_PORT_REPORT, HEDDLE_OUT, "how much was asked, and what could not be done as wished"),
};
constexpr const char* kSets[] = {"fibonacci", "random", nullptr};
constexpr double kDirectionLadder[] = {64, 256, 1024, 4096, 16384};
constexpr heddle_parameter kParameters[] = {
    knob(integer("directions", "1", 1, 1 << 20, 1024, "over the whole sphere, shared by all elements"),
         kDirectionLadder),
    elements_parameter(),
    spacing_parameter(),
    inset_parameter(),
    detail_parameter(),
    reach_parameter(),
    choice("set", kSets, 0, "of directions: even, or independent of each other"),
    integer("seed", "1", 0, 1'000'000, 0, "turns the even set, chooses the random one"),
    toggle("find_open", true, "parts that nothing rises above are open without a look"),
    toggle("fill", true, "elements that see nothing, because they lie in something, take the mean of open neighbours"),
};
constexpr heddle_access kTrace[] = {host_read("surfaces"), value("occlusion"), value("report")};
constexpr heddle_stage kStages[] = {cpu_stage("trace", kTrace)};

constexpr unsigned kPacket = 16;
constexpr std::size_t kRaysPerSlice = 1U << 21;

/// One Embree device and scene.
class Occluders {
 public:
  ~Occluders() {
    if (scene_ != nullptr) rtcReleaseScene(scene_);
    if (device_ != nullptr) rtcReleaseDevice(device_);
  }
  Occluders() = default;
  Occluders(const Occluders&) = delete;
  Occluders& operator=(const Occluders&) = delete;

  /// False: Embree cannot; why is in error().
  [[nodiscard]] bool build(const heddle_snapshot& snapshot, heddle_alpha_test alpha, const glm::dvec3& origin) {
    if (!embree::make_scene(device_, scene_, error_)) return false;
    snapshot_ = &snapshot;
    alpha_ = alpha;
    const glm::dvec3 shift = glm::dvec3(snapshot.origin[0], snapshot.origin[1], snapshot.origin[2]) - origin;
    std::vector<glm::vec3> positions;
    for (std::uint32_t v = 0; v < snapshot.vertex_count; ++v) {
      positions.emplace_back(glm::dvec3(glm::make_vec3(snapshot.positions + std::size_t{3} * v)) + shift);
      const double coordinate = embree::largest_coordinate(positions.back());
      if (std::isfinite(coordinate)) largest_ = std::max(largest_, coordinate);
    }
    std::vector<glm::uvec3> triangles;
    std::array<std::vector<std::uint32_t>, 2> chosen;  // opaque, masked: only their hits are judged
    for (std::uint32_t t = 0; t < snapshot.triangle_count; ++t) {
      triangles.push_back(glm::make_vec3(snapshot.indices + std::size_t{3} * t));
      if ((snapshot.flags[t] & HEDDLE_SURFACE_OPAQUE) != 0)
        chosen[0].push_back(t);
      else if ((snapshot.flags[t] & HEDDLE_SURFACE_MASKED) != 0)
        chosen[1].push_back(t);
    }
    RTCBuffer vertices = embree::copy_vertices(device_, positions);
    if (vertices == nullptr) return false;
    embree::attach_triangles(device_, scene_, 0, vertices, positions.size(), triangles, chosen[0], nullptr, nullptr);
    embree::attach_triangles(device_, scene_, 1, vertices, positions.size(), triangles, chosen[1],
                             alpha_ != nullptr ? &filter : nullptr, this);
    rtcReleaseBuffer(vertices);
    masked_ = std::move(chosen[1]);
    rtcCommitScene(scene_);
    return error_.text[0] == '\0';
  }
  [[nodiscard]] const char* error() const { return error_.text; }
  /// Metres that the rays of an element start in front of it: as far as float32 may be off.
  [[nodiscard]] double lift() const { return embree::kUncertainUlps * embree::kUlp * largest_; }

  /// Bit i: direction i is free.
  [[nodiscard]] std::uint32_t trace(const glm::vec3& from, std::span<const glm::vec3> directions) const {
    alignas(64) std::array<int, kPacket> valid{};
    RTCRay16 rays;
    for (unsigned i = 0; i < kPacket; ++i) {
      valid[i] = i < directions.size() ? -1 : 0;
      const glm::vec3 d = i < directions.size() ? directions[i] : glm::vec3(0, 0, 1);
      rays.org_x[i] = from.x;
      rays.org_y[i] = from.y;
      rays.org_z[i] = from.z;
      rays.dir_x[i] = d.x;
      rays.dir_y[i] = d.y;
      rays.dir_z[i] = d.z;
      rays.tnear[i] = 0;
      rays.tfar[i] = HUGE_VALF;
      rays.time[i] = 0;
      rays.mask[i] = ~0U;
      rays.id[i] = i;
      rays.flags[i] = 0;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded16(valid.data(), scene_, &context, &rays);
    std::uint32_t free = 0;
    for (unsigned i = 0; i < directions.size(); ++i)
      if (rays.tfar[i] >= 0) free |= 1U << i;
    return free;
  }

 private:
  /// Holes of alpha masks let rays through.
  static void filter(const RTCFilterFunctionNArguments* arguments) {
    const auto* self = static_cast<const Occluders*>(arguments->geometryUserPtr);
    for (unsigned i = 0; i < arguments->N; ++i) {
      if (arguments->valid[i] != -1) continue;
      const std::uint32_t triangle = self->masked_[RTCHitN_primID(arguments->hit, arguments->N, i)];
      if (self->alpha_(self->snapshot_, triangle, RTCHitN_u(arguments->hit, arguments->N, i),
                       RTCHitN_v(arguments->hit, arguments->N, i)) == 0)
        arguments->valid[i] = 0;
    }
  }

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  const heddle_snapshot* snapshot_ = nullptr;  // of the running call
  heddle_alpha_test alpha_ = nullptr;
  std::vector<std::uint32_t> masked_;  // Embree's triangles of geometry 1 -> the snapshot's
  double largest_ = 0;
  embree::ErrorText error_;
};

class RayTraced {
 public:
  heddle_status execute(const Frame& frame) {
    if (!occluders_ || frame.info().slice == 0)
      if (const heddle_status status = begin(frame); status != HEDDLE_OK) return status;
    const std::size_t per_slice = std::max<std::size_t>(kRaysPerSlice / directions_.size(), 1);
    const std::size_t first = per_slice * frame.info().slice;
    const std::size_t end = std::min(asked_.size(), first + per_slice);
    const heddle_status asked = for_each_index(frame.host(), end - first, [&](std::uint64_t i) {
      const std::uint32_t element = asked_[first + i];
      sums_[element] = ask(set_.elements[element]);
    });
    if (asked != HEDDLE_OK) return asked;
    const double done = asked_.empty() ? 1.0 : static_cast<double>(end) / static_cast<double>(asked_.size());
    if (const heddle_status status = frame.progress(done); status != HEDDLE_OK) return status;
    return end < asked_.size() ? HEDDLE_MORE : keep(frame);
  }
  heddle_status save_state(const Frame& frame) const {
    const heddle_status status = frame.keep_state(std::span<const PartState>(parts_.states));
    return status == HEDDLE_OK ? frame.keep_state(std::span<const Sums>(sums_)) : status;
  }
  heddle_status load_state(const Frame& frame, std::span<const std::byte> state) {
    if (const heddle_status status = begin(frame); status != HEDDLE_OK) return status;
    std::vector<PartState> states(parts_.states.size());
    if (state.size() != states.size() + sums_.size() * sizeof(Sums)) return HEDDLE_UNSUPPORTED;
    if (!states.empty()) std::memcpy(states.data(), state.data(), states.size());
    if (!parts_.began_as(states)) return HEDDLE_UNSUPPORTED;
    if (!sums_.empty()) std::memcpy(sums_.data(), state.data() + states.size(), sums_.size() * sizeof(Sums));
    return HEDDLE_OK;
  }

 private:
  heddle_status begin(const Frame& frame) {
    const PassHost host = frame.host();
    if (const heddle_status status = make_elements(host, set_); status != HEDDLE_OK) return status;
    directions_.clear();
    for (const glm::dvec3& s :
         directions(static_cast<std::uint32_t>(host.integer("directions")),
                    static_cast<DirectionSet>(host.choice("set")), static_cast<std::uint32_t>(host.integer("seed"))))
      directions_.emplace_back(s);
    const heddle_snapshot* snapshot = nullptr;
    heddle_alpha_test alpha = nullptr;
    if (const heddle_status status = frame.snapshot("surfaces", snapshot, alpha); status != HEDDLE_OK) return status;
    occluders_ = std::make_unique<Occluders>();
    if (!occluders_->build(*snapshot, alpha, set_.origin)) return host.fail(HEDDLE_FAILED, occluders_->error());
    PartRules rules;
    rules.margin = 4 * occluders_->lift();  // rays start in front of their elements, and float32 moves both
    rules.finds_open = host.toggle("find_open");
    for (const char* name : {"directions", "set", "seed"}) rules.asked.push_back(host.parameter(name));
    rules.asked.push_back(occluders_->lift());
    if (const heddle_status status = parts_.begin(frame, set_, rules, sums_); status != HEDDLE_OK) return status;
    asked_ = parts_.asked(set_);
    return HEDDLE_OK;
  }

  [[nodiscard]] Sums ask(const Element& element) const {
    Sums sums;
    const glm::vec3 from(glm::dvec3(element.position) + glm::dvec3(element.facing) * occluders_->lift());
    std::array<glm::vec3, kPacket> packet;
    std::array<double, kPacket> weights{};
    std::size_t count = 0;
    const auto trace = [&] {
      const std::uint32_t free = occluders_->trace(from, std::span(packet).first(count));
      for (std::size_t i = 0; i < count; ++i) {
        sums.weight += weights[i];
        if ((free >> i & 1U) == 0) continue;
        sums.open += weights[i];
        for (int c = 0; c < 3; ++c)
          sums.bent[static_cast<std::size_t>(c)] += weights[i] * static_cast<double>(packet[i][c]);
      }
      count = 0;
    };
    for (const glm::vec3& s : directions_) {
      const double h = glm::dot(glm::dvec3(element.normal), glm::dvec3(s));
      if (!(h > 0)) continue;
      if (!(glm::dot(glm::dvec3(element.facing), glm::dvec3(s)) > 0)) {
        sums.weight += h;
        continue;
      }
      weights[count] = h;
      packet[count++] = s;
      if (count == kPacket) trace();
    }
    if (count > 0) trace();
    return sums;
  }

  heddle_status keep(const Frame& frame) {
    if (const heddle_status status = parts_.keep(frame, set_, sums_); status != HEDDLE_OK) return status;
    const Blind blind = set_values(set_, sums_, frame.host().toggle("fill"), directions_.size());
    for (const std::string& remark : set_.remarks)
      if (const heddle_status status = frame.add_row("report", HEDDLE_SEVERITY_WARNING, remark); status != HEDDLE_OK)
        return status;
    const heddle_status status = frame.add_row("report", HEDDLE_SEVERITY_INFO, "visibility is baked",
                                               {{"elements", static_cast<double>(set_.elements.size())},
                                                {"directions", static_cast<double>(directions_.size())},
                                                {"spacing", set_.spacing},
                                                {"reached", set_.reached},
                                                {"parts", static_cast<double>(set_.parts.size())},
                                                {"mapped", static_cast<double>(set_.mapped)},
                                                {"refined", static_cast<double>(set_.refined)},
                                                {"missed", static_cast<double>(set_.missed)},
                                                {"parts_known", parts_.count(PartState::kKnown)},
                                                {"parts_open", parts_.count(PartState::kOpen)},
                                                {"pairs", static_cast<double>(asked_.size() * directions_.size())},
                                                {"closed", static_cast<double>(blind.closed)},
                                                {"without_side", static_cast<double>(blind.without_side)}});
    occluders_.reset();
    if (status != HEDDLE_OK) return status;
    return frame.set_value<std::byte>("occlusion", to_bytes(set_.baked));
  }

  ElementSet set_;
  Parts parts_;
  std::vector<std::uint32_t> asked_;  // elements
  std::vector<glm::vec3> directions_;
  std::vector<Sums> sums_;
  std::unique_ptr<Occluders> occluders_;
};

constexpr heddle_technique kRayTraced = [] {
  heddle_technique t = technique<RayTraced>(
      "bake_visibility/ray_traced", "Occlusion of all surfaces by rays, on the CPU",
      "Zhukov, Iones and Kronin 1998, An Ambient Light Illumination Model; Wald et al. 2014, Embree", kPorts,
      kParameters, kStages);
  t.flags = HEDDLE_TECHNIQUE_REFERENCE;
  t.components = fine_instances::kComponent;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kRayTraced)
