// SPDX-License-Identifier: Apache-2.0
// subdivision/vertex_program: cages of the scene -> surfaces whose vertices are computed where they are drawn.
#include "subdivision_tables.hpp"

namespace {

using namespace heddle::pass;
using heddle::subdivision::kParameters;
using heddle::subdivision::Place;
using heddle::subdivision::Tables;

constexpr heddle_port kPorts[] = {
    surfaces_out("surfaces", HEDDLE_INOUT, nullptr, "indices", "subdivided instances in the place of their meshes"),
    buffer_out("indices", 0, "uint indices[];", "triangles of the refined surfaces", HEDDLE_PORT_KEPT),
    buffer_out("corners", 0, "uvec4 corners[];", "what vertices carry besides their places", HEDDLE_PORT_KEPT),
    buffer_out("rows", 0, "uvec4 rows[];", "which influences each vertex has", HEDDLE_PORT_KEPT),
    buffer_out("influences", 0, "uvec4 influences[];", "points of cages, and their weights", HEDDLE_PORT_KEPT),
    buffer_out("points", 0, "vec4 points[];", "of the cages, as they are bent", HEDDLE_PORT_KEPT),
};
constexpr heddle_access kTablesAccess[] = {host_write("indices"), host_write("corners"), host_write("rows"),
                                           host_write("influences")};
constexpr heddle_access kPoseAccess[] = {host_write("points")};
constexpr heddle_access kBatchesAccess[] = {batches("surfaces")};
constexpr heddle_access kProgramAccess[] = {storage_read("corners"), storage_read("rows"), storage_read("influences"),
                                            storage_read("points")};
constexpr heddle_stage kStages[] = {cpu_stage("tables", kTablesAccess), cpu_stage("pose", kPoseAccess),
                                    cpu_stage("batches", kBatchesAccess)};
constexpr heddle_function kFunctions[] = {function("surface_program", "surface_vertex.glsl", kProgramAccess)};

class VertexProgram {
 public:
  heddle_status declare(const PassHost& host) { return tables_.declare(host, false); }

  std::uint32_t activity(const Frame& frame) { return tables_.activity(frame); }
  heddle_status execute(const Frame& frame) {
    return frame.stage() == Tables::kBatches ? set_batches(frame) : tables_.write(frame);
  }

 private:
  heddle_status set_batches(const Frame& frame) {
    const Meshes meshes(frame.host());
    std::vector<heddle_batch> all;
    for (Place& place : tables_.places) {
      place.is_due = place.is_new = false;
      all.push_back(heddle::subdivision::batch_of(*place.object, meshes.mesh(place.object->mesh), place.first_corner,
                                                  place.first_index, 0));
      all.back().vertex_count = place.corner_count();
    }
    tables_.batches_are_due = false;
    return frame.set_batches("surfaces", all, ++revision_);
  }

  Tables tables_;
  std::uint64_t revision_ = 0;
};

constexpr heddle_technique kTechnique = [] {
  heddle_technique t = technique<VertexProgram>(
      "subdivision/vertex_program", "Uniform Catmull-Clark refinement, each vertex computed where it is drawn",
      "Brainerd 2016, \"Catmull-Clark Subdivision Surfaces\", GPU Pro 7", kPorts, kParameters, kStages, kFunctions);
  t.features = "subdivision.surface";
  t.components = "subdivision.surface";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kTechnique)
