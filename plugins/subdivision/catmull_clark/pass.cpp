// SPDX-License-Identifier: Apache-2.0
// subdivision/catmull_clark: cages of the scene -> surfaces in the GPU's buffers, refined uniformly by tables of
// weights.
#include "subdivision_tables.hpp"

namespace {

using namespace heddle::pass;
using heddle::subdivision::kParameters;
using heddle::subdivision::Place;
using heddle::subdivision::Tables;

constexpr heddle_port kPorts[] = {
    surfaces_out("surfaces", HEDDLE_INOUT, "vertices", "indices", "subdivided instances in the place of their meshes"),
    buffer_out("vertices", 0, "HeddleVertex vertices[];", "of the refined surfaces", HEDDLE_PORT_KEPT),
    buffer_out("indices", 0, "uint indices[];", "their triangles", HEDDLE_PORT_KEPT),
    buffer_out("corners", 0, "uvec4 corners[];", "what vertices carry besides their places", HEDDLE_PORT_KEPT),
    buffer_out("rows", 0, "uvec4 rows[];", "which influences each vertex has", HEDDLE_PORT_KEPT),
    buffer_out("influences", 0, "uvec4 influences[];", "points of cages, and their weights", HEDDLE_PORT_KEPT),
    buffer_out("points", 0, "vec4 points[];", "of the cages, as they are bent", HEDDLE_PORT_KEPT),
};
constexpr heddle_access kTablesAccess[] = {host_write("indices"), host_write("corners"), host_write("rows"),
                                           host_write("influences")};
constexpr heddle_access kPoseAccess[] = {host_write("points")};
constexpr heddle_access kRefineAccess[] = {storage_read("corners"),    storage_read("rows"),
                                           storage_read("influences"), storage_read("points"),
                                           storage_write("vertices"),  batches("surfaces")};
constexpr heddle_stage kStages[] = {cpu_stage("tables", kTablesAccess), cpu_stage("pose", kPoseAccess),
                                    gpu_stage("refine", kRefineAccess)};
constexpr heddle_shader kShaders[] = {compute_shader("refine", "refine", "refine.comp.glsl")};

class CatmullClark {
 public:
  heddle_status declare(const PassHost& host) { return tables_.declare(host, true); }

  std::uint32_t activity(const Frame& frame) { return tables_.activity(frame); }
  heddle_status execute(const Frame& frame) { return tables_.write(frame); }

  heddle_status record(const Frame& frame) {
    const Meshes meshes(frame.host());
    const bool are_all_due =
        std::none_of(tables_.places.begin(), tables_.places.end(), [](const Place& place) { return place.is_due; });
    std::vector<heddle_batch> all;
    bool is_first = true;
    for (Place& place : tables_.places) {
      const std::uint32_t steps = place.has_bent ? place.corner_count() : 0;
      if (place.is_due || are_all_due) {
        const Push push{place.first_corner, place.corner_count(), place.first_vertex, steps};
        if (!is_first) frame.barrier();  // the same buffer, if at other places: nobody has to know that
        is_first = false;
        const heddle_status status = frame.dispatch("refine", (push.count + 63) / 64, 1, 1, push);
        if (status != HEDDLE_OK) return status;
      }
      place.is_due = place.is_new = false;
      all.push_back(heddle::subdivision::batch_of(*place.object, meshes.mesh(place.object->mesh), place.first_vertex,
                                                  place.first_index, steps));
    }
    tables_.batches_are_due = false;
    return frame.set_batches("surfaces", all, ++revision_);
  }

 private:
  struct Push {
    std::uint32_t first_corner, count, first_vertex, previous_vertex;
  };

  Tables tables_;
  std::uint64_t revision_ = 0;
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
