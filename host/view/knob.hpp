// SPDX-License-Identifier: Apache-2.0
// Where a parameter's value stands on its slider: along its ladder if it has one, else evenly or by factors over the
// part of its range that one would want.
#pragma once

#include "json.hpp"

#include <string>
#include <vector>

namespace heddle::view {

class Track {
 public:
  /// `parameter`: an entry of heddle_list's "parameters", of type float or int.
  explicit Track(const Json& parameter);

  /// 0 .. end(); values beyond the ends of the slider stand at the ends.
  [[nodiscard]] double position_of(double value) const;
  /// The value at a position; near a step of the ladder exactly that step.
  [[nodiscard]] double value_at(double position) const;
  /// 1; with a ladder the index of its last step.
  [[nodiscard]] double end() const { return ladder_.size() > 1 ? static_cast<double>(ladder_.size() - 1) : 1.0; }
  [[nodiscard]] const std::vector<double>& ladder() const { return ladder_; }
  [[nodiscard]] bool is_integer() const { return is_integer_; }

 private:
  [[nodiscard]] double between(double a, double b, double t) const;
  [[nodiscard]] double rounded(double value) const;

  std::vector<double> ladder_;  // ascending or descending, as it is written: from cheap to accurate
  double low_ = 0, high_ = 1;
  bool is_integer_ = false, is_logarithmic_ = false;
};

/// As --set takes it, with all digits: "0.1", "[0, 1, 0.5]", "\"linear\"" for TOML's strings, "true".
std::string setting_text(const Json& value);

}  // namespace heddle::view
