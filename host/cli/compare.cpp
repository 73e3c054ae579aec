// SPDX-License-Identifier: Apache-2.0
// heddle compare: two image files, or one graph with two techniques of a role: images, difference, numbers, times.

#include "cli/session.hpp"
#include "cli/stop.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <memory>

namespace heddle::cli {

namespace {

struct CompareArguments : RenderArguments {
  std::string swap;  // "ao=gtao,ray_traced"
  std::string port;  // what is compared; empty: the output
  std::string folder = "out";
  std::string difference;  // image mode
  std::vector<std::string> bounds;
  int repeats = 3;
  bool as_json = false;
};

// The formulas are compare/metrics.hpp's: a the first image, b the reference, over all values of all pixels.
struct MetricText {
  const char* key;
  const char* formula;
};
constexpr std::array<MetricText, 7> kMetrics{{{"rmse", "sqrt(mean (a-b)^2)"},
                                              {"mse", "mean (a-b)^2"},
                                              {"relmse", "mean (a-b)^2 / (b^2 + 0.01)"},
                                              {"psnr", "10 log10(1 / mse), dB"},
                                              {"mean_difference", "mean (a-b)"},
                                              {"maximum", "max |a-b|"},
                                              {"percentile_99", "99th percentile of |a-b|"}}};

void print_metrics(const Json& metrics) {
  for (const MetricText& metric : kMetrics) {
    const Json& value = metrics.at(metric.key);
    const std::string text = value.is_number() ? fmt::format("{:.6g}", value.get<double>()) : "infinite";
    fmt::print("  {:<16} {:>12}   {}\n", metric.key, text, metric.formula);
  }
}

/// "rmse=0.01": exits 1 if the metric is above (psnr: below) the bound.
int check_bounds(const std::vector<std::string>& bounds, const Json& metrics) {
  int status = HEDDLE_OK;
  for (const std::string& bound : bounds) {
    const std::size_t equals = bound.find('=');
    const std::string key = bound.substr(0, equals);
    const bool is_known =
        std::any_of(kMetrics.begin(), kMetrics.end(), [&](const MetricText& metric) { return key == metric.key; });
    char* end = nullptr;
    const double limit = equals == std::string::npos ? 0 : std::strtod(bound.c_str() + equals + 1, &end);
    if (!is_known || end == nullptr || *end != '\0' || end == bound.c_str() + equals + 1) {
      throw Failure{HEDDLE_BAD_INPUT,
                    fmt::format("error: --bound '{}' is not METRIC=NUMBER\n  expected: one of rmse, mse, "
                                "relmse, psnr, mean_difference, maximum, percentile_99",
                                bound)};
    }
    if (!metrics.at(key).is_number()) continue;  // psnr of equal images is infinite
    const double value = metrics.at(key).get<double>();
    const bool is_within = key == "psnr" ? value >= limit : std::abs(value) <= limit;
    if (!is_within) {
      fmt::print(stderr, "bound exceeded: {} is {:.6g}, the bound is {:.6g}\n", key, value, limit);
      status = 1;
    }
  }
  return status;
}

int compare_files(CompareArguments& arguments) {
  if (arguments.files.size() != 2) {
    throw Failure{HEDDLE_BAD_INPUT,
                  fmt::format("error: compare takes two images, or --swap PASS=A,B with a graph and a "
                              "scene\n  found:    {} files",
                              arguments.files.size())};
  }
  const Owned<heddle_host> host = make_host(arguments.host);
  heddle_image image{};
  image.struct_size = sizeof image;
  check(host.get(), heddle_image_read(host.get(), arguments.files[0].c_str(), &image));
  const std::vector<float> first(image.pixels, image.pixels + std::size_t{image.width} * image.height * image.channels);
  heddle_image a = image;
  a.pixels = first.data();
  heddle_image b{};
  b.struct_size = sizeof b;
  check(host.get(), heddle_image_read(host.get(), arguments.files[1].c_str(), &b));
  const char* text = nullptr;
  check(host.get(), heddle_image_compare(host.get(), &a, &b,
                                         arguments.difference.empty() ? nullptr : arguments.difference.c_str(), &text));
  const Json metrics = parse_json(text);
  if (arguments.as_json) {
    fmt::print("{}\n", text);
  } else {
    fmt::print("{} against {}\n", arguments.files[0], arguments.files[1]);
    print_metrics(metrics);
  }
  return check_bounds(arguments.bounds, metrics);
}

struct Variant {
  std::string technique;
  Owned<heddle_graph> graph;
  std::vector<double> frame_ms;
  std::vector<float> pixels;
  heddle_image image{};
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 != 0 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

int compare_techniques(CompareArguments& arguments) {
  const std::size_t equals = arguments.swap.find('=');
  const std::size_t comma = arguments.swap.find(',');
  if (equals == std::string::npos || comma == std::string::npos || comma < equals) {
    throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: --swap '{}' is not PASS=A,B\n  help:     --swap "
                                                "ao=gtao,ray_traced",
                                                arguments.swap)};
  }
  const std::string pass = arguments.swap.substr(0, equals);
  arguments.sort_files();
  const Owned<heddle_host> host = make_host(arguments.host);
  const Owned<heddle_scene> scene = load_scene(host.get(), arguments);
  std::array<Variant, 2> variants;
  variants[0].technique = arguments.swap.substr(equals + 1, comma - equals - 1);
  variants[1].technique = arguments.swap.substr(comma + 1);
  for (Variant& variant : variants) {
    variant.graph = load_graph(host.get(), arguments, {pass + ".technique=" + variant.technique});
    if (!arguments.port.empty()) check(host.get(), heddle_graph_keep(variant.graph.get(), arguments.port.c_str()));
  }
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.time = arguments.time;
  options.seed = arguments.seed;
  options.flags = HEDDLE_RENDER_ANEW;  // a frame that has nothing left to do would be timed as nothing
  const auto render = [&](Variant& variant, bool is_timed) {
    stop_if_asked();
    check(host.get(), heddle_render(variant.graph.get(), scene.get(), &options));
    const char* text = nullptr;
    check(host.get(), heddle_stats(variant.graph.get(), &text));
    if (is_timed) variant.frame_ms.push_back(parse_json(text)["submit_ms"].get<double>());
  };
  // Each first frame compiles; then the variants take turns, A B B A.
  say(arguments.host, fmt::format("rendering {} and {}", variants[0].technique, variants[1].technique));
  for (Variant& variant : variants) render(variant, false);
  for (int repeat = 0; repeat < arguments.repeats; ++repeat) {
    render(variants[repeat % 2 == 0 ? 0 : 1], true);
    render(variants[repeat % 2 == 0 ? 1 : 0], true);
  }
  const std::filesystem::path folder = arguments.folder;
  const bool shows_output = arguments.port.empty();
  for (Variant& variant : variants) {
    stop_if_asked();
    variant.image.struct_size = sizeof variant.image;
    check(host.get(),
          heddle_read(variant.graph.get(), shows_output ? nullptr : arguments.port.c_str(), 0, 0, &variant.image));
    variant.pixels.assign(
        variant.image.pixels,
        variant.image.pixels + std::size_t{variant.image.width} * variant.image.height * variant.image.channels);
    variant.image.pixels = variant.pixels.data();
    const std::filesystem::path file = folder / (pass + "_" + variant.technique + ".png");
    write_port(host.get(), variant.graph.get(), {}, file);
    fmt::print("wrote {}\n", file.string());
    if (!shows_output) {
      const std::filesystem::path port_file = folder / (pass + "_" + variant.technique + "_port.png");
      check(host.get(), heddle_image_write(host.get(), port_file.c_str(), &variant.image));
      fmt::print("wrote {}\n", port_file.string());
    }
  }
  const std::filesystem::path difference = folder / (pass + "_difference.png");
  const char* text = nullptr;
  check(host.get(),
        heddle_image_compare(host.get(), &variants[0].image, &variants[1].image, difference.c_str(), &text));
  fmt::print("wrote {}\n", difference.string());
  const Json metrics = parse_json(text);
  if (arguments.as_json) {
    Json report{{"metrics", metrics}};
    for (const Variant& variant : variants) report["median_frame_ms"][variant.technique] = median(variant.frame_ms);
    fmt::print("{}\n", write_json(report, 2));
  } else {
    fmt::print("{}: {} against {}\n", shows_output ? "output" : arguments.port, variants[0].technique,
               variants[1].technique);
    print_metrics(metrics);
    fmt::print("median frame time of {} interleaved frames each:\n", arguments.repeats);
    for (const Variant& variant : variants) {
      const auto [low, high] = std::minmax_element(variant.frame_ms.begin(), variant.frame_ms.end());
      fmt::print("  {:<16} {:>10.2f} ms   ({:.2f} to {:.2f})\n", variant.technique, median(variant.frame_ms), *low,
                 *high);
    }
  }
  return check_bounds(arguments.bounds, metrics);
}

}  // namespace

void add_compare(CLI::App& app, int* exit_status) {
  CLI::App* command =
      app.add_subcommand("compare", "compare two images, or two techniques of one pass on a scene (--swap)");
  auto arguments = std::make_shared<CompareArguments>();
  arguments->add_to(*command);
  command->add_option("--swap", arguments->swap, "PASS=A,B: render with technique A and B; B is the reference");
  command->add_option("--port", arguments->port, "with --swap: compare this port, PASS.PORT, not the output");
  command->add_option("--folder", arguments->folder, "with --swap: where images go (default: out)");
  command->add_option("--repeats", arguments->repeats, "with --swap: timed frames of each")->check(CLI::Range(1, 1000));
  command->add_option("--difference", arguments->difference, "two images: write |a - b| here");
  command->add_option("--bound", arguments->bounds, "METRIC=NUMBER: exit status 1 if the metric is worse")
      ->take_all()
      ->allow_extra_args(false);
  command->add_flag("--json", arguments->as_json, "numbers as JSON");
  command->callback([arguments, exit_status] {
    *exit_status = arguments->swap.empty() ? compare_files(*arguments) : compare_techniques(*arguments);
  });
}

}  // namespace heddle::cli
