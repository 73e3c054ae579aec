// SPDX-License-Identifier: Apache-2.0
// Times for the present view: the steps of a knob's ladder, which take turns, and the stages of a frame.
#include "diagnostics.hpp"
#include "view/catalog.hpp"
#include "view/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace heddle::view {

namespace {

// Seven frames: their smallest and largest hold the true median with 98 %, six would do with 97 % (statistics.hpp).
constexpr int kRounds = 7;
// The first frame compiles; what it leaves to the next (lists that grow, kept images) has come round in the third.
constexpr int kWarmUpFrames = 3;

struct DestroyGraph {
  void operator()(heddle_graph* graph) const { heddle_graph_destroy(graph); }
};
using OwnedGraph = std::unique_ptr<heddle_graph, DestroyGraph>;

/// The ladder's values as settings have them, and the present one if it is between them.
std::vector<Json> values_of(const Json& parameter, const Json& present) {
  std::vector<Json> values;
  for (const Json& step : parameter.at("ladder")) {
    const double number = step.get<double>();
    if (parameter.at("type") == "choice")
      values.push_back(parameter.at("choices").at(static_cast<std::size_t>(number)));
    else if (parameter.at("type") == "int")
      values.emplace_back(static_cast<std::int64_t>(number));
    else
      values.emplace_back(number);
  }
  if (std::ranges::find(values, present) == values.end()) values.push_back(present);
  return values;
}

}  // namespace

void Session::measure(Variant variant, const std::string& pass, const std::string& parameter) {
  if (!exists(variant)) return;
  is_measuring_stopped_.store(false);
  VariantReport& report = draft_.variants.at(variant);
  const std::string key = pass + ".params." + parameter;
  const auto say = [&](const std::string& text) {
    {
      const std::lock_guard lock(mutex_);
      activity_ = text;
      ++serial_;
    }
    wake_();
  };
  (void)guarded(variant, &VariantReport::refused, [&] {
    const Json* present = pass_of(report.description, pass);
    const Json* declared = present != nullptr ? parameter_of(*draft_.list, *present, parameter) : nullptr;
    if (declared == nullptr || declared->at("ladder").empty()) return;
    const std::vector<Json> values = values_of(*declared, present->at("parameters").at(parameter));
    Costs costs;
    costs.situation = situation(variant, key);
    // A graph for each step, so that nothing of the one that is shown changes, and turns cost no planning.
    const Side& side = sides_.at(variant);
    std::vector<OwnedGraph> graphs;
    std::vector<std::vector<double>> samples(values.size());
    const auto render = [&](std::size_t step, bool is_timed) {
      if (is_closing_.load() || is_measuring_stopped_.load()) throw Error(HEDDLE_CANCELLED, "measuring was stopped");
      const heddle_render_options chosen = options(HEDDLE_RENDER_ANEW, 0);
      check(heddle_render(graphs[step].get(), side.scene, &chosen));
      if (!is_timed) return;
      const char* text = nullptr;
      check(heddle_stats(graphs[step].get(), &text));
      samples[step].push_back(parse_json(text).at("submit_ms").get<double>());
    };
    for (std::size_t step = 0; step < values.size(); ++step) {
      say(fmt::format("measuring {}: preparing {}", key, write_json(values[step])));
      costs.steps.push_back({values[step], {}, {}});
      graphs.emplace_back();
      try {
        std::vector<std::string> texts;
        for (const std::string& setting : side.settings)
          if (!setting.starts_with(key + "=")) texts.push_back(setting);
        texts.push_back(key + "=" + write_json(values[step]));
        std::vector<const char*> settings;
        for (const std::string& text : texts) settings.push_back(text.c_str());
        heddle_graph* made = nullptr;
        check(heddle_graph_load(host_, side.file.c_str(), settings.data(), static_cast<std::uint32_t>(settings.size()),
                                &made));
        graphs.back().reset(made);
        for (int frame = 0; frame < kWarmUpFrames; ++frame) render(step, false);
      } catch (const Error& error) {
        if (error.status() == HEDDLE_CANCELLED) throw;
        graphs.back().reset();
        costs.steps.back().error = error.what();
      }
    }
    // Back and forth, so that what slows the machine for a while touches all of them.
    is_quiet_.store(true);
    try {
      for (int round = 0; round < kRounds; ++round) {
        say(fmt::format("measuring {}: round {} of {}", key, round + 1, kRounds));
        for (std::size_t i = 0; i < values.size(); ++i) {
          const std::size_t step = round % 2 == 0 ? i : values.size() - 1 - i;
          if (graphs[step]) render(step, true);
        }
      }
    } catch (...) {
      is_quiet_.store(false);
      throw;
    }
    is_quiet_.store(false);
    for (std::size_t step = 0; step < values.size(); ++step)
      if (graphs[step]) costs.steps[step].ms = profile::median_of(std::move(samples[step]));
    report.costs[key] = std::move(costs);
  });
}

void Session::time_stages(Variant variant) {
  if (!exists(variant)) return;
  is_measuring_stopped_.store(false);
  VariantReport& report = draft_.variants.at(variant);
  (void)guarded(variant, &VariantReport::refused, [&] {
    Side& side = sides_.at(variant);
    side.is_unread = true;
    Times times;
    std::vector<double> frames, looked_at;
    std::vector<std::vector<double>> wall, cpu;
    const auto render = [&](std::uint32_t flags) {
      if (is_closing_.load() || is_measuring_stopped_.load()) throw Error(HEDDLE_CANCELLED, "measuring was stopped");
      const heddle_render_options chosen = options(flags, 0);
      check(heddle_render(side.graph, side.scene, &chosen));
      const char* text = nullptr;
      check(heddle_stats(side.graph, &text));
      return parse_json(text);
    };
    for (int round = 0; round < kRounds; ++round) {
      frames.push_back(render(HEDDLE_RENDER_ANEW).at("submit_ms").get<double>());
      const Json stats = render(HEDDLE_RENDER_PROFILE);
      looked_at.push_back(stats.at("submit_ms").get<double>());
      if (times.stages.size() != stats.at("stages").size()) {  // the first, or lists have grown
        times.stages.assign(stats.at("stages").size(), {});
        wall.assign(times.stages.size(), {});
        cpu.assign(times.stages.size(), {});
      }
      for (std::size_t i = 0; i < times.stages.size(); ++i) {
        const Json& stage = stats.at("stages")[i];
        times.stages[i].pass = stage.at("pass").get<std::string>();
        times.stages[i].stage = stage.at("stage").get<std::string>();
        wall[i].push_back(stage.at("wall_ms").get<double>());
        cpu[i].push_back(stage.at("cpu_ms").get<double>());
      }
    }
    for (std::size_t i = 0; i < times.stages.size(); ++i) {
      times.stages[i].wall_ms = profile::median_of(wall[i]).value;
      times.stages[i].cpu_ms = profile::median_of(cpu[i]).value;
    }
    times.frame_ms = profile::median_of(std::move(frames));
    times.looked_at_ms = profile::median_of(std::move(looked_at));
    report.times = std::move(times);
  });
  changed();  // what was rendered meanwhile may be ahead of what is shown
}

}  // namespace heddle::view
