// SPDX-License-Identifier: Apache-2.0
// Metrics of two pictures of 1920 x 1080, and FLIP against its authors' own implementation, which runs in a Python of
// its own and takes turns with ours.
#include "session.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <random>

namespace heddle::bench {
namespace {

struct Pictures {
  std::uint32_t width, height;
  std::vector<float> reference, test;
};

/// Waves with edges and noise, and the same with more noise.
Pictures make_pictures(std::uint32_t width, std::uint32_t height) {
  std::mt19937 random(1);
  const auto noise = [&] { return static_cast<float>(random() >> 8U) / 16777216.0F; };
  Pictures pictures{width, height, {}, {}};
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const float wave = 0.5F + 0.4F * std::sin(0.02F * static_cast<float>(x + 2 * y));
      for (std::uint32_t channel = 0; channel < 3; ++channel) {
        const float value = ((x / 40 + y / 30 + channel) % 3 == 0 ? 1.0F - wave : wave) + 0.1F * (noise() - 0.5F);
        pictures.reference.push_back(std::clamp(value, 0.0F, 1.0F));
        pictures.test.push_back(std::clamp(value + 0.2F * (noise() - 0.5F), 0.0F, 1.0F));
      }
    }
  }
  return pictures;
}

struct Result {
  double ms = 0, mean = 0;
};

/// The authors' implementation in a process that is asked line by line.
class Official {
 public:
  /// Nothing, and a line on stderr, where it is not installed.
  static std::unique_ptr<Official> start(const std::filesystem::path& folder, const Pictures& pictures) {
    auto made = std::unique_ptr<Official>(new Official(folder, pictures));
    char word[16] = "";
    if (std::fscanf(made->answers_, "%15s", word) != 1 || std::string_view(word) != "ready") return nullptr;
    return made;
  }
  ~Official() {
    std::fclose(questions_);
    std::fclose(answers_);
    waitpid(child_, nullptr, 0);
    std::error_code ignored;
    std::filesystem::remove(file_, ignored);
  }
  Official(const Official&) = delete;
  Official& operator=(const Official&) = delete;

  Result evaluate() {
    std::fputs("go\n", questions_);
    std::fflush(questions_);
    Result result;
    if (std::fscanf(answers_, "%lf %lf", &result.ms, &result.mean) != 2)
      throw Error(HEDDLE_FAILED, "the authors' FLIP ended early");
    return result;
  }

 private:
  Official(const std::filesystem::path& folder, const Pictures& pictures) {
    file_ = std::filesystem::temp_directory_path() / fmt::format("heddle-bench-flip-{}", getpid());
    std::ofstream stream(file_, std::ios::binary);
    for (const auto* pixels : {&pictures.reference, &pictures.test})
      stream.write(reinterpret_cast<const char*>(pixels->data()),
                   static_cast<std::streamsize>(pixels->size() * sizeof(float)));
    stream.close();
    const std::string script = (folder / "bench" / "official_flip.py").string();
    const std::string packages = (folder.parent_path().parent_path() / "python").string();
    const std::string width = std::to_string(pictures.width), height = std::to_string(pictures.height);
    int to[2], from[2];
    if (!stream || pipe(to) != 0 || pipe(from) != 0) throw Error(HEDDLE_FAILED, "no pipe, or no room for two pictures");
    child_ = fork();
    if (child_ == 0) {
      dup2(to[0], 0);
      dup2(from[1], 1);
      for (const int end : {to[0], to[1], from[0], from[1]}) close(end);
      execl("/usr/bin/python3", "python3", script.c_str(), packages.c_str(), file_.c_str(), width.c_str(),
            height.c_str(), nullptr);
      _exit(127);
    }
    close(to[0]);
    close(from[1]);
    questions_ = fdopen(to[1], "w");
    answers_ = fdopen(from[0], "r");
  }

  std::filesystem::path file_;
  pid_t child_ = 0;
  std::FILE *questions_ = nullptr, *answers_ = nullptr;
};

Result evaluate(const Pictures& pictures, const char* metric) {
  const auto image = [&](const std::vector<float>& pixels) {
    return heddle_image{sizeof(heddle_image), pictures.width, pictures.height, 3, pixels.data()};
  };
  const heddle_image a = image(pictures.test), b = image(pictures.reference);
  heddle_compare_options options{};
  options.struct_size = sizeof options;
  options.metrics = metric;
  options.start_exposure = -1;  // of hdr_flip
  options.stop_exposure = 1;
  options.exposure_count = 2;
  heddle_comparison* made = nullptr;
  const double start = now_ms();
  if (heddle_compare(&a, &b, &options, &made) != HEDDLE_OK) throw Error(HEDDLE_FAILED, heddle_error(nullptr));
  Result result{now_ms() - start, 0};
  result.mean = parse_json(heddle_comparison_describe(made))["metrics"][metric]["value"].get<double>();
  heddle_comparison_destroy(made);
  return result;
}

}  // namespace

void measure_compare(Session& session) {
  const bool is_small = session.options().is_small;
  const Pictures pictures = is_small ? make_pictures(33, 21) : make_pictures(1920, 1080);
  const int runs = session.runs(10);
  Report& report = session.report;
  const std::unique_ptr<Official> official = Official::start(session.folder(), pictures);
  std::vector<double> ours, theirs;
  for (int run = -1; run < runs; ++run) {  // the first does not count
    std::optional<Result> other;
    if (official && run % 2 == 0) other = official->evaluate();
    const Result own = evaluate(pictures, "flip");
    if (official && run % 2 != 0) other = official->evaluate();
    if (other && std::abs(own.mean - other->mean) > 1e-4)
      throw Error(HEDDLE_BUG, fmt::format("FLIP is {} here and {} by its authors", own.mean, other->mean));
    if (run < 0) continue;
    ours.push_back(own.ms);
    if (other) theirs.push_back(other->ms);
  }
  if (official) {
    report.add_measured("compare.flip_ratio", "1", ratios(ours, theirs), 0.5);
    report.add_measured("compare.official_flip", "ms", theirs);
  }
  report.add_measured("compare.flip", "ms", ours);
  for (const char* metric : {"hdr_flip", "ssim", "rmse"}) {
    std::vector<double> times;
    for (int run = 0; run < runs; ++run) times.push_back(evaluate(pictures, metric).ms);
    report.add_measured(fmt::format("compare.{}", metric), "ms", times);
  }
  report.add_number("compare.pixels", "1", static_cast<double>(pictures.width) * pictures.height);
}

}  // namespace heddle::bench
