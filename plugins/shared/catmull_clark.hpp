// SPDX-License-Identifier: Apache-2.0
// A cage of polygons -> uniformly refined quads whose every vertex is a weighted sum of the cage's points, and for each
// the weights of its place on the limit surface and of two tangents there. Knows no positions: what moves needs no
// second look at the topology. float64; indices in what follows name the equations of the READMEs of
// plugins/subdivision.
//
// Sources  Catmull and Clark 1978, "Recursively Generated B-Spline Surfaces on Arbitrary Topological Meshes"
//          DeRose, Kass and Truong 1998, "Subdivision Surfaces in Character Animation": sharpness, and its fractions
//          Halstead, Kass and DeRose 1993, "Efficient, Fair Interpolation Using Catmull-Clark Surfaces": limit weights
//          Biermann, Levin and Zorin 2000, "Piecewise Smooth Subdivision Surfaces with Normal Control": borders
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace heddle::catmull_clark {

using Index = std::uint32_t;
inline constexpr Index kNone = 0xffffffffU;
/// Sharp for ever, as the edges of a border are.
inline constexpr double kInfinite = 10.0;

/// Faces in any number of corners, counter-clockwise; edges and points that stay sharp.
struct Cage {
  Index point_count = 0;
  std::vector<Index> face_sizes, corners;
  std::vector<std::pair<std::array<Index, 2>, double>> sharp_edges;
  std::vector<std::pair<Index, double>> sharp_points;
  bool pins_corners = true;  // a border point of a single face does not move
};

/// Weights over the cage's points, by rising index. Rows follow each other in one list.
struct Weights {
  std::vector<std::size_t> first{0};
  std::vector<Index> points;
  std::vector<double> values;
  [[nodiscard]] std::size_t count() const { return first.size() - 1; }
  [[nodiscard]] std::span<const Index> points_of(std::size_t row) const {
    return std::span(points).subspan(first[row], first[row + 1] - first[row]);
  }
  [[nodiscard]] std::span<const double> values_of(std::size_t row) const {
    return std::span(values).subspan(first[row], first[row + 1] - first[row]);
  }
};

/// Sums rows into new ones.
class Mixer {
 public:
  explicit Mixer(std::size_t point_count) : sums_(point_count, 0.0), is_in_(point_count, 0) {}
  void add(const Weights& from, std::size_t row, double scale) {
    const auto points = from.points_of(row);
    const auto values = from.values_of(row);
    for (std::size_t i = 0; i < points.size(); ++i) add(points[i], scale * values[i]);
  }
  void add(Index point, double value) {
    if (is_in_[point] == 0) {
      is_in_[point] = 1;
      in_.push_back(point);
    }
    sums_[point] += value;
  }
  /// The sum so far becomes a row; it begins again at nothing.
  void finish(Weights& to) {
    std::sort(in_.begin(), in_.end());
    for (const Index point : in_) {
      to.points.push_back(point);
      to.values.push_back(sums_[point]);
      sums_[point] = 0;
      is_in_[point] = 0;
    }
    to.first.push_back(to.points.size());
    in_.clear();
  }

 private:
  std::vector<double> sums_;
  std::vector<std::uint8_t> is_in_;
  std::vector<Index> in_;
};

// ---- topology -------------------------------------------------------------------------------------------------------

inline bool is_sharp(double sharpness) {
  return sharpness > 0;
}
/// Of the next level.
inline double decayed(double sharpness) {
  return sharpness >= kInfinite ? kInfinite : std::max(sharpness - 1.0, 0.0);
}

struct Edge {
  std::array<Index, 2> points{};
  std::array<Index, 2> faces{kNone, kNone};
  double sharpness = 0;  // borders: kInfinite
  [[nodiscard]] bool is_border() const { return faces[1] == kNone; }
};

/// The neighbourhood of a point, counter-clockwise: edge i, then face i between edges i and i + 1. Of a border point
/// the first and the last edge are the border's, and there is an edge more than faces.
struct Fan {
  bool is_closed = true;
  std::vector<Index> edges, faces;
  std::vector<Index> spokes;   // the point at the other end of each edge
  std::vector<Index> corners;  // of each face: which of its corners the point is
};

class Topology {
 public:
  /// Throws std::invalid_argument with the reason where the faces are no oriented manifold.
  explicit Topology(Index point_count, std::vector<Index> face_sizes, std::vector<Index> all_corners)
      : sizes_(std::move(face_sizes)), corners_(std::move(all_corners)) {
    firsts_.push_back(0);
    for (const Index size : sizes_) firsts_.push_back(firsts_.back() + size);
    if (firsts_.back() != corners_.size()) throw std::invalid_argument("the faces' sizes do not add up to its corners");
    find_edges();
    find_fans(point_count);
  }
  [[nodiscard]] Index face_count() const { return static_cast<Index>(sizes_.size()); }
  [[nodiscard]] Index size(Index face) const { return sizes_[face]; }
  [[nodiscard]] Index first(Index face) const { return firsts_[face]; }  // of its corners
  [[nodiscard]] Index corner(Index face, Index i) const { return corners_[firsts_[face] + i]; }
  /// From corner i to the next one.
  [[nodiscard]] Index edge_of(Index face, Index i) const { return edge_of_[firsts_[face] + i]; }
  [[nodiscard]] Index next(Index face, Index i) const { return i + 1 == sizes_[face] ? 0 : i + 1; }
  [[nodiscard]] Index previous(Index face, Index i) const { return i == 0 ? sizes_[face] - 1 : i - 1; }
  [[nodiscard]] Index corner_count() const { return firsts_.back(); }
  std::vector<Edge> edges;
  [[nodiscard]] Fan fan(Index point) const;

 private:
  void find_edges();
  void find_fans(Index point_count);

  std::vector<Index> sizes_, corners_, firsts_, edge_of_;
  std::vector<Index> first_face_, first_corner_;  // of each point: where its fan begins
  std::vector<std::uint8_t> is_closed_;
};

inline void Topology::find_edges() {
  struct Half {
    Index low, high, face, corner;
    bool is_turned;
  };
  std::vector<Half> halves;
  halves.reserve(corners_.size());
  for (Index f = 0; f < face_count(); ++f) {
    if (sizes_[f] < 3) throw std::invalid_argument("face " + std::to_string(f) + " has fewer than three corners");
    for (Index i = 0; i < sizes_[f]; ++i) {
      const Index from = corner(f, i), to = corner(f, next(f, i));
      if (from == to) throw std::invalid_argument("face " + std::to_string(f) + " has a corner twice");
      halves.push_back({std::min(from, to), std::max(from, to), f, i, from > to});
    }
  }
  std::sort(halves.begin(), halves.end(), [](const Half& a, const Half& b) {
    return std::pair(std::pair(a.low, a.high), std::pair(a.face, a.corner)) <
           std::pair(std::pair(b.low, b.high), std::pair(b.face, b.corner));
  });
  edge_of_.resize(corners_.size());
  for (std::size_t i = 0; i < halves.size();) {
    const Half& half = halves[i];
    std::size_t end = i + 1;
    while (end < halves.size() && halves[end].low == half.low && halves[end].high == half.high) ++end;
    const auto where = [&] {
      return "between points " + std::to_string(half.low) + " and " + std::to_string(half.high);
    };
    if (end - i > 2) throw std::invalid_argument("an edge of " + std::to_string(end - i) + " faces " + where());
    if (end - i == 2 && halves[i + 1].is_turned == half.is_turned)
      throw std::invalid_argument("two faces turned against each other, or one twice, share the edge " + where());
    Edge edge;
    edge.points = {half.low, half.high};
    for (std::size_t k = i; k < end; ++k) {
      edge.faces[k - i] = halves[k].face;
      edge_of_[firsts_[halves[k].face] + halves[k].corner] = static_cast<Index>(edges.size());
    }
    edge.sharpness = edge.is_border() ? kInfinite : 0;
    edges.push_back(edge);
    i = end;
  }
}

inline void Topology::find_fans(Index point_count) {
  first_face_.assign(point_count, kNone);
  first_corner_.assign(point_count, 0);
  is_closed_.assign(point_count, 1);
  std::vector<Index> count(point_count, 0);
  for (Index f = 0; f < face_count(); ++f) {
    for (Index i = 0; i < sizes_[f]; ++i) {
      const Index point = corner(f, i);
      ++count[point];
      // A border fan begins at the face whose edge away from the point has no face on its other side.
      const bool begins = edges[edge_of(f, i)].is_border();
      if (first_face_[point] != kNone && !begins) continue;
      if (begins && is_closed_[point] == 0) {
        throw std::invalid_argument("faces meet at point " + std::to_string(point) + " alone, in more than one fan");
      }
      first_face_[point] = f;
      first_corner_[point] = i;
      if (begins) is_closed_[point] = 0;
    }
  }
  for (Index point = 0; point < point_count; ++point) {
    if (first_face_[point] == kNone) continue;  // of no face: nothing depends on it
    if (fan(point).faces.size() != count[point]) {
      throw std::invalid_argument("faces meet at point " + std::to_string(point) + " alone, in more than one fan");
    }
  }
}

inline Fan Topology::fan(Index point) const {
  Fan fan;
  fan.is_closed = is_closed_[point] != 0;
  Index f = first_face_[point], i = first_corner_[point];
  if (f == kNone) return fan;
  while (true) {
    fan.edges.push_back(edge_of(f, i));
    fan.spokes.push_back(corner(f, next(f, i)));
    fan.faces.push_back(f);
    fan.corners.push_back(i);
    const Index back = previous(f, i);
    const Edge& edge = edges[edge_of(f, back)];
    if (edge.is_border()) {
      fan.edges.push_back(edge_of(f, back));
      fan.spokes.push_back(corner(f, back));
      return fan;
    }
    f = edge.faces[0] == f ? edge.faces[1] : edge.faces[0];
    if (f == first_face_[point] && edge_of(f, first_corner_[point]) == edge_of_[firsts_[fan.faces.back()] + back])
      return fan;
    if (fan.faces.size() > corners_.size()) throw std::invalid_argument("a fan without end");
    const Index shared = edge_of(fan.faces.back(), back);
    i = 0;
    while (i < sizes_[f] && edge_of(f, i) != shared) ++i;
    // The edge leaves the point in the next face, whose corner of it is the point.
    if (corner(f, i) != point) throw std::invalid_argument("two faces share an edge twice");
  }
}

// ---- rules ----------------------------------------------------------------------------------------------------------

/// Weights of a point's child: of itself, the points at the ends of its edges, and the new points of its faces.
struct PointRule {
  double self = 0;
  std::vector<double> spokes, faces;
};

namespace detail {

inline PointRule smooth_rule(std::size_t edges, std::size_t faces) {
  const auto n = static_cast<double>(edges);
  PointRule rule{(n - 2) / n, std::vector<double>(edges, 1 / (n * n)), std::vector<double>(faces, 1 / (n * n))};
  return rule;
}

/// The rule for these sharpnesses; one sharp edge changes nothing, two are a curve, more a corner.
inline PointRule rule_for(std::size_t faces, std::span<const double> sharpness, double own) {
  std::vector<std::size_t> sharp;
  for (std::size_t i = 0; i < sharpness.size(); ++i)
    if (is_sharp(sharpness[i])) sharp.push_back(i);
  if (!is_sharp(own) && sharp.size() < 2) return smooth_rule(sharpness.size(), faces);
  PointRule rule{1, std::vector<double>(sharpness.size(), 0), std::vector<double>(faces, 0)};
  if (is_sharp(own) || sharp.size() > 2) return rule;
  rule.self = 0.75;
  for (const std::size_t i : sharp) rule.spokes[i] = 0.125;
  return rule;
}

}  // namespace detail

/// Equations (3) to (5). Where a sharpness ends within this level, the rules before and after are mixed.
inline PointRule point_rule(std::size_t faces, std::span<const double> sharpness, double own) {
  PointRule rule = detail::rule_for(faces, sharpness, own);
  std::vector<double> after;
  double sum = is_sharp(own) && !is_sharp(decayed(own)) ? own : 0;
  std::size_t ending = sum > 0 ? 1 : 0;
  std::size_t sharp = 0;
  for (const double s : sharpness) {
    after.push_back(decayed(s));
    sharp += is_sharp(s) ? 1 : 0;
    if (!is_sharp(s) || is_sharp(after.back())) continue;
    sum += s;
    ++ending;
  }
  if (ending == 0 || (!is_sharp(own) && sharp < 2)) return rule;
  const double share = std::min(sum / static_cast<double>(ending), 1.0);
  const PointRule next = detail::rule_for(faces, after, decayed(own));
  rule.self = share * rule.self + (1 - share) * next.self;
  for (std::size_t i = 0; i < rule.spokes.size(); ++i)
    rule.spokes[i] = share * rule.spokes[i] + (1 - share) * next.spokes[i];
  for (std::size_t i = 0; i < rule.faces.size(); ++i)
    rule.faces[i] = share * rule.faces[i] + (1 - share) * next.faces[i];
  return rule;
}

/// Of an edge's child (2): each end, and each new face point beside it.
struct EdgeRule {
  double end = 0.5, face = 0;
};
inline EdgeRule edge_rule(double sharpness) {
  const double share = std::min(sharpness, 1.0);
  return {0.5 * share + 0.25 * (1 - share), 0.25 * (1 - share)};
}

// ---- limits ---------------------------------------------------------------------------------------------------------

/// Linear forms over a fan of quads: weights of the point, its spokes, and the corners across its faces.
struct RingForm {
  double self = 0;
  std::vector<double> spokes, across;
};

/// A part of a fan between two edges that are sharp for ever; all of it where there are none. Each has its own
/// tangents.
struct Sector {
  std::size_t first_face = 0, faces = 0;
  RingForm t1, t2;  // t1 x t2 points outwards
};

/// What becomes of a point whose faces are quads.
struct Limit {
  RingForm position;
  std::vector<Sector> sectors;
};

namespace detail {

/// A ring as rows of weights over itself, refined level by level: what is far from closed forms is found by doing it.
class Ring {
 public:
  Ring(std::size_t faces, std::vector<double> sharpness, double own)
      : faces_(faces), sharpness_(std::move(sharpness)), own_(own) {
    const std::size_t size = 1 + sharpness_.size() + faces_;
    rows_.assign(size, std::vector<double>(size, 0));
    for (std::size_t i = 0; i < size; ++i) rows_[i][i] = 1;
  }
  [[nodiscard]] bool is_settled() const {
    const auto lasts = [](double s) { return s <= 0 || s >= kInfinite; };
    return lasts(own_) && std::all_of(sharpness_.begin(), sharpness_.end(), lasts);
  }
  [[nodiscard]] std::span<const double> sharpness() const { return sharpness_; }
  [[nodiscard]] double own() const { return own_; }
  [[nodiscard]] const std::vector<std::vector<double>>& rows() const { return rows_; }
  [[nodiscard]] std::size_t spoke(std::size_t i) const { return 1 + i; }
  [[nodiscard]] std::size_t across(std::size_t i) const { return 1 + sharpness_.size() + i; }

  void refine() {
    const std::size_t edges = sharpness_.size(), size = rows_.size();
    std::vector<std::vector<double>> made(size, std::vector<double>(size, 0)), face(faces_);
    const auto add = [&](std::vector<double>& to, const std::vector<double>& from, double scale) {
      for (std::size_t k = 0; k < size; ++k) to[k] += scale * from[k];
    };
    const auto next_edge = [&](std::size_t i) { return i + 1 == edges ? 0 : i + 1; };
    for (std::size_t i = 0; i < faces_; ++i) {
      face[i].assign(size, 0);
      for (const std::size_t at : {std::size_t{0}, spoke(i), across(i), spoke(next_edge(i))})
        add(face[i], rows_[at], 0.25);
      made[across(i)] = face[i];
    }
    for (std::size_t i = 0; i < edges; ++i) {
      const EdgeRule rule = edge_rule(sharpness_[i]);
      add(made[spoke(i)], rows_[0], rule.end);
      add(made[spoke(i)], rows_[spoke(i)], rule.end);
      if (rule.face == 0) continue;
      add(made[spoke(i)], face[i], rule.face);
      add(made[spoke(i)], face[i == 0 ? faces_ - 1 : i - 1], rule.face);
    }
    const PointRule rule = point_rule(faces_, sharpness_, own_);
    add(made[0], rows_[0], rule.self);
    for (std::size_t i = 0; i < edges; ++i) add(made[0], rows_[spoke(i)], rule.spokes[i]);
    for (std::size_t i = 0; i < faces_; ++i) add(made[0], face[i], rule.faces[i]);
    rows_ = std::move(made);
    for (double& s : sharpness_) s = decayed(s);
    own_ = decayed(own_);
  }

  /// The form over the first ring that is this one over the ring of now.
  [[nodiscard]] RingForm pulled_back(const RingForm& form) const {
    std::vector<double> sum(rows_.size(), 0);
    const auto add = [&](std::size_t row, double scale) {
      if (scale == 0) return;
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += scale * rows_[row][k];
    };
    add(0, form.self);
    for (std::size_t i = 0; i < form.spokes.size(); ++i) add(spoke(i), form.spokes[i]);
    for (std::size_t i = 0; i < form.across.size(); ++i) add(across(i), form.across[i]);
    return form_of(sum);
  }
  [[nodiscard]] RingForm form_of(const std::vector<double>& row) const {
    const auto spokes = row.begin() + 1;
    const auto corners = spokes + static_cast<std::ptrdiff_t>(sharpness_.size());
    return {row[0], std::vector<double>(spokes, corners), std::vector<double>(corners, row.end())};
  }

 private:
  std::size_t faces_;
  std::vector<double> sharpness_;
  double own_;
  std::vector<std::vector<double>> rows_;
};

inline RingForm zero_form(std::size_t edges, std::size_t faces) {
  return {0, std::vector<double>(edges, 0), std::vector<double>(faces, 0)};
}

/// (7), (8): all around a smooth point.
inline void smooth_tangents(std::size_t n, Sector& sector) {
  const double step = 2 * std::numbers::pi / static_cast<double>(n);
  if (n == 2) {  // two quads back to back: sines vanish
    sector.t1.spokes = {1, -1};
    sector.t2.across = {1, -1};
    return;
  }
  const double c = std::cos(step);
  const double weight = 1 + c + std::cos(step / 2) * std::sqrt(2 * (9 + c));
  for (std::size_t i = 0; i < n; ++i) {
    const double at = step * static_cast<double>(i), then = step * static_cast<double>(i + 1);
    sector.t1.spokes[i] = weight * std::cos(at);
    sector.t2.spokes[i] = weight * std::sin(at);
    sector.t1.across[i] = std::cos(at) + std::cos(then);
    sector.t2.across[i] = std::sin(at) + std::sin(then);
  }
}

/// A plane through the spokes, for points where the surface has no tangent plane in every case: Fourier's first term.
inline void fitted_tangents(std::size_t first, std::size_t spokes, double turn, Sector& sector) {
  const std::size_t edges = sector.t1.spokes.size();
  for (std::size_t i = 0; i < spokes; ++i) {
    const double at = turn * static_cast<double>(i);
    sector.t1.spokes[(first + i) % edges] += std::cos(at);
    sector.t2.spokes[(first + i) % edges] += std::sin(at);
    sector.t1.self -= std::cos(at);
    sector.t2.self -= std::sin(at);
  }
}

/// (9): on one side of a curve, k faces.
inline void curve_tangents(std::size_t first, std::size_t k, Sector& sector) {
  const std::size_t edges = sector.t1.spokes.size();
  const std::size_t last = (first + k) % edges;
  const auto spoke = [&](RingForm& form, std::size_t i) -> double& { return form.spokes[(first + i) % edges]; };
  const auto across = [&](RingForm& form, std::size_t i) -> double& {
    return form.across[(first + i) % form.across.size()];
  };
  if (k >= 4) return fitted_tangents(first, k + 1, std::numbers::pi / static_cast<double>(k), sector);
  sector.t1.spokes[first] = 1;
  sector.t1.spokes[last] = -1;
  if (k == 1) {  // the curve turns within one face, whose tangent plane is the curve's own
    sector.t2.spokes[first] = sector.t2.spokes[last] = 1;
    sector.t2.self = -2;
    return;
  }
  const double pi_k = std::numbers::pi / static_cast<double>(k);
  const double c = std::cos(pi_k);
  const double lambda = (5 + c + std::sqrt((9 + c) * (1 + c))) / 16;
  const double weight = 16 * lambda - 4;
  double sum_spokes = 0, sum_across = 0;
  for (std::size_t i = 1; i < k; ++i) {
    spoke(sector.t2, i) = weight * std::sin(pi_k * static_cast<double>(i));
    sum_spokes += spoke(sector.t2, i);
  }
  for (std::size_t i = 0; i < k; ++i) {
    across(sector.t2, i) = std::sin(pi_k * static_cast<double>(i)) + std::sin(pi_k * static_cast<double>(i + 1));
    sum_across += across(sector.t2, i);
  }
  const double s1 = across(sector.t2, 0) / 4 + spoke(sector.t2, 1) / 16;
  const double s2 = 0.375 * sum_spokes + 0.25 * sum_across;
  const double det = (lambda - 0.5) * (lambda - 0.75) - 0.125;
  const double ends = ((lambda - 0.75) * s1 + 0.125 * s2) / det;
  sector.t2.spokes[first] += ends;
  sector.t2.spokes[last] += ends;
  sector.t2.self = ((lambda - 0.5) * s2 + s1) / det;
}

/// One sharp edge ends at the point, edge `sharp`: no closed form. What a form over the ring becomes after many levels
/// is its product with the matrix of a level, again and again: with any form that adds up to 1 this ends at the limit
/// (10), with those that add up to 0 at tangents, one for forms that the sharp edge mirrors onto themselves, one for
/// those that it mirrors onto their negatives.
inline Limit dart_limit(std::size_t n, std::size_t sharp) {
  std::vector<double> sharpness(n, 0);
  sharpness[sharp] = kInfinite;
  Ring one(n, sharpness, 0);
  one.refine();
  const std::vector<std::vector<double>>& step = one.rows();
  const std::size_t size = step.size();
  const auto mirrored = [&](std::size_t i) {
    if (i == 0) return i;
    if (i <= n) return one.spoke((2 * sharp + n - (i - 1)) % n);
    return one.across((2 * sharp + 2 * n - 1 - (i - 1 - n)) % n);
  };
  // The second largest of the eigenvalues that matter is below 0.9 of the largest for all valences: 0.9^400 < 1e-18.
  constexpr int kLevels = 400;
  // sum: of the form; parity: 1, -1, or 0 for forms that the edge does not mirror.
  const auto settle = [&](std::vector<double> form, double sum, double parity) {
    for (int level = 0; level < kLevels; ++level) {
      std::vector<double> next(size, 0);
      for (std::size_t i = 0; i < size; ++i)
        for (std::size_t k = 0; k < size; ++k) next[k] += form[i] * step[i][k];
      // Rounding leads out of the space of such forms, and what is outside would grow.
      for (std::size_t i = 0; i < size; ++i)
        form[i] = parity == 0 ? next[i] : 0.5 * (next[i] + parity * next[mirrored(i)]);
      double rest = 0, largest = 0;
      for (std::size_t i = 1; i < size; ++i) rest += form[i];
      form[0] = sum - rest;
      for (const double value : form) largest = std::max(largest, std::abs(value));
      for (double& value : form) value /= sum == 0 ? largest : 1;
    }
    return one.form_of(form);
  };
  std::vector<double> place(size, 0), symmetric(size, 0), antisymmetric(size, 0);
  place[0] = 1;
  symmetric[one.spoke(sharp)] = 1;
  symmetric[0] = -1;
  antisymmetric[one.across(sharp)] += 1;  // the face behind the edge, and the one before it
  antisymmetric[one.across((sharp + n - 1) % n)] -= 1;
  Limit limit;
  limit.position = settle(place, 1, 0);
  limit.sectors.push_back({0, n, settle(symmetric, 0, 1), settle(antisymmetric, 0, -1)});
  return limit;
}

/// Of a ring whose sharpnesses are 0 or infinite.
inline Limit settled_limit(std::size_t faces, std::span<const double> sharpness, double own, bool is_closed) {
  const std::size_t edges = sharpness.size();
  std::vector<std::size_t> sharp;
  for (std::size_t i = 0; i < edges; ++i)
    if (is_sharp(sharpness[i])) sharp.push_back(i);
  if (sharp.size() == 1 && !is_sharp(own)) return dart_limit(faces, sharp[0]);
  Limit limit;
  limit.position = zero_form(edges, faces);
  const bool is_corner = is_sharp(own) || sharp.size() > 2;
  if (is_corner) {
    limit.position.self = 1;
  } else if (sharp.size() == 2) {
    limit.position.self = 4.0 / 6;
    for (const std::size_t i : sharp) limit.position.spokes[i] = 1.0 / 6;
  } else {  // (6)
    const auto n = static_cast<double>(edges);
    limit.position.self = n / (n + 5);
    for (double& weight : limit.position.spokes) weight = 4 / (n * (n + 5));
    for (double& weight : limit.position.across) weight = 1 / (n * (n + 5));
  }
  if (sharp.size() < 2) {
    Sector all{0, faces, zero_form(edges, faces), zero_form(edges, faces)};
    if (is_corner) {
      fitted_tangents(0, edges, 2 * std::numbers::pi / static_cast<double>(edges), all);
    } else {
      smooth_tangents(edges, all);
    }
    limit.sectors.push_back(std::move(all));
    return limit;
  }
  for (std::size_t s = 0; s < sharp.size(); ++s) {
    const bool is_last = s + 1 == sharp.size();
    if (is_last && !is_closed) break;
    const std::size_t end = is_last ? sharp[0] + edges : sharp[s + 1];
    Sector sector{sharp[s], end - sharp[s], zero_form(edges, faces), zero_form(edges, faces)};
    if (!is_corner) {
      curve_tangents(sector.first_face, sector.faces, sector);
    } else if (sector.faces == 1) {
      sector.t1.spokes[sharp[s]] = 1;
      sector.t2.spokes[end % edges] = 1;
      sector.t1.self = sector.t2.self = -1;
    } else {
      fitted_tangents(sector.first_face, sector.faces + 1, std::numbers::pi / static_cast<double>(sector.faces),
                      sector);
    }
    limit.sectors.push_back(std::move(sector));
  }
  return limit;
}

}  // namespace detail

/// Of a point in a fan of quads. Sharpness that ends some levels later is followed there, ring by ring.
inline Limit limit_of(std::size_t faces, std::vector<double> sharpness, double own, bool is_closed) {
  detail::Ring ring(faces, std::move(sharpness), own);
  const bool is_settled = ring.is_settled();
  while (!ring.is_settled()) ring.refine();
  Limit limit = detail::settled_limit(faces, ring.sharpness(), ring.own(), is_closed);
  if (is_settled) return limit;
  limit.position = ring.pulled_back(limit.position);
  for (Sector& sector : limit.sectors) {
    sector.t1 = ring.pulled_back(sector.t1);
    sector.t2 = ring.pulled_back(sector.t2);
  }
  return limit;
}

// ---- refinement -----------------------------------------------------------------------------------------------------

/// The cage after some levels: quads, whose vertices are rows of weights.
struct Level {
  explicit Level(Topology of) : topology(std::move(of)) {}
  Topology topology;
  std::vector<double> point_sharpness;
  Weights points;                // of the vertices as they are refined, not at their limit
  std::vector<Index> cage_face;  // of each face, and which of its corners it lies at (kNone at level 0)
  std::vector<Index> cage_corner;
};

inline Level level_zero(const Cage& cage) {
  Level level(Topology(cage.point_count, cage.face_sizes, cage.corners));
  for (const auto& [points, sharpness] : cage.sharp_edges) {
    const std::array<Index, 2> sorted{std::min(points[0], points[1]), std::max(points[0], points[1])};
    const auto found = std::lower_bound(level.topology.edges.begin(), level.topology.edges.end(), sorted,
                                        [](const Edge& edge, const auto& wanted) { return edge.points < wanted; });
    if (found == level.topology.edges.end() || found->points != sorted) continue;  // no edge of a face
    found->sharpness = std::clamp(std::max(found->sharpness, sharpness), 0.0, kInfinite);
  }
  level.point_sharpness.assign(cage.point_count, 0);
  for (const auto& [point, sharpness] : cage.sharp_points)
    level.point_sharpness[point] = std::clamp(std::max(level.point_sharpness[point], sharpness), 0.0, kInfinite);
  for (Index point = 0; point < cage.point_count; ++point) {
    level.points.points.push_back(point);
    level.points.values.push_back(1);
    level.points.first.push_back(level.points.points.size());
    const Fan fan = level.topology.fan(point);
    if (cage.pins_corners && !fan.is_closed && fan.faces.size() == 1) level.point_sharpness[point] = kInfinite;
  }
  for (Index f = 0; f < level.topology.face_count(); ++f) {
    level.cage_face.push_back(f);
    level.cage_corner.push_back(kNone);
  }
  return level;
}

inline std::vector<double> sharpness_of(const Topology& topology, const Fan& fan) {
  std::vector<double> all;
  for (const Index edge : fan.edges) all.push_back(topology.edges[edge].sharpness);
  return all;
}

/// Children: of points, then of edges, then of faces; corner i of face f becomes face first(f) + i, which begins at the
/// corner's child and goes on to the edge's, the face's and the previous edge's.
inline Level refine(const Level& parent, Index cage_points) {
  const Topology& topology = parent.topology;
  const auto points = static_cast<Index>(parent.points.count());
  const auto edges = static_cast<Index>(topology.edges.size());
  const Index faces = topology.face_count();
  std::vector<Index> corners, cage_face, cage_corner;
  for (Index f = 0; f < faces; ++f) {
    for (Index i = 0; i < topology.size(f); ++i) {
      corners.insert(corners.end(), {topology.corner(f, i), points + topology.edge_of(f, i), points + edges + f,
                                     points + topology.edge_of(f, topology.previous(f, i))});
      cage_face.push_back(parent.cage_face[f]);
      cage_corner.push_back(parent.cage_corner[f] == kNone ? i : parent.cage_corner[f]);
    }
  }
  Level level(Topology(points + edges + faces, std::vector<Index>(topology.corner_count(), 4), std::move(corners)));
  level.cage_face = std::move(cage_face);
  level.cage_corner = std::move(cage_corner);

  Mixer mixer(cage_points);
  Weights face_rows;
  for (Index f = 0; f < faces; ++f) {  // (1)
    const double share = 1.0 / topology.size(f);
    for (Index i = 0; i < topology.size(f); ++i) mixer.add(parent.points, topology.corner(f, i), share);
    mixer.finish(face_rows);
  }
  for (Index point = 0; point < points; ++point) {
    const Fan fan = topology.fan(point);
    if (fan.faces.empty()) {
      mixer.add(parent.points, point, 1);
      mixer.finish(level.points);
      continue;
    }
    const PointRule rule = point_rule(fan.faces.size(), sharpness_of(topology, fan), parent.point_sharpness[point]);
    mixer.add(parent.points, point, rule.self);
    for (std::size_t i = 0; i < fan.spokes.size(); ++i)
      if (rule.spokes[i] != 0) mixer.add(parent.points, fan.spokes[i], rule.spokes[i]);
    for (std::size_t i = 0; i < fan.faces.size(); ++i)
      if (rule.faces[i] != 0) mixer.add(face_rows, fan.faces[i], rule.faces[i]);
    mixer.finish(level.points);
  }
  for (const Edge& edge : topology.edges) {
    const EdgeRule rule = edge_rule(edge.sharpness);
    for (const Index point : edge.points) mixer.add(parent.points, point, rule.end);
    if (rule.face != 0)
      for (const Index face : edge.faces) mixer.add(face_rows, face, rule.face);
    mixer.finish(level.points);
  }
  for (Index f = 0; f < faces; ++f) {
    mixer.add(face_rows, f, 1);
    mixer.finish(level.points);
  }

  level.point_sharpness.assign(points + edges + faces, 0);
  for (Index point = 0; point < points; ++point) level.point_sharpness[point] = decayed(parent.point_sharpness[point]);
  // Halves of an edge: between a point's child and the edge's. All others are within faces, and smooth.
  for (Edge& half : level.topology.edges) {
    if (half.is_border() || half.points[0] >= points || half.points[1] < points || half.points[1] >= points + edges)
      continue;
    half.sharpness = decayed(topology.edges[half.points[1] - points].sharpness);
  }
  return level;
}

/// A level of quads with the weights of limits. Vertices that surfaces of different tangents share stand there once for
/// each, with the same weights for their place.
struct Refined {
  std::vector<Index> quads;     // four rows each, counter-clockwise from the corner's own vertex
  std::vector<Index> vertices;  // of each row: the level's vertex, by which rows that share a place are known
  Weights positions;            // by vertex: as refined
  Weights limits;               // by vertex: at the limit
  Weights t1, t2;               // by row
  std::vector<Index> cage_face, cage_corner;  // of each quad
};

inline Refined take_limits(const Level& level, Index cage_points) {
  const Topology& topology = level.topology;
  Refined made;
  made.positions = level.points;
  made.quads.resize(topology.corner_count());
  made.cage_face = level.cage_face;
  made.cage_corner = level.cage_corner;
  Mixer mixer(cage_points);
  std::map<std::pair<std::size_t, std::size_t>, Limit> settled;  // of smooth fans and plain borders, by their sizes
  for (Index point = 0; point < level.points.count(); ++point) {
    const Fan fan = topology.fan(point);
    if (fan.faces.empty()) {
      mixer.add(level.points, point, 1);
      mixer.finish(made.limits);
      continue;
    }
    std::vector<double> sharpness = sharpness_of(topology, fan);
    const double own = level.point_sharpness[point];
    const bool is_plain = own == 0 && std::all_of(sharpness.begin(), sharpness.end(), [&](const double& s) {
                            const bool is_end = &s == &sharpness.front() || &s == &sharpness.back();
                            return s == (!fan.is_closed && is_end ? kInfinite : 0);
                          });
    const std::pair key(fan.edges.size(), fan.faces.size());
    std::optional<Limit> own_limit;
    if (is_plain && !settled.contains(key))
      settled.emplace(key, limit_of(fan.faces.size(), sharpness, own, fan.is_closed));
    if (!is_plain) own_limit = limit_of(fan.faces.size(), std::move(sharpness), own, fan.is_closed);
    const Limit& limit = is_plain ? settled.at(key) : *own_limit;
    const auto put = [&](const RingForm& form, Weights& to) {
      if (form.self != 0) mixer.add(level.points, point, form.self);
      for (std::size_t i = 0; i < fan.spokes.size(); ++i)
        if (form.spokes[i] != 0) mixer.add(level.points, fan.spokes[i], form.spokes[i]);
      for (std::size_t i = 0; i < fan.faces.size(); ++i) {
        if (form.across[i] == 0) continue;
        mixer.add(level.points, topology.corner(fan.faces[i], (fan.corners[i] + 2) % 4), form.across[i]);
      }
      mixer.finish(to);
    };
    put(limit.position, made.limits);
    for (const Sector& sector : limit.sectors) {
      const auto row = static_cast<Index>(made.vertices.size());
      made.vertices.push_back(point);
      put(sector.t1, made.t1);
      put(sector.t2, made.t2);
      for (std::size_t i = 0; i < sector.faces; ++i) {
        const std::size_t at = (sector.first_face + i) % fan.faces.size();
        made.quads[topology.first(fan.faces[at]) + fan.corners[at]] = row;
      }
    }
  }
  return made;
}

/// `levels` of at least 1. Throws std::invalid_argument for what is no manifold.
inline Refined refine_to_limit(const Cage& cage, int levels) {
  Level level = level_zero(cage);
  for (int i = 0; i < levels; ++i) level = refine(level, cage.point_count);
  return take_limits(level, cage.point_count);
}

}  // namespace heddle::catmull_clark
