// SPDX-License-Identifier: Apache-2.0
// The C API of heddle.h on top of the host: comparing images. Needs no host, device or library that is opened late.

#include "api.hpp"

#include "compare/compare.hpp"

#include <fmt/format.h>

using namespace heddle::api;
using heddle::Error;

struct heddle_comparison {
  heddle::compare::Comparison result;
};

namespace {

heddle::compare::Picture picture_of(const heddle_image* image, std::string_view name) {
  const auto given = take(image, name);
  if (given.pixels == nullptr) throw Error(HEDDLE_BUG, fmt::format("{}.pixels is NULL", name));
  return {given.width,
          given.height,
          given.channels,
          {given.pixels, std::size_t{given.width} * given.height * given.channels}};
}

heddle::compare::Options options_of(const heddle_compare_options* options) {
  heddle::compare::Options wanted;
  if (options == nullptr) return wanted;
  const auto given = take(options, "options");
  std::string_view names = given.metrics != nullptr ? given.metrics : "";
  while (!names.empty()) {
    const std::size_t end = std::min(names.find(','), names.size());
    wanted.metrics.emplace_back(names.substr(0, end));
    names.remove_prefix(std::min(end + 1, names.size()));
  }
  if (given.pixels_per_degree != 0) wanted.pixels_per_degree = given.pixels_per_degree;
  if (given.exposure_count != 0) {
    wanted.exposures = heddle::compare::Exposures{given.start_exposure, given.stop_exposure, given.exposure_count};
  }
  wanted.tone_mapper = static_cast<heddle::compare::ToneMapper>(given.tone_mapper);
  wanted.threads = given.threads;
  wanted.keeps_maps = (given.flags & HEDDLE_COMPARE_MAPS) != 0;
  return wanted;
}

heddle_image as_image(const heddle::image::Image& image) {
  return {sizeof(heddle_image), image.width, image.height, image.channels, image.pixels.data()};
}

}  // namespace

const char* heddle_metrics(void) {
  return heddle::compare::metrics_json().c_str();
}

heddle_status heddle_compare(const heddle_image* a, const heddle_image* b, const heddle_compare_options* options,
                             heddle_comparison** out) {
  *out = nullptr;
  return guarded(hostless_error(), [&] {
    auto made = std::make_unique<heddle_comparison>();
    made->result = heddle::compare::compare(picture_of(a, "image a"), picture_of(b, "image b (the reference)"),
                                            options_of(options));
    *out = made.release();
  });
}

void heddle_comparison_destroy(heddle_comparison* comparison) {
  delete comparison;
}

const char* heddle_comparison_describe(const heddle_comparison* comparison) {
  return comparison->result.json.c_str();
}

heddle_status heddle_comparison_map(const heddle_comparison* comparison, const char* metric, heddle_image* out) {
  return guarded(hostless_error(), [&] {
    const auto& maps = comparison->result.maps;
    const auto found = maps.find(metric);
    if (found == maps.end()) {
      std::vector<std::string> names;
      names.reserve(maps.size());
      for (const auto& [name, map] : maps) names.push_back(name);
      throw Error(HEDDLE_BAD_INPUT,
                  heddle::Diagnostic{heddle::Severity::kError,
                                     {},
                                     fmt::format("the comparison kept no error image of metric '{}'", metric),
                                     "",
                                     names.empty() ? "HEDDLE_COMPARE_MAPS among the flags of heddle_compare"
                                                   : fmt::format("one of {}", heddle::join_names(names)),
                                     ""});
    }
    *out = as_image(found->second);
  });
}

heddle_status heddle_write_error_image(heddle_host* host, const char* path, const heddle_image* map, double white) {
  return guarded(host->error, [&] {
    const auto given = picture_of(map, "map");
    heddle::image::Image image{given.width, given.height, given.channels, {given.pixels.begin(), given.pixels.end()}};
    const std::string extension = std::filesystem::path(path).extension().string();
    const bool keeps_floats = extension == ".exr" || extension == ".hdr" || extension == ".pfm";
    heddle::image::write(path, keeps_floats ? image : heddle::compare::false_colors(image, white));
  });
}
