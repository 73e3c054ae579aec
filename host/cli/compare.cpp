// SPDX-License-Identifier: Apache-2.0
// heddle compare: two image files, or one graph with two techniques of a role: images, difference, numbers, times.

#include "cli/session.hpp"
#include "cli/stop.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

namespace heddle::cli {

namespace {

struct CompareArguments : RenderArguments {
  std::string swap;  // "ao=gtao,ray_traced"
  std::string port;  // what is compared; empty: the output
  std::string folder = "out";
  std::string difference;  // image mode
  std::vector<std::string> metrics;
  std::string error_image, error_metric;
  std::vector<double> exposures;  // start, stop, count
  double pixels_per_degree = 0;
  std::string tone_mapper = "aces";
  std::vector<std::string> bounds;
  int repeats = 3;
  bool as_json = false;
};

struct DestroyComparison {
  void operator()(heddle_comparison* comparison) const { heddle_comparison_destroy(comparison); }
};
using Comparison = std::unique_ptr<heddle_comparison, DestroyComparison>;

/// heddle_compare's message is this thread's, not a host's.
void check_hostless(heddle_status status) {
  if (status != HEDDLE_OK) throw Failure{status, heddle_error(nullptr)};
}

constexpr std::string_view kUsualMetrics =
    "mse,rmse,relmse,psnr,ssim,mean_difference,maximum,percentile_50,percentile_95,percentile_99";

/// Names, separated by commas: those of --metric, and those that --bound and --error-image need.
std::string metric_names(const CompareArguments& arguments, std::string_view by_default) {
  std::string names;
  const auto add = [&](std::string_view name) {
    if (("," + names + ",").find(fmt::format(",{},", name)) != std::string::npos) return;
    names += names.empty() ? "" : ",";
    names += name;
  };
  for (const std::string& metric : arguments.metrics) add(metric);
  if (arguments.metrics.empty()) names = by_default;
  for (const std::string& bound : arguments.bounds) add(std::string_view(bound).substr(0, bound.find('=')));
  if (!arguments.error_image.empty()) add(arguments.error_metric);
  return names;
}

Comparison compare_images(const CompareArguments& arguments, const heddle_image& a, const heddle_image& b,
                          std::string_view by_default) {
  const std::string names = metric_names(arguments, by_default);
  heddle_compare_options options{};
  options.struct_size = sizeof options;
  options.flags = arguments.error_image.empty() ? 0U : HEDDLE_COMPARE_MAPS;
  options.metrics = names.c_str();
  options.pixels_per_degree = arguments.pixels_per_degree;
  if (!arguments.exposures.empty()) {
    if (!(arguments.exposures[2] >= 1 && arguments.exposures[2] <= 1000)) {
      throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: --exposures START STOP COUNT\n  found:    a count of {:g}\n"
                                                  "  expected: 1 to 1000",
                                                  arguments.exposures[2])};
    }
    options.start_exposure = arguments.exposures[0];
    options.stop_exposure = arguments.exposures[1];
    options.exposure_count = static_cast<std::uint32_t>(arguments.exposures[2]);
  }
  options.tone_mapper = arguments.tone_mapper == "aces"    ? HEDDLE_TONE_MAPPER_ACES
                        : arguments.tone_mapper == "hable" ? HEDDLE_TONE_MAPPER_HABLE
                                                           : HEDDLE_TONE_MAPPER_REINHARD;
  heddle_comparison* made = nullptr;
  check_hostless(heddle_compare(&a, &b, &options, &made));
  return Comparison(made);
}

double brightest(const heddle_image& map) {
  const std::size_t count = std::size_t{map.width} * map.height * map.channels;
  float largest = 0;
  for (std::size_t i = 0; i < count; ++i) largest = std::max(largest, std::abs(map.pixels[i]));
  return largest;
}

void write_error_image(const CompareArguments& arguments, heddle_host* host, const heddle_comparison* comparison) {
  if (arguments.error_image.empty()) return;
  heddle_image map{};
  map.struct_size = sizeof map;
  check_hostless(heddle_comparison_map(comparison, arguments.error_metric.c_str(), &map));
  const bool has_own_scale =
      arguments.error_metric == "flip" || arguments.error_metric == "hdr_flip" || arguments.error_metric == "ssim";
  const double white = has_own_scale ? 1.0 : brightest(map);
  check(host, heddle_write_error_image(host, arguments.error_image.c_str(), &map, white));
  say(arguments.host, fmt::format("wrote {}: {}, white in a file of 8 bits is {:.6g}", arguments.error_image,
                                  arguments.error_metric, white));
}

void print_metrics(const Json& metrics) {
  for (const auto& [name, metric] : metrics.items()) {
    const Json& value = metric.at("value");
    const std::string text = value.is_number() ? fmt::format("{:.6g}", value.get<double>()) : "infinite";
    std::string formula = metric.at("formula").get<std::string>();
    if (metric.contains("pixels_per_degree"))
      formula += fmt::format("; {:.5g} pixels per degree", metric["pixels_per_degree"].get<double>());
    if (metric.contains("exposures"))
      formula += fmt::format("; {} exposures, {:.4g} to {:.4g} stops, {}", metric["exposures"].get<int>(),
                             metric["start_exposure"].get<double>(), metric["stop_exposure"].get<double>(),
                             metric["tone_mapper"].get<std::string>());
    if (metric.contains("pixel"))
      formula += fmt::format("; at x {}, y {}, channel {}", metric["pixel"][0].get<int>(),
                             metric["pixel"][1].get<int>(), metric["channel"].get<int>());
    fmt::print("  {:<16} {:>12}   {}\n", name, text, formula);
  }
}

using Bounds = std::vector<std::pair<std::string, double>>;

/// "rmse=0.01", read before anything is compared.
Bounds read_bounds(const std::vector<std::string>& texts) {
  Bounds bounds;
  bounds.reserve(texts.size());
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    char* end = nullptr;
    const double limit = equals == std::string::npos ? 0 : std::strtod(text.c_str() + equals + 1, &end);
    if (end == nullptr || *end != '\0' || end == text.c_str() + equals + 1 || !std::isfinite(limit)) {
      throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: --bound '{}' is not METRIC=NUMBER", text)};
    }
    bounds.emplace_back(text.substr(0, equals), limit);
  }
  return bounds;
}

/// Exits 1 if a metric is above (psnr and ssim: below) its bound.
int check_bounds(const Bounds& bounds, const Json& metrics) {
  int status = HEDDLE_OK;
  for (const auto& [name, limit] : bounds) {
    const Json& metric = metrics.at(name);
    if (!metric.at("value").is_number()) continue;  // psnr of equal images is infinite
    const double value = metric.at("value").get<double>();
    const bool is_within = metric.at("better") == "higher" ? value >= limit : std::abs(value) <= limit;
    if (!is_within) {
      fmt::print(stderr, "bound exceeded: {} is {:.6g}, the bound is {:.6g}\n", name, value, limit);
      status = 1;
    }
  }
  return status;
}

/// Files of floats hold linear radiance, others values encoded as sRGB: which FLIP fits.
std::string metrics_for(const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension().string();
  const bool is_linear = extension == ".exr" || extension == ".hdr" || extension == ".pfm";
  return fmt::format("{},{}", kUsualMetrics, is_linear ? "hdr_flip" : "flip");
}

int compare_files(CompareArguments& arguments) {
  if (arguments.files.size() != 2) {
    throw Failure{HEDDLE_BAD_INPUT,
                  fmt::format("error: compare takes two images, or --swap PASS=A,B with a graph and a "
                              "scene\n  found:    {} files",
                              arguments.files.size())};
  }
  const Bounds bounds = read_bounds(arguments.bounds);
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
  const Comparison comparison = compare_images(arguments, a, b, metrics_for(arguments.files[1]));
  const Json report = parse_json(heddle_comparison_describe(comparison.get()));
  if (!arguments.difference.empty()) {
    const char* text = nullptr;
    check(host.get(), heddle_image_compare(host.get(), &a, &b, arguments.difference.c_str(), &text));
  }
  write_error_image(arguments, host.get(), comparison.get());
  if (arguments.as_json) {
    fmt::print("{}\n", write_json(report, 2));
  } else {
    fmt::print("{} against {}\n", arguments.files[0], arguments.files[1]);
    print_metrics(report["metrics"]);
  }
  return check_bounds(bounds, report["metrics"]);
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
  const Bounds bounds = read_bounds(arguments.bounds);
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
  const Comparison comparison = compare_images(arguments, variants[0].image, variants[1].image, kUsualMetrics);
  write_error_image(arguments, host.get(), comparison.get());
  Json report = parse_json(heddle_comparison_describe(comparison.get()));
  const Json metrics = report["metrics"];
  if (arguments.as_json) {
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
  return check_bounds(bounds, metrics);
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
  command
      ->add_option("--metric", arguments->metrics,
                   "only this one, repeatable: mse, rmse, relmse, psnr, ssim, mean_difference, maximum, percentile_P, "
                   "differing_pixels, flip (values encoded as sRGB), hdr_flip (linear values)")
      ->take_all()
      ->allow_extra_args(false);
  command->add_option("--error-image", arguments->error_image,
                      "write an error image: numbers into .exr, .hdr, .pfm, else false colours from black to white");
  command->add_option("--error-metric", arguments->error_metric,
                      "whose error image (default: the first --metric, else maximum: |a-b|)");
  command
      ->add_option("--exposures", arguments->exposures,
                   "of hdr_flip: START STOP COUNT in stops (default: from the reference, Andersson et al. 2021)")
      ->expected(3);
  command->add_option("--tone-mapper", arguments->tone_mapper, "of hdr_flip (default: aces)")
      ->check(CLI::IsMember({"aces", "hable", "reinhard"}));
  command->add_option("--pixels-per-degree", arguments->pixels_per_degree, "of flip and hdr_flip (default: 67.02)");
  command->add_option("--bound", arguments->bounds, "METRIC=NUMBER: exit status 1 if the metric is worse")
      ->take_all()
      ->allow_extra_args(false);
  command->add_flag("--json", arguments->as_json, "numbers as JSON");
  command->callback([arguments, exit_status] {
    if (arguments->error_metric.empty())
      arguments->error_metric = arguments->metrics.empty() ? "maximum" : arguments->metrics.front();
    *exit_status = arguments->swap.empty() ? compare_files(*arguments) : compare_techniques(*arguments);
  });
}

}  // namespace heddle::cli
