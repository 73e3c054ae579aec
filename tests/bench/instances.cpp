// SPDX-License-Identifier: Apache-2.0
// Ten thousand boxes of which none, a quarter, half and all are in view: what a frame costs should follow what is seen.
#include "session.hpp"

#include <fmt/format.h>

#include <cmath>

namespace heddle::bench {
namespace {

constexpr std::array<double, 4> kParts{0, 0.25, 0.5, 1};

/// The camera looks along -Z at a square wall of boxes and is moved aside, so that `part` of its columns are in view.
heddle_camera camera_before(int side, double part) {
  heddle_camera camera{};
  camera.struct_size = sizeof camera;
  camera.rotation[3] = 1;
  camera.position[0] = -side * (1.0 - part);
  camera.position[2] = 10;
  camera.is_orthographic = 1;
  camera.vertical_angle = 0.5 * side;
  camera.aspect = 1;
  camera.near_distance = 1;
  camera.far_distance = 100;
  return camera;
}

}  // namespace

void measure_instances(Session& session) {
  const bool is_small = session.options().is_small;
  const int side = is_small ? 8 : 100;
  const Owned<heddle_scene> scene = session.make_scene();
  std::vector<std::array<double, 3>> places;
  // Column by column. Half a box stands aside of where the view may end.
  for (int x = 0; x < side; ++x)
    for (int y = 0; y < side; ++y) places.push_back({x + 0.5 - 0.5 * side, y + 0.5 - 0.5 * side, 0});
  fill_with_boxes(session, scene.get(), places, 0.5);
  const std::string text = fmt::format(
      "extent = [{0}, {0}]\noutput = \"gbuffer.depth\"\n[[pass]]\nrole = \"gbuffer\"\n"
      "technique = \"raster\"\n",
      is_small ? 16 : 256);
  struct View {
    std::uint32_t camera = 0;
    Owned<heddle_graph> graph;
    std::vector<double> ms;
    double drawn = 0;
  };
  std::vector<View> views;
  for (const double part : kParts) {
    View& view = views.emplace_back();
    const heddle_camera camera = camera_before(side, part);
    session.check(heddle_scene_add_camera(scene.get(), nullptr, &camera, &view.camera));
    view.graph = session.parse_graph(text);
  }
  const auto render = [&](View& view) {
    session.check(heddle_scene_use_camera(scene.get(), view.camera));
    const double start = now_ms();
    session.render(view.graph.get(), scene.get());
    return now_ms() - start;
  };
  for (int warm = 0; warm < 2; ++warm)
    for (View& view : views) render(view);
  for (int run = 0; run < session.runs(20); ++run) {
    for (std::size_t i = 0; i < views.size(); ++i) {
      View& view = views[run % 2 == 0 ? i : views.size() - 1 - i];
      view.ms.push_back(render(view));
    }
  }
  Report& report = session.report;
  std::vector<double> drawn, medians;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Json instances = session.stats(views[i].graph.get())["instances"];
    const double percent = 100 * kParts[i];
    drawn.push_back(instances["drawn"].get<double>());
    medians.push_back(median_of(views[i].ms).value);
    report.add_measured(fmt::format("instances.frame_{:g}_percent", percent), "ms", views[i].ms);
    report.add_number(fmt::format("instances.drawn_{:g}_percent", percent), "1", drawn.back());
    report.add_number(fmt::format("instances.culled_{:g}_percent", percent), "1", instances["culled"].get<double>());
  }
  const Line line = fit_line(drawn, medians);
  report.add_number("instances.slope", "us", 1e3 * line.slope);
  report.add_number("instances.intercept", "ms", line.intercept);
  report.add_number("instances.residual", "1", line.residual);

  // A camera that moves takes the frame's origin with it: all places are then written anew.
  std::vector<double> moving;
  View& view = views[1];
  for (int run = 0; run < session.runs(20); ++run) {
    heddle_camera camera = camera_before(side, kParts[1]);
    camera.position[2] += 0.001 * (run + 1);
    session.check(heddle_scene_set_camera(scene.get(), view.camera, &camera));
    moving.push_back(render(view));
  }
  report.add_measured("instances.frame_25_percent_moving_camera", "ms", moving);
}

}  // namespace heddle::bench
