// SPDX-License-Identifier: Apache-2.0
// What the mouse and the keys do, from a file: a line a command, words between blanks, # begins a comment. Reads it
// whole before anything happens.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace heddle::view {

struct ScriptLine {
  enum class Kind { kWait, kPause, kClick, kSlide, kType, kKey, kDrag, kScreenshot, kState, kQuit };
  Kind kind = Kind::kWait;
  std::string name;             // of a widget or a key; a file of kScreenshot
  std::string text;             // of kType
  std::vector<double> numbers;  // seconds; a part of a slider; x y x y of kDrag in pixels of the picture
  int line = 0;
};

/// Throws heddle::Error with file and line for what is no command.
std::vector<ScriptLine> read_script(const std::filesystem::path& file);

}  // namespace heddle::view
