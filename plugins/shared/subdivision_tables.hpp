// SPDX-License-Identifier: Apache-2.0
// Refined cages -> the tables that shaders evaluate vertices from: corners, rows, influences and points in a
// technique's buffers of these names, with a pass's care for what has changed.
#pragma once

#include "subdivision_cages.hpp"

namespace heddle::subdivision {

struct Influence {
  std::uint32_t point = 0;
  float weight = 0, t1 = 0, t2 = 0;
};
static_assert(sizeof(Influence) == 16);
/// As shaders see it, uvec4: influences of a row, and how many points on those of the last frame lie, 0 where the same
/// do.
struct Row {
  std::uint32_t first = 0, count = 0, steps_to_previous = 0, reserved = 0;
};

/// Weights rounded once, their sum made 1 again at the largest: a cage that is moved moves its surface as far.
inline void round_weights(std::span<Influence> influences) {
  double sum = 0;
  Influence* largest = nullptr;
  for (Influence& one : influences) {
    sum += static_cast<double>(one.weight);
    if (largest == nullptr || one.weight > largest->weight) largest = &one;
  }
  if (largest != nullptr) largest->weight = static_cast<float>(static_cast<double>(largest->weight) + (1.0 - sum));
}

/// One list of influences for each row: its vertex's weights and two tangents. All points with a weight in any of them
/// are there, so rows of one vertex add the same terms for its place, and zeros. Points count from `first_point`.
inline void append_rows(const catmull_clark::Refined& refined, bool at_limit, std::uint32_t first_point,
                        std::uint32_t steps_to_previous, std::vector<Row>& rows, std::vector<Influence>& influences) {
  using catmull_clark::Weights;
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
      std::uint32_t point = catmull_clark::kNone;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto points = lists[k]->points_of(of[k]);
        if (at[k] < points.size()) point = std::min(point, points[at[k]]);
      }
      if (point == catmull_clark::kNone) break;
      std::array<float, 3> weights{};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto points = lists[k]->points_of(of[k]);
        if (at[k] >= points.size() || points[at[k]] != point) continue;
        weights[k] = static_cast<float>(lists[k]->values_of(of[k])[at[k]++] * scale[k]);
      }
      influences.push_back({first_point + point, weights[0], weights[1], weights[2]});
    }
    round_weights(std::span(influences).subspan(first));
    rows.push_back({static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(influences.size() - first),
                    steps_to_previous, 0});
  }
}

/// Where an object lies in the buffers, and what of its mesh is there.
struct Place {
  std::shared_ptr<Object> object;
  std::uint32_t first_corner = 0, first_vertex = 0, first_index = 0, first_point = 0;
  bool bends = false;
  bool is_new = true, is_due = true, has_bent = false, had_bent = false;
  std::uint64_t shape = 0, previous_shape = 0;
  [[nodiscard]] std::uint32_t corner_count() const { return static_cast<std::uint32_t>(object->corners.size()); }
  [[nodiscard]] std::uint32_t point_count() const { return static_cast<std::uint32_t>(object->sources.size()); }
};

/// The tables of all objects of a pass. Its technique has out buffers corners, rows, influences, points and indices.
class Tables {
 public:
  std::vector<Place> places;
  bool are_due = true;  // the buffers do not hold them yet

  /// In declare: finds the objects and says how large the buffers are; `keeps_vertices`: also that of `vertices`.
  heddle_status declare(const pass::PassHost& host, bool keeps_vertices) {
    std::vector<std::shared_ptr<Object>> found;
    const heddle_status status = find_objects(host, {host.integer("levels"), 1, host.integer("levels_at_most")}, found);
    if (status != HEDDLE_OK) return status;
    places.clear();
    rows_.clear();
    influences_.clear();
    Place next;
    for (std::shared_ptr<Object>& object : found) {
      const heddle_scene_mesh mesh = pass::Meshes(host).mesh(object->mesh);
      Place place = next;
      place.object = std::move(object);
      place.bends = mesh.shape != 0;
      append_rows(place.object->refined, host.toggle("limit"), place.first_point, place.bends ? place.point_count() : 0,
                  rows_, influences_);
      const std::uint32_t first_row = static_cast<std::uint32_t>(rows_.size() - place.object->refined.vertices.size());
      for (Corner& corner : place.object->corners) corner.row += first_row;
      const std::uint32_t copies = place.bends ? 2 : 1;
      next.first_corner += place.corner_count();
      next.first_vertex += place.corner_count() * copies;
      next.first_index += static_cast<std::uint32_t>(place.object->indices.size());
      next.first_point += place.point_count() * copies;
      places.push_back(std::move(place));
      places.back().object->refined = {};  // what of it is needed is in the tables
    }
    points_ = next.first_point;
    are_due = true;
    return set_sizes(host, next, keeps_vertices);
  }

  /// Whether points have to be written: sees what has bent since the last frame.
  bool find_posed(const pass::PassHost& host) {
    const pass::Meshes meshes(host);
    bool is_posed = false;
    for (Place& place : places) {
      const heddle_scene_mesh mesh = meshes.mesh(place.object->mesh);
      place.has_bent = mesh.shape != mesh.previous_shape;
      place.is_due = place.is_new || mesh.shape != place.shape ||
                     (place.has_bent && mesh.previous_shape != place.previous_shape) ||
                     place.has_bent != place.had_bent;
      place.shape = mesh.shape;
      place.previous_shape = mesh.previous_shape;
      place.had_bent = place.has_bent;
      is_posed = is_posed || place.is_due;
    }
    return is_posed;
  }

  /// Stages of such a technique, in this order: cpu stages that write the tables and the points, and one, of either
  /// kind, that calls set_batches where it finds them due.
  enum Stage : std::uint32_t { kTables, kPose, kBatches };

  std::uint32_t activity(const pass::Frame& frame) {
    if (frame.stage() == kTables) return are_due ? HEDDLE_RUN : HEDDLE_KEEP;
    if (frame.stage() == kPose) {
      is_posed_ = find_posed(frame.host());
      return is_posed_ ? HEDDLE_RUN : HEDDLE_KEEP;
    }
    return is_posed_ || batches_are_due ? HEDDLE_RUN : HEDDLE_KEEP;
  }
  heddle_status write(const pass::Frame& frame) {
    return frame.stage() == kTables ? write_tables(frame) : write_points(frame);
  }

  bool batches_are_due = true;  // until whoever sets them says otherwise

 private:
  heddle_status write_tables(const pass::Frame& frame) {
    std::vector<std::uint32_t> indices;
    std::vector<Corner> corners;
    for (const Place& place : places) {
      indices.insert(indices.end(), place.object->indices.begin(), place.object->indices.end());
      corners.insert(corners.end(), place.object->corners.begin(), place.object->corners.end());
    }
    heddle_status status = copy_to<std::uint32_t>(frame, "indices", indices);
    if (status == HEDDLE_OK) status = copy_to<Corner>(frame, "corners", corners);
    if (status == HEDDLE_OK) status = copy_to<Row>(frame, "rows", rows_);
    if (status == HEDDLE_OK) status = copy_to<Influence>(frame, "influences", influences_);
    are_due = false;
    batches_are_due = true;
    return status;
  }

  /// Positions of the cages; behind those of cages that bend, where they were in the last frame.
  heddle_status write_points(const pass::Frame& frame) {
    const pass::Meshes meshes(frame.host());
    std::vector<float> points(std::size_t{points_} * 4, 0.0F);
    for (const Place& place : places) {
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

  heddle_status set_sizes(const pass::PassHost& host, const Place& end, bool keeps_vertices) const {
    const std::pair<const char*, std::uint64_t> sizes[] = {
        {"vertices", keeps_vertices ? std::uint64_t{end.first_vertex} * sizeof(HeddleVertex) : 0},
        {"indices", std::uint64_t{end.first_index} * sizeof(std::uint32_t)},
        {"corners", std::uint64_t{end.first_corner} * sizeof(Corner)},
        {"rows", rows_.size() * sizeof(Row)},
        {"influences", influences_.size() * sizeof(Influence)},
        {"points", std::uint64_t{end.first_point} * 4 * sizeof(float)}};
    for (const auto& [port, bytes] : std::span(sizes).subspan(keeps_vertices ? 0 : 1)) {
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
  static heddle_status copy_to(const pass::Frame& frame, const char* port, std::span<const Element> elements) {
    heddle_mapped mapped{};
    const heddle_status status = frame.map(port, mapped);
    if (status != HEDDLE_OK) return status;
    if (!elements.empty()) std::memcpy(mapped.data, elements.data(), elements.size_bytes());
    return HEDDLE_OK;
  }

  std::vector<Row> rows_;
  std::vector<Influence> influences_;
  std::uint32_t points_ = 0;
  bool is_posed_ = false;
};

/// Parameters of techniques with such tables.
inline constexpr double kLevels[] = {1, 2, 3, 4, 5};
inline constexpr heddle_parameter kParameters[] = {
    pass::knob(
        pass::integer("levels", "1", 1, 6, 2, "how often every face is split in four, where the component does not say",
                      HEDDLE_PARAMETER_REDECLARE),
        kLevels),
    pass::knob(
        pass::integer("levels_at_most", "1", 1, 6, 6,
                      "no face is split more often, whatever `levels` and components say", HEDDLE_PARAMETER_REDECLARE),
        kLevels),
    pass::toggle("limit", true, "vertices lie on the limit surface, not where refinement has brought them so far",
                 HEDDLE_PARAMETER_REDECLARE),
};

}  // namespace heddle::subdivision
