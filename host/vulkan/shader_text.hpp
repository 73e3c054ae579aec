// SPDX-License-Identifier: Apache-2.0
// GLSL text -> tokens, and what the host must know of a file before it is compiled: names at file scope, signatures of
// functions, includes, and mistakes that the compiler would report in somebody else's file. Knows no role and no pass.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace heddle::vulkan::shader {

enum class TokenKind : std::uint8_t { kIdentifier, kNumber, kPunctuation };

struct Token {
  TokenKind kind = TokenKind::kPunctuation;
  std::string_view text;
  std::size_t offset = 0;
  std::uint32_t line = 1;
  int directive = -1;  // index into Scan::directives; -1: ordinary text
};

struct Directive {
  std::string_view name;  // "include", "define", "if"; "" for a lone '#'
  std::uint32_t line = 1;
};

struct Include {
  std::string name;
  bool is_angle = false;  // <name>
  std::uint32_t line = 1;
  std::size_t offset = 0;  // of the quote or bracket
  std::size_t length = 0;  // both quotes included
};

/// A mistake that is told better from the text than by the compiler.
struct Problem {
  std::uint32_t line = 1;
  std::string message, found, expected, help;
};

struct FunctionText {
  std::string name;
  std::string return_type;
  std::vector<std::string>
      parameter_types;  // with in/out qualifier other than `in`, and array sizes: "out vec3", "float[4]"
  std::vector<std::string> parameter_names;
  std::string signature;  // as written, white space made single
  std::uint32_t line = 1;
  bool is_definition = false;
};

/// What one file says. Views point into the text that was given.
struct Scan {
  std::vector<Token> tokens;
  std::vector<Directive> directives;
  std::vector<Include> includes;
  std::set<std::string, std::less<>> names;  // at file scope: functions, globals, structs, macros
  std::vector<FunctionText> functions;
  std::vector<Problem> problems;  // unbalanced brackets and conditionals, open comments
};
Scan scan(std::string_view text);

/// The signature of one function, e.g. of a role.toml; name is "" if the text is none.
FunctionText parse_signature(std::string_view signature);

/// The text with `suffix` behind each of `names`, except where a name is a member of a struct: after a dot, or declared
/// in a struct's body. Lines stay what they are.
std::string rename(std::string_view text, const Scan& scan, const std::set<std::string, std::less<>>& names,
                   std::string_view suffix);

/// Declared members of a block: "HeddleLight lights[]; uint count;" -> lights (unsized), count.
struct Member {
  std::string name;
  bool is_unsized_array = false;
};
std::vector<Member> block_members(std::string_view members);

/// `name`, or `name_` where GLSL reserves the word ("precision", "sample").
std::string glsl_name(std::string_view name);

}  // namespace heddle::vulkan::shader
