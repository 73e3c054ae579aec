// SPDX-License-Identifier: Apache-2.0
// mesh_detail/chosen: takes the fine instances out of the scene's surfaces, or those that they are the finer shape of.
#include "fine_instances.hpp"

#include <heddle/pass.hpp>

namespace {

using namespace heddle::pass;

constexpr heddle_port kPorts[] = {
    surfaces_out("surfaces", HEDDLE_INOUT, "vertices", "indices", "the scene's, without those that are not chosen"),
    buffer_out("vertices", 64, "HeddleVertex vertices[];", "none", HEDDLE_PORT_KEPT),
    buffer_out("indices", 64, "uint indices[];", "none", HEDDLE_PORT_KEPT),
};
constexpr const char* kShown[] = {"coarse", "fine", nullptr};
constexpr heddle_parameter kParameters[] = {
    choice("show", kShown, 0, "which of two instances is there: the coarse one, or those that are its finer shape"),
};
constexpr heddle_access kChoose[] = {host_write("vertices"), host_write("indices"), batches("surfaces")};
constexpr heddle_stage kStages[] = {cpu_stage("choose", kChoose)};

class Chosen {
 public:
  heddle_status declare(const PassHost& host) {
    is_told_ = false;
    return fine_instances::read(host, nullptr, fine_);
  }

  std::uint32_t activity(const Frame& frame) const {
    return is_told_ && shown_ == frame.host().choice("show") ? HEDDLE_KEEP : HEDDLE_RUN;
  }

  heddle_status execute(const Frame& frame) {
    shown_ = frame.host().choice("show");
    std::vector<std::uint32_t> gone;
    for (const auto& [coarse, fine] : fine_)
      if (shown_ == 1)
        gone.push_back(coarse);
      else
        gone.insert(gone.end(), fine.begin(), fine.end());
    heddle_batch batch{};
    batch.struct_size = sizeof batch;
    batch.placed = static_cast<std::uint32_t>(gone.size());
    batch.instances = gone.data();
    is_told_ = true;
    return frame.set_batches("surfaces", {&batch, gone.empty() ? 0U : 1U}, ++revision_);
  }

 private:
  std::map<std::uint32_t, std::vector<std::uint32_t>> fine_;  // by coarse one
  std::uint32_t shown_ = 0;
  bool is_told_ = false;
  std::uint64_t revision_ = 0;
};

constexpr heddle_technique kTechnique = [] {
  heddle_technique t =
      technique<Chosen>("mesh_detail/chosen", "Coarse or fine instances, whichever are asked for",
                        "Hill 2004, Hardware Accelerating Art Production", kPorts, kParameters, kStages);
  t.features = fine_instances::kComponent;
  t.components = fine_instances::kComponent;
  return t;
}();

}  // namespace

HEDDLE_PLUGIN(kTechnique)
