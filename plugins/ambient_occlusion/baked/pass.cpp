// SPDX-License-Identifier: Apache-2.0
// ambient_occlusion/baked: an artifact of role bake_visibility and the surfaces that the gbuffer shows -> visibility.
#include "baked_visibility.hpp"

#include <heddle/meshes.hpp>
#include <heddle/pass.hpp>

#include <glm/glm.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <algorithm>
#include <cstring>

namespace {

using namespace baked_visibility;
using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_in("surfaces", "what was baked"),
    value_in("camera", "the view that made depth_buffer"),
    image_in("depth_buffer", "reversed depth of the surfaces that the gbuffer shows"),
    artifact_in("occlusion", "of role bake_visibility"),
    buffer_out("baked_instances", 32, "uvec4 baked_instances[];", "two an instance", HEDDLE_PORT_KEPT),
    buffer_out("baked_triangles", 64, "uvec4 baked_triangles[];", "four a triangle of a mesh", HEDDLE_PORT_KEPT),
    buffer_out("baked_lattice", 4, "uint baked_lattice[];", "values of a triangle's lattice", HEDDLE_PORT_KEPT),
    buffer_out("baked_values", 8, "uvec2 baked_values[];", "visibility, open direction", HEDDLE_PORT_KEPT),
    value_out("places", 48, "three rows of object_from_rel, an instance", "vec4 places[];"),
    image_out("visibility", VK_FORMAT_R32_SFLOAT, "1 open, 0 closed; 1 where nothing was baked"),
};

constexpr heddle_access kUpload[] = {value("occlusion"), host_write("baked_instances"), host_write("baked_triangles"),
                                     host_write("baked_lattice"), host_write("baked_values")};
constexpr heddle_access kPlace[] = {value("places")};
constexpr heddle_access kLook[] = {
    drawn("surfaces"),
    value("camera"),
    value("places"),
    storage_read("baked_instances"),
    storage_read("baked_triangles"),
    storage_read("baked_lattice"),
    storage_read("baked_values"),
    color_cleared("visibility", {1, 1, 1, 1}),
    depth_tested("depth_buffer"),
};
enum : std::uint32_t { kUploadStage, kPlaceStage, kLookStage };
constexpr heddle_stage kStages[] = {cpu_stage("upload", kUpload), cpu_stage("place", kPlace), gpu_stage("look", kLook)};
constexpr heddle_shader kShaders[] = {[] {
  heddle_shader s = surfaces_shader("baked", "look", "baked.frag.glsl");
  s.depth_compare = VK_COMPARE_OP_EQUAL;  // the very surface that the gbuffer shows, and no other
  return s;
}()};

class BakedOcclusion {
 public:
  heddle_status declare(const PassHost& host) {
    const std::span<const std::byte> bytes_there = host.artifact<std::byte>("occlusion");
    // Whatever a job has made has a head at least.
    if (bytes_there.empty())
      return host.fail(HEDDLE_BAD_INPUT,
                       "input 'occlusion' is not there yet: the job that makes it has not run, as it runs for a scene; "
                       "name one");
    std::string problem;
    const std::optional<Baked> read = from_bytes(bytes_there, problem);
    if (!read)
      return host.fail(HEDDLE_BAD_INPUT, "input 'occlusion' is no baked visibility: " + problem +
                                             "; bind it to the output of a job's pass of role bake_visibility");
    baked_ = *read;
    is_uploaded_ = false;
    const auto bytes = [&](const char* port, std::size_t size) {
      heddle_shape shape{};
      shape.byte_size = std::max<std::size_t>(size, 64);
      return host.set_shape(port, shape);
    };
    const Meshes meshes(host);
    for (const heddle_status status :
         {bytes("baked_instances", std::span(baked_.instances).size_bytes()),
          bytes("baked_triangles", std::span(baked_.triangles).size_bytes()),
          bytes("baked_lattice", std::span(baked_.lattice).size_bytes()),
          bytes("baked_values", std::span(baked_.values).size_bytes()),
          bytes("places",
                std::size_t{48} * std::max<std::size_t>(meshes.content().instance_count, baked_.instances.size()))})
      if (status != HEDDLE_OK) return status;
    return HEDDLE_OK;
  }

  std::uint32_t activity(const Frame& frame) const {
    return frame.stage() == kUploadStage && is_uploaded_ ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  heddle_status execute(const Frame& frame) {
    if (frame.stage() == kPlaceStage) return place(frame);
    for (const heddle_status status : {put<BakedInstance>(frame, "baked_instances", baked_.instances),
                                       put<BakedTriangle>(frame, "baked_triangles", baked_.triangles),
                                       put<std::uint32_t>(frame, "baked_lattice", baked_.lattice),
                                       put<BakedValue>(frame, "baked_values", baked_.values)})
      if (status != HEDDLE_OK) return status;
    is_uploaded_ = true;
    return HEDDLE_OK;
  }

  heddle_status record(const Frame& frame) {
    heddle_draw drawing = Frame::drawing("baked");
    drawing.include = HEDDLE_SURFACE_OPAQUE | HEDDLE_SURFACE_MASKED;
    return frame.draw(drawing);
  }

 private:
  template <typename T>
  static heddle_status put(const Frame& frame, const char* port, std::span<const T> items) {
    heddle_mapped out;
    if (const heddle_status status = frame.map(port, out); status != HEDDLE_OK) return status;
    std::memset(out.data, 0, static_cast<std::size_t>(out.shape.byte_size));
    if (!items.empty()) std::memcpy(out.data, items.data(), items.size_bytes());
    return HEDDLE_OK;
  }

  /// README equation (1): where instances are now, seen from the camera, in float64.
  static heddle_status place(const Frame& frame) {
    const Meshes meshes(frame.host());
    const glm::dvec3 origin(frame.info().origin[0], frame.info().origin[1], frame.info().origin[2]);
    std::vector<glm::vec4> rows;
    rows.reserve(std::size_t{3} * meshes.content().instance_count);
    for (std::uint32_t i = 0; i < meshes.content().instance_count; ++i) {
      glm::dmat4 scene_from_object = glm::make_mat4(meshes.instance(i).scene_from_object);
      scene_from_object[3] -= glm::dvec4(origin, 0.0);
      const glm::dmat4 object_from_rel = glm::inverse(scene_from_object);
      for (int row = 0; row < 3; ++row)
        rows.emplace_back(object_from_rel[0][row], object_from_rel[1][row], object_from_rel[2][row],
                          object_from_rel[3][row]);
    }
    return frame.set_value<glm::vec4>("places", rows);
  }

  Baked baked_;
  bool is_uploaded_ = false;
};

constexpr heddle_technique kBaked = [] {
  heddle_technique t = technique<BakedOcclusion>(
      "ambient_occlusion/baked", "Ambient occlusion that a job has baked onto the scene's surfaces",
      "Hill 2004, Hardware Accelerating Art Production; Yuksel, Keyser and House 2010, Mesh Colors", 2);
  t.ports = list(kPorts, t.port_count);
  t.stages = list(kStages, t.stage_count);
  t.shaders = list(kShaders, t.shader_count);
  t.device_features = "geometryShader";
  t.fallback =
      "none: without it shaders do not know which triangle they shade; bake texels, or choose another technique";
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kBaked)
