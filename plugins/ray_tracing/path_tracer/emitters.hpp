// SPDX-License-Identifier: Apache-2.0
// All that sends light to a point - lights, glowing triangles, the sky - and one of each kind drawn for it. README (4),
// (5).
#pragma once

#include "geometry.hpp"
#include "light_shapes.hpp"
#include "light_tree.hpp"
#include "sky_map.hpp"
#include "surfaces.hpp"

#include <array>

namespace heddle::path_tracer {

/// From where light comes to a point, and how likely it was to be drawn.
struct LightSample {
  Arrival arrival;           // value in cd/m^2 where has_size, else in lx; pdf without that of the choice
  double probability = 0.0;  // of choosing this emitter; 0: nothing
  bool has_size = false;     // what rays can also find by chance: to be weighted against that
  bool can_be_met = false;   // ... and they do
  bool casts_shadow = true;
  bool has_slack = false;  // ends at a light's own shape, which a picture of it may stand in for
};

class Emitters {
 public:
  /// Lights relative to `origin`, from the triangles' origin. `glows`: surfaces that glow light others.
  void update(std::span<const HeddleLight> lights, std::span<const glm::vec4> light_textures, const glm::dvec3& origin,
              const Geometry& geometry, const Surfaces& surfaces, const SkyMap& sky, bool glows);

  /// Kinds of emitters: of each one is drawn, whatever there is of the others. Not of an even sky: what tells its
  /// directions apart is the surface that reflects them, and the samples of its material are drawn by that.
  enum class Kind : std::uint32_t { kSky, kNear, kFar };  // the tree's; directional lights and boxes
  static constexpr std::array<Kind, 3> kKinds{Kind::kNear, Kind::kSky, Kind::kFar};
  [[nodiscard]] bool has(Kind kind) const {
    return kind == Kind::kSky    ? sky_->shines() && !sky_->is_even()
           : kind == Kind::kNear ? !tree_.is_empty()
                                 : !outside_.empty();
  }
  /// u.x chooses the emitter too: what the choice leaves of it is as even as all of it, and pairs stay pairs.
  [[nodiscard]] LightSample sample(Kind kind, const glm::dvec3& point, const glm::dvec3& normal,
                                   const glm::dvec2& u) const;

  /// add(value, density): what a ray from `point` meets of lights' shapes and farther away than `first` up to `length`,
  /// and with which density sample() would have drawn it.
  template <typename Add>
  void meet(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& direction, double first, double length,
            const Add& add) const;
  /// The same of the discs of suns, for rays that meet nothing.
  template <typename Add>
  void meet_discs(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& direction, const Add& add) const;

  struct Background {
    glm::dvec3 radiance{0.0};
    double pdf = 0.0;
  };
  /// The sky, and the density per steradian with which sample() draws it, in this direction.
  [[nodiscard]] Background background(const glm::dvec3& direction) const;
  /// ... and of a point of a glowing triangle, `distance` away; 0 if it is no emitter.
  [[nodiscard]] double pdf_triangle(const glm::dvec3& point, const glm::dvec3& normal, std::uint32_t triangle,
                                    const Foot& foot, const glm::dvec3& direction, double distance) const;

  [[nodiscard]] const SkyMap& sky() const { return *sky_; }
  [[nodiscard]] std::span<const Light> lights() const { return lights_; }
  [[nodiscard]] std::span<const glm::vec4> light_textures() const { return textures_; }
  [[nodiscard]] std::size_t triangle_count() const { return triangles_.size(); }

 private:
  /// What chooses among lights that are not in the tree: half by how much each may send, half evenly among those that
  /// may send anything.
  struct Weights {
    double sum = 0.0;
    std::uint32_t count = 0;
    [[nodiscard]] double share(double weight) const { return weight > 0.0 ? 0.5 * (weight / sum + 1.0 / count) : 0.0; }
  };
  [[nodiscard]] Weights weigh(const glm::dvec3& point, const glm::dvec3& normal) const;
  /// Of a light that is not in the tree: about the lux that it sends; 0 only where it sends none.
  [[nodiscard]] double weight_of(const Light& light, const glm::dvec3& point, const glm::dvec3& normal) const;
  [[nodiscard]] LightSample sample_sky(const glm::dvec2& u) const;
  [[nodiscard]] LightSample sample_near(const glm::dvec3& point, const glm::dvec3& normal,
                                        const glm::dvec2& u_whole) const;
  [[nodiscard]] LightSample sample_far(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec2& u) const;
  [[nodiscard]] LightSample sample_light_of(const Light& light, double probability, const glm::dvec3& point,
                                            const glm::dvec2& u) const;

  std::vector<Light> lights_;
  std::vector<std::uint32_t> outside_;     // of the tree: directional lights and boxes
  std::vector<std::uint32_t> triangles_;   // emitters of the tree from lights_.size() on
  std::vector<std::uint32_t> emitter_of_;  // by triangle, ~0: none; empty if no triangle glows
  std::vector<glm::vec4> textures_;
  LightTree tree_;
  const SkyMap* sky_ = nullptr;
  const Geometry* geometry_ = nullptr;
  const Surfaces* surfaces_ = nullptr;
};

template <typename Add>
void Emitters::meet(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& direction, double first,
                    double length, const Add& add) const {
  tree_.meet(point, direction, length, [&](std::uint32_t emitter) {
    if (emitter >= lights_.size() || !lights_[emitter].casts_shadow) return;
    const Arrival met = meet_light(lights_[emitter], point, direction, first, length, textures_);
    if (!(met.pdf > 0.0)) return;
    add(met.value, met.pdf * tree_.probability(point, normal, emitter));
  });
}

template <typename Add>
void Emitters::meet_discs(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& direction,
                          const Add& add) const {
  for (const std::uint32_t i : outside_) {
    if (!lights_[i].is_disc() || !lights_[i].casts_shadow) continue;
    const Arrival met = meet_light(lights_[i], point, direction, 0.0, 0.0, textures_);
    if (met.pdf > 0.0) add(met.value, met.pdf * weigh(point, normal).share(weight_of(lights_[i], point, normal)));
  }
}

}  // namespace heddle::path_tracer
