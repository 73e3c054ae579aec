// SPDX-License-Identifier: Apache-2.0
#include "view/script.hpp"

#include "diagnostics.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

namespace heddle::view {

namespace {

using Kind = ScriptLine::Kind;

struct Command {
  std::string_view word, usage;
  Kind kind;
  bool has_name;
  std::size_t fewest, most;  // numbers
};

constexpr std::array<Command, 10> kCommands{{
    {"wait", "wait: until everything is rendered", Kind::kWait, false, 0, 0},
    {"pause", "pause SECONDS", Kind::kPause, false, 1, 1},
    {"click", "click WIDGET", Kind::kClick, true, 0, 0},
    {"slide", "slide WIDGET PART, from 0 to 1", Kind::kSlide, true, 1, 1},
    {"type", "type WIDGET TEXT", Kind::kType, true, 0, 0},
    {"key", "key KEY [SECONDS]", Kind::kKey, true, 0, 1},
    {"drag", "drag X Y X Y, in pixels of the picture", Kind::kDrag, false, 4, 4},
    {"screenshot", "screenshot FILE", Kind::kScreenshot, true, 0, 0},
    {"state", "state: what is shown, and where, as JSON on standard output", Kind::kState, false, 0, 0},
    {"quit", "quit", Kind::kQuit, false, 0, 0},
}};

[[noreturn]] void fail(const std::filesystem::path& file, int line, std::string message, std::string found,
                       std::string expected, std::string help = {}) {
  throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                           {file.string(), static_cast<std::uint32_t>(line), line > 0 ? 1U : 0U},
                                           std::move(message),
                                           std::move(found),
                                           std::move(expected),
                                           std::move(help)});
}

}  // namespace

std::vector<ScriptLine> read_script(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) fail(file, 0, "the script cannot be read", "", "a file of commands");
  std::vector<ScriptLine> lines;
  std::string text;
  for (int number = 1; std::getline(stream, text); ++number) {
    std::istringstream words(text.substr(0, text.find('#')));
    std::string word;
    if (!(words >> word)) continue;
    const Command* command = nullptr;
    std::vector<std::string> known;
    for (const Command& candidate : kCommands) {
      known.emplace_back(candidate.word);
      if (candidate.word == word) command = &candidate;
    }
    if (command == nullptr) {
      const std::string near = nearest_name(word, known);
      fail(file, number, "this is no command of a script", word, "one of " + join_names(known),
           near.empty() ? "" : fmt::format("did you mean '{}'?", near));
    }
    ScriptLine line;
    line.kind = command->kind;
    line.line = number;
    bool is_right = !command->has_name || static_cast<bool>(words >> line.name);
    if (command->kind == Kind::kType) {
      std::getline(words >> std::ws, line.text);
      while (!line.text.empty() && (line.text.back() == ' ' || line.text.back() == '\r')) line.text.pop_back();
      is_right = is_right && !line.text.empty();
    } else {
      while (words >> word) {
        double value = 0;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
        is_right = is_right && error == std::errc() && end == word.data() + word.size() && std::isfinite(value);
        line.numbers.push_back(value);
      }
    }
    is_right = is_right && line.numbers.size() >= command->fewest && line.numbers.size() <= command->most;
    if (line.kind == Kind::kSlide && is_right) is_right = line.numbers[0] >= 0 && line.numbers[0] <= 1;
    if ((line.kind == Kind::kPause || line.kind == Kind::kKey) && is_right && !line.numbers.empty())
      is_right = line.numbers[0] >= 0 && line.numbers[0] <= 3600;
    if (!is_right)
      fail(file, number, fmt::format("'{}' is written otherwise", command->word), text, std::string(command->usage));
    lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace heddle::view
