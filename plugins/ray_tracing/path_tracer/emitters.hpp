// SPDX-License-Identifier: Apache-2.0
// All that sends light to a point - lights, glowing triangles, the sky - and one of them drawn for it. README (4), (5).
#pragma once

#include "geometry.hpp"
#include "light_shapes.hpp"
#include "light_tree.hpp"
#include "sky_map.hpp"
#include "surfaces.hpp"

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

  [[nodiscard]] LightSample sample(const glm::dvec3& point, const glm::dvec3& normal, double u_choice,
                                   const glm::dvec2& u) const;

  /// add(value, density): what a ray from `point` meets of lights' shapes and farther away than `first` up to `length`,
  /// and with which density sample() would have drawn it.
  template <typename Add>
  void meet(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& direction, double first, double length,
            const Add& add) const;
  /// The same of the discs of suns, for rays that meet nothing.
  template <typename Add>
  void meet_discs(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& direction, const Add& add) const;

  /// Density per steradian with which sample() draws the sky in this direction.
  [[nodiscard]] double pdf_sky(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& direction) const;
  /// ... and a point of a glowing triangle, `distance` away; 0 if it is no emitter.
  [[nodiscard]] double pdf_triangle(const glm::dvec3& point, const glm::dvec3& normal, std::uint32_t triangle,
                                    const Foot& foot, const glm::dvec3& direction, double distance) const;

  [[nodiscard]] const SkyMap& sky() const { return *sky_; }
  [[nodiscard]] std::span<const Light> lights() const { return lights_; }
  [[nodiscard]] std::span<const glm::vec4> light_textures() const { return textures_; }
  [[nodiscard]] std::size_t triangle_count() const { return triangles_.size(); }

 private:
  /// What chooses among the sky, the tree, and lights that are not in the tree: half by how much each may send, half
  /// evenly among those that may send anything.
  struct Weights {
    double sky = 0.0, tree = 0.0, sum = 0.0;
    std::uint32_t count = 0;
    void add(double weight) {
      sum += weight;
      count += weight > 0.0 ? 1U : 0U;
    }
    [[nodiscard]] double share(double weight) const { return weight > 0.0 ? 0.5 * (weight / sum + 1.0 / count) : 0.0; }
  };
  [[nodiscard]] Weights weigh(const glm::dvec3& point, const glm::dvec3& normal) const;
  /// Of a light that is not in the tree: about the lux that it sends; 0 only where it sends none.
  [[nodiscard]] double weight_of(const Light& light, const glm::dvec3& point, const glm::dvec3& normal) const;
  [[nodiscard]] LightSample sample_near(const glm::dvec3& point, const glm::dvec3& normal, double u_choice,
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
    const Weights weights = weigh(point, normal);
    add(met.value, met.pdf * tree_.probability(point, normal, emitter) * weights.share(weights.tree));
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
