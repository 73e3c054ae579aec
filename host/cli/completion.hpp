// SPDX-License-Identifier: Apache-2.0
// heddle complete WORD...: what may stand for the last word. Asked by the scripts of `heddle completion`.
#pragma once

#include <CLI/App.hpp>

#include <string>
#include <vector>

namespace heddle::cli {

/// Prints the answer: a line with the words "files" and "nospace", or neither, then a candidate a line with, behind a
/// tab, what it is. `words`: of the line, without the command's name; the last one is being written. What is wrong in
/// the line gives fewer candidates, never a message.
void complete(const CLI::App& app, const std::vector<std::string>& words);

}  // namespace heddle::cli
