// SPDX-License-Identifier: Apache-2.0
// heddle/meshes.h for authors in C++: beside pass.hpp.
#pragma once

#include <heddle/meshes.h>
#include <heddle/pass.hpp>

namespace heddle::pass {

/// The scene's meshes and instances; valid until the running call returns. Empty on a host without the service.
class Meshes {
 public:
  explicit Meshes(const PassHost& host)
      : host_(host), service_(host.service<heddle_meshes_service>(HEDDLE_MESHES_SERVICE)) {
    content_.struct_size = sizeof content_;
    if (service_ != nullptr) service_->content(host_.raw(), &content_);
  }
  [[nodiscard]] const heddle_scene_content& content() const { return content_; }
  [[nodiscard]] heddle_scene_mesh mesh(std::uint32_t index) const {
    heddle_scene_mesh out{};
    out.struct_size = sizeof out;
    if (service_ != nullptr) service_->mesh(host_.raw(), index, &out);
    return out;
  }
  [[nodiscard]] heddle_scene_instance instance(std::uint32_t index) const {
    heddle_scene_instance out{};
    out.struct_size = sizeof out;
    if (service_ != nullptr) service_->instance(host_.raw(), index, &out);
    return out;
  }

 private:
  PassHost host_;
  const heddle_meshes_service* service_;
  heddle_scene_content content_{};
};

}  // namespace heddle::pass
