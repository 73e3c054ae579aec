// SPDX-License-Identifier: Apache-2.0
// subdivision/catmull_clark: cages of the scene -> surfaces in the GPU's buffers, refined uniformly by tables of
// weights.
#include "subdivision_cages.hpp"

namespace {

using namespace heddle::pass;
using heddle::catmull_clark::Refined;
using heddle::catmull_clark::Weights;
using heddle::subdivision::Corner;
using heddle::subdivision::Object;

constexpr heddle_port kPorts[] = {
    surfaces_out("surfaces", HEDDLE_INOUT, "vertices", "indices", "subdivided instances in the place of their meshes"),
    buffer_out("vertices", 0, "HeddleVertex vertices[];", "of the refined surfaces", HEDDLE_PORT_KEPT),
    buffer_out("indices", 0, "uint indices[];", "their triangles", HEDDLE_PORT_KEPT),
    buffer_out("corners", 0, "uvec4 corners[];", "what vertices carry besides their places", HEDDLE_PORT_KEPT),
    buffer_out("rows", 0, "uvec2 rows[];", "which influences each vertex has", HEDDLE_PORT_KEPT),
    buffer_out("influences", 0, "uvec4 influences[];", "points of cages, and their weights", HEDDLE_PORT_KEPT),
    buffer_out("points", 0, "vec4 points[];", "of the cages, as they are bent", HEDDLE_PORT_KEPT),
};
constexpr double kLevels[] = {1, 2, 3, 4, 5};
constexpr heddle_parameter kParameters[] = {
    knob(integer("levels", "1", 1, 6, 2, "how often every face is split in four, where the component does not say",
                 HEDDLE_PARAMETER_REDECLARE),
         kLevels),
    toggle("limit", true, "vertices lie on the limit surface, not where refinement has brought them so far",
           HEDDLE_PARAMETER_REDECLARE),
};
enum Stage : std::uint32_t { kTables, kPose, kRefine };
constexpr heddle_access kTablesAccess[] = {host_write("indices"), host_write("corners"), host_write("rows"),
                                           host_write("influences")};
constexpr heddle_access kPoseAccess[] = {host_write("points")};
constexpr heddle_access kRefineAccess[] = {storage_read("corners"),    storage_read("rows"),
                                           storage_read("influences"), storage_read("points"),
                                           storage_write("vertices"),  batches("surfaces")};
constexpr heddle_stage kStages[] = {cpu_stage("tables", kTablesAccess), cpu_stage("pose", kPoseAccess),
                                    gpu_stage("refine", kRefineAccess)};
constexpr heddle_shader kShaders[] = {compute_shader("refine", "refine", "refine.comp.glsl")};

struct Influence {
  std::uint32_t point = 0;
  float weight = 0, t1 = 0, t2 = 0;
};
static_assert(sizeof(Influence) == 16);
struct Row {
  std::uint32_t first = 0, count = 0;
};

/// Weights rounded once, their sum made 1 again at the largest: a cage that is moved moves its surface as far.
void round_weights(std::span<Influence> influences) {
  double sum = 0;
  Influence* largest = nullptr;
  for (Influence& one : influences) {
    sum += static_cast<double>(one.weight);
    if (largest == nullptr || one.weight > largest->weight) largest = &one;
  }
  if (largest != nullptr) largest->weight = static_cast<float>(static_cast<double>(largest->weight) + (1.0 - sum));
}

/// One list of influences for each row: its vertex's weights and two tangents. All points with a weight in any of them
/// are there, so rows of one vertex add the same terms for its place, and zeros.
void append_rows(const Refined& refined, bool at_limit, std::vector<Row>& rows, std::vector<Influence>& influences) {
  const Weights& places = at_limit ? refined.limits : refined.positions;
  for (std::size_t row = 0; row < refined.vertices.size(); ++row) {
    const std::size_t first = influences.size();
    const std::size_t vertex = refined.vertices[row];
    std::array<std::size_t, 3> at{};
    const std::array<const Weights*, 3> lists{&places, &refined.t1, &refined.t2};
    const std::array<std::size_t, 3> of{vertex, row, row};
    // Lengths of tangents mean nothing: the largest weight is 1.
    std::array<double, 3> scale{1, 0, 0};
    for (std::size_t k = 1; k < 3; ++k) {
      for (const double value : lists[k]->values_of(of[k])) scale[k] = std::max(scale[k], std::abs(value));
      scale[k] = scale[k] > 0 ? 1 / scale[k] : 0;
    }
    while (true) {
      std::uint32_t point = heddle::catmull_clark::kNone;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto points = lists[k]->points_of(of[k]);
        if (at[k] < points.size()) point = std::min(point, points[at[k]]);
      }
      if (point == heddle::catmull_clark::kNone) break;
      std::array<float, 3> weights{};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto points = lists[k]->points_of(of[k]);
        if (at[k] >= points.size() || points[at[k]] != point) continue;
        weights[k] = static_cast<float>(lists[k]->values_of(of[k])[at[k]++] * scale[k]);
      }
      influences.push_back({point, weights[0], weights[1], weights[2]});
    }
    round_weights(std::span(influences).subspan(first));
    rows.push_back({static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(influences.size() - first)});
  }
}

class CatmullClark {
 public:
  heddle_status declare(const PassHost& host) {
    std::vector<std::shared_ptr<Object>> found;
    const heddle_status status = heddle::subdivision::find_objects(host, host.integer("levels"), found);
    if (status != HEDDLE_OK) return status;
    places_.clear();
    rows_.clear();
    influences_.clear();
    Place next;
    for (std::shared_ptr<Object>& object : found) {
      const heddle_scene_mesh mesh = Meshes(host).mesh(object->mesh);
      Place place = next;
      place.object = std::move(object);
      place.first_row = static_cast<std::uint32_t>(rows_.size());
      append_rows(place.object->refined, host.toggle("limit"), rows_, influences_);
      place.bends = mesh.shape != 0;
      const std::uint32_t copies = place.bends ? 2 : 1;
      next.first_corner += place.corner_count();
      next.first_vertex += place.corner_count() * copies;
      next.first_index += static_cast<std::uint32_t>(place.object->indices.size());
      next.first_point += place.point_count() * copies;
      places_.push_back(std::move(place));
      places_.back().object->refined = {};  // what of it is needed is in the tables
    }
    points_ = next.first_point;
    tables_are_due_ = true;
    return set_sizes(host, next);
  }

  std::uint32_t activity(const Frame& frame) {
    if (frame.stage() == kTables) return tables_are_due_ ? HEDDLE_RUN : HEDDLE_KEEP;
    if (frame.stage() == kPose) {
      const Meshes meshes(frame.host());
      is_posed_ = false;
      for (Place& place : places_) {
        const heddle_scene_mesh mesh = meshes.mesh(place.object->mesh);
        place.has_bent = mesh.shape != mesh.previous_shape;
        place.is_due = place.is_new || mesh.shape != place.shape ||
                       (place.has_bent && mesh.previous_shape != place.previous_shape) ||
                       place.has_bent != place.had_bent;
        place.shape = mesh.shape;
        place.previous_shape = mesh.previous_shape;
        place.had_bent = place.has_bent;
        is_posed_ = is_posed_ || place.is_due;
      }
      return is_posed_ ? HEDDLE_RUN : HEDDLE_KEEP;
    }
    return is_posed_ || batches_are_due_ ? HEDDLE_RUN : HEDDLE_KEEP;
  }

  heddle_status execute(const Frame& frame) {
    return frame.stage() == kTables ? write_tables(frame) : write_points(frame);
  }

  heddle_status record(const Frame& frame) {
    const Meshes meshes(frame.host());
    const bool are_all_due =
        std::none_of(places_.begin(), places_.end(), [](const Place& place) { return place.is_due; });
    std::vector<heddle_batch> all;
    bool is_first = true;
    for (Place& place : places_) {
      const std::uint32_t steps = place.has_bent ? place.corner_count() : 0;
      if (place.is_due || are_all_due) {
        const Push push{place.first_corner,
                        place.corner_count(),
                        place.first_row,
                        place.first_point,
                        place.first_vertex,
                        place.has_bent ? place.point_count() : 0,
                        steps};
        if (!is_first) frame.barrier();  // the same buffer, if at other places: nobody has to know that
        is_first = false;
        const heddle_status status = frame.dispatch("refine", (push.count + 63) / 64, 1, 1, push);
        if (status != HEDDLE_OK) return status;
      }
      place.is_due = place.is_new = false;
      all.push_back(heddle::subdivision::batch_of(*place.object, meshes.mesh(place.object->mesh), place.first_vertex,
                                                  place.first_index, steps));
    }
    batches_are_due_ = false;
    return frame.set_batches("surfaces", all, ++revision_);
  }

 private:
  struct Push {
    std::uint32_t first_corner, count, first_row, first_point, first_vertex, previous_point, previous_vertex;
  };
  /// Where an object lies in the buffers, and what of its mesh is there.
  struct Place {
    std::shared_ptr<Object> object;
    std::uint32_t first_row = 0, first_corner = 0, first_vertex = 0, first_index = 0, first_point = 0;
    bool bends = false;
    bool is_new = true, is_due = true, has_bent = false, had_bent = false;
    std::uint64_t shape = 0, previous_shape = 0;
    [[nodiscard]] std::uint32_t corner_count() const { return static_cast<std::uint32_t>(object->corners.size()); }
    [[nodiscard]] std::uint32_t point_count() const { return static_cast<std::uint32_t>(object->sources.size()); }
  };

  heddle_status set_sizes(const PassHost& host, const Place& end) {
    const std::pair<const char*, std::uint64_t> sizes[] = {
        {"vertices", std::uint64_t{end.first_vertex} * sizeof(HeddleVertex)},
        {"indices", std::uint64_t{end.first_index} * sizeof(std::uint32_t)},
        {"corners", std::uint64_t{end.first_corner} * sizeof(Corner)},
        {"rows", rows_.size() * sizeof(Row)},
        {"influences", influences_.size() * sizeof(Influence)},
        {"points", std::uint64_t{end.first_point} * 4 * sizeof(float)}};
    for (const auto& [port, bytes] : sizes) {
      // What every device lets a shader see of a buffer.
      constexpr std::uint64_t kMost = 1ULL << 27U;
      if (bytes > kMost) {
        return host.fail(HEDDLE_UNSUPPORTED, "the subdivided surfaces need " + std::to_string(bytes) + " bytes of '" +
                                                 port + "': expected at most " + std::to_string(kMost) +
                                                 "; choose fewer levels");
      }
      heddle_shape shape{};
      shape.byte_size = std::max<std::uint64_t>(bytes, 64);
      if (const heddle_status status = host.set_shape(port, shape); status != HEDDLE_OK) return status;
    }
    return HEDDLE_OK;
  }

  template <typename Element>
  static heddle_status copy_to(const Frame& frame, const char* port, std::span<const Element> elements) {
    heddle_mapped mapped{};
    const heddle_status status = frame.map(port, mapped);
    if (status != HEDDLE_OK) return status;
    if (!elements.empty()) std::memcpy(mapped.data, elements.data(), elements.size_bytes());
    return HEDDLE_OK;
  }

  heddle_status write_tables(const Frame& frame) {
    std::vector<std::uint32_t> indices;
    std::vector<Corner> corners;
    for (const Place& place : places_) {
      indices.insert(indices.end(), place.object->indices.begin(), place.object->indices.end());
      corners.insert(corners.end(), place.object->corners.begin(), place.object->corners.end());
    }
    heddle_status status = copy_to<std::uint32_t>(frame, "indices", indices);
    if (status == HEDDLE_OK) status = copy_to<Corner>(frame, "corners", corners);
    if (status == HEDDLE_OK) status = copy_to<Row>(frame, "rows", rows_);
    if (status == HEDDLE_OK) status = copy_to<Influence>(frame, "influences", influences_);
    tables_are_due_ = false;
    batches_are_due_ = true;
    return status;
  }

  heddle_status write_points(const Frame& frame) {
    const Meshes meshes(frame.host());
    std::vector<float> points(std::size_t{points_} * 4, 0.0F);
    for (const Place& place : places_) {
      const heddle_scene_mesh mesh = meshes.mesh(place.object->mesh);
      std::size_t at = std::size_t{place.first_point} * 4;
      for (const HeddleVertex* vertices : {mesh.vertices, mesh.previous_vertices}) {
        for (const std::uint32_t source : place.object->sources) {
          std::copy_n(vertices[source].position, 3, points.begin() + static_cast<std::ptrdiff_t>(at));
          at += 4;
        }
        if (!place.bends) break;
      }
    }
    return copy_to<float>(frame, "points", points);
  }

  std::vector<Place> places_;
  std::vector<Row> rows_;
  std::vector<Influence> influences_;
  std::uint32_t points_ = 0;
  std::uint64_t revision_ = 0;
  bool tables_are_due_ = true, batches_are_due_ = true, is_posed_ = false;
};

constexpr heddle_technique kTechnique = [] {
  heddle_technique t = technique<CatmullClark>(
      "subdivision/catmull_clark", "Uniform Catmull-Clark refinement by factorised tables on the GPU",
      "Brainerd 2016, \"Catmull-Clark Subdivision Surfaces\", GPU Pro 7", kPorts, kParameters, kStages, kShaders);
  t.features = "subdivision.surface";
  t.components = "subdivision.surface";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kTechnique)
