// SPDX-License-Identifier: Apache-2.0
// heddle/views.h and heddle/counters.h for authors in C++: beside pass.hpp.
#pragma once

#include <heddle/counters.h>
#include <heddle/views.h>
#include <heddle/pass.hpp>

#include <array>
#include <optional>

namespace heddle::pass {

/// What a drawing would show (heddle_views_service.look).
using Look = std::array<std::uint64_t, 2>;

/// The host's service of placed drawings; for one call of activity, record or execute.
class Views {
 public:
  /// Nothing, and an error told, where the host has no such service.
  static std::optional<Views> of(const Frame& frame) {
    const auto* service = frame.host().service<heddle_views_service>(HEDDLE_VIEWS_SERVICE);
    if (service == nullptr) {
      frame.host().raw()->report(frame.host().raw(), HEDDLE_SEVERITY_ERROR,
                                 "this host has no service " HEDDLE_VIEWS_SERVICE);
      return std::nullopt;
    }
    return Views(frame, *service);
  }
  [[nodiscard]] heddle_status draw(const heddle_placed_draw& placed) const {
    return service_->draw(frame_.host().raw(), frame_.raw(), &placed);
  }
  [[nodiscard]] heddle_status look(const heddle_placed_draw& placed, Look& out) const {
    return service_->look(frame_.host().raw(), frame_.raw(), &placed, out.data());
  }
  /// Nothing for lights that are none of the scene's.
  [[nodiscard]] std::optional<std::array<double, 3>> light_position(std::uint32_t id) const {
    std::array<double, 3> position{};
    if (service_->light_position(frame_.host().raw(), frame_.raw(), id, position.data()) != HEDDLE_OK)
      return std::nullopt;
    return position;
  }

 private:
  Views(const Frame& frame, const heddle_views_service& service) : frame_(frame), service_(&service) {}
  Frame frame_;
  const heddle_views_service* service_;
};

/// Adds to a number of this frame that heddle_stats tells; does nothing where the host does not count.
inline void count(const PassHost& host, const char* name, std::uint64_t count) {
  const auto* service = host.service<heddle_counters_service>(HEDDLE_COUNTERS_SERVICE);
  if (service != nullptr) service->add(host.raw(), name, count);
}

}  // namespace heddle::pass
