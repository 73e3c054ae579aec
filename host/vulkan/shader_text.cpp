// SPDX-License-Identifier: Apache-2.0
// GLSL text -> tokens, file-scope names, signatures, includes and misplaced brackets, without preprocessing: both sides
// of a conditional are read, so a name is known whichever side is compiled.
#include "vulkan/shader_text.hpp"

#include <algorithm>
#include <array>
#include <cctype>

#include <fmt/format.h>

namespace heddle::vulkan::shader {
namespace {

bool is_name_start(char c) {
  return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_';
}
bool is_name_part(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}
bool is_digit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}

// Cuts the text into tokens and directives; comments and white space vanish.
class Lexer {
 public:
  Lexer(std::string_view text, Scan& out) : text_(text), out_(out) {}

  void run() {
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '\n') {
        newline();
      } else if (continues_line()) {
        at_ += text_[at_ + 1] == '\r' ? 3 : 2;
        ++line_;
      } else if (std::isspace(static_cast<unsigned char>(c)) != 0) {
        ++at_;
      } else if (starts_with("//")) {
        skip_line_comment();
      } else if (starts_with("/*")) {
        skip_block_comment();
      } else if (c == '#' && is_line_start_) {
        directive();
      } else {
        is_line_start_ = false;
        token();
      }
    }
  }

 private:
  [[nodiscard]] bool starts_with(std::string_view what) const { return text_.substr(at_).starts_with(what); }
  [[nodiscard]] bool continues_line() const { return starts_with("\\\n") || starts_with("\\\r\n"); }

  void newline() {
    ++at_;
    ++line_;
    is_line_start_ = true;
    directive_ = -1;
  }

  void skip_line_comment() {
    while (at_ < text_.size() && text_[at_] != '\n') {
      if (continues_line()) {
        ++line_;
        at_ += text_[at_ + 1] == '\r' ? 2 : 1;
      }
      ++at_;
    }
  }

  void skip_block_comment() {
    const std::uint32_t opened = line_;
    const std::size_t end = text_.find("*/", at_ + 2);
    const std::size_t stop = end == std::string_view::npos ? text_.size() : end + 2;
    line_ += static_cast<std::uint32_t>(std::count(text_.begin() + static_cast<std::ptrdiff_t>(at_),
                                                   text_.begin() + static_cast<std::ptrdiff_t>(stop), '\n'));
    at_ = stop;
    if (end == std::string_view::npos) {
      out_.problems.push_back({opened, "a comment is never closed", "/*", "*/", ""});
    }
  }

  void skip_blanks() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t')) {
      ++at_;
    }
  }

  std::string_view name() {
    const std::size_t begin = at_;
    while (at_ < text_.size() && is_name_part(text_[at_])) {
      ++at_;
    }
    return text_.substr(begin, at_ - begin);
  }

  void directive() {
    is_line_start_ = false;
    ++at_;
    skip_blanks();
    const std::string_view what = name();
    out_.directives.push_back({what, line_});
    directive_ = static_cast<int>(out_.directives.size()) - 1;
    if (what != "include") {
      return;
    }
    skip_blanks();
    if (at_ < text_.size() && (text_[at_] == '"' || text_[at_] == '<')) {
      const char close = text_[at_] == '"' ? '"' : '>';
      const std::size_t begin = at_;
      const std::size_t end = text_.find_first_of(close == '"' ? "\"\n" : ">\n", begin + 1);
      if (end != std::string_view::npos && text_[end] == close) {
        out_.includes.push_back(
            {std::string(text_.substr(begin + 1, end - begin - 1)), close == '>', line_, begin, end + 1 - begin});
        at_ = end + 1;
      } else {
        at_ = end == std::string_view::npos ? text_.size() : end;
      }
    }
  }

  void token() {
    const std::size_t begin = at_;
    TokenKind kind = TokenKind::kPunctuation;
    if (is_name_start(text_[at_])) {
      name();
      kind = TokenKind::kIdentifier;
    } else if (is_digit(text_[at_]) || (text_[at_] == '.' && at_ + 1 < text_.size() && is_digit(text_[at_ + 1]))) {
      kind = TokenKind::kNumber;
      bool is_hexadecimal = starts_with("0x") || starts_with("0X");
      while (at_ < text_.size()) {
        const char c = text_[at_];
        const bool is_sign = (c == '+' || c == '-') && at_ > begin && !is_hexadecimal &&
                             (text_[at_ - 1] == 'e' || text_[at_ - 1] == 'E');
        if (!is_name_part(c) && c != '.' && !is_sign) {
          break;
        }
        ++at_;
      }
    } else {
      ++at_;
    }
    out_.tokens.push_back({kind, text_.substr(begin, at_ - begin), begin, line_, directive_});
  }

  std::string_view text_;
  Scan& out_;
  std::size_t at_ = 0;
  std::uint32_t line_ = 1;
  bool is_line_start_ = true;
  int directive_ = -1;
};

constexpr std::array kQualifiers = {
    std::string_view("const"),     std::string_view("in"),        std::string_view("out"),
    std::string_view("inout"),     std::string_view("precise"),   std::string_view("highp"),
    std::string_view("mediump"),   std::string_view("lowp"),      std::string_view("shared"),
    std::string_view("uniform"),   std::string_view("buffer"),    std::string_view("readonly"),
    std::string_view("writeonly"), std::string_view("coherent"),  std::string_view("volatile"),
    std::string_view("restrict"),  std::string_view("flat"),      std::string_view("smooth"),
    std::string_view("centroid"),  std::string_view("invariant"), std::string_view("noperspective"),
    std::string_view("sample"),    std::string_view("patch")};
bool is_qualifier(std::string_view text) {
  return std::find(kQualifiers.begin(), kQualifiers.end(), text) != kQualifiers.end();
}

using Tokens = std::vector<const Token*>;

std::string spelled(const Tokens& tokens, std::size_t begin, std::size_t end) {
  std::string out;
  for (std::size_t i = begin; i < end; ++i) {
    const std::string_view text = tokens[i]->text;
    const bool is_tight = text == "," || text == ")" || text == "(" || text == "[" || text == "]" || text == ";";
    const bool after_tight = out.ends_with('(') || out.ends_with('[');
    if (!out.empty() && !is_tight && !after_tight) {
      out += ' ';
    }
    out += text;
  }
  return out;
}

// Index of the bracket that closes the one at `open`, or tokens.size().
std::size_t closing(const Tokens& tokens, std::size_t open) {
  int depth = 0;
  for (std::size_t i = open; i < tokens.size(); ++i) {
    const std::string_view text = tokens[i]->text;
    if (text == "(" || text == "[" || text == "{") {
      ++depth;
    } else if (text == ")" || text == "]" || text == "}") {
      if (--depth == 0) {
        return i;
      }
    }
  }
  return tokens.size();
}

// Tokens between the parentheses of a function, at `open`.
void read_parameters(const Tokens& tokens, std::size_t open, std::size_t close, FunctionText& out) {
  std::size_t at = open + 1;
  while (at < close) {
    std::string type;
    std::string name;
    std::string array;
    int depth = 0;
    for (; at < close && (depth > 0 || tokens[at]->text != ","); ++at) {
      const std::string_view text = tokens[at]->text;
      if (text == "[" || depth > 0) {
        depth += text == "[" ? 1 : text == "]" ? -1 : 0;
        array += text;
      } else if (text == "out" || text == "inout") {
        type = std::string(text) + " " + type;
      } else if (is_qualifier(text)) {
        continue;
      } else if (type.empty() || type.ends_with(' ')) {
        type += text;
      } else {
        name = text;
      }
    }
    ++at;
    if (type + array != "void") {
      out.parameter_types.push_back(type + array);
      out.parameter_names.push_back(name);
    }
  }
}

// One statement at file scope, `begin` .. `end` (exclusive), ended by ';' or by a body.
void read_statement(const Tokens& tokens, std::size_t begin, std::size_t end, Scan& out) {
  std::size_t at = begin;
  const auto text_at = [&](std::size_t i) { return i < end ? tokens[i]->text : std::string_view(); };
  const auto is_name = [&](std::size_t i) { return i < end && tokens[i]->kind == TokenKind::kIdentifier; };
  const auto skip_qualifiers = [&] {
    while (at < end && (is_qualifier(text_at(at)) || text_at(at) == "layout")) {
      at = text_at(at) == "layout" && text_at(at + 1) == "(" ? std::min(end, closing(tokens, at + 1) + 1) : at + 1;
    }
  };
  // A macro's call at file scope, "DECLARE(x)", stands before what follows.
  while (is_name(at) && !is_qualifier(text_at(at)) && text_at(at) != "layout" && text_at(at + 1) == "(" &&
         closing(tokens, at + 1) + 1 < end) {
    at = closing(tokens, at + 1) + 1;
  }
  skip_qualifiers();
  if (text_at(at) == "precision" || at >= end) {
    return;
  }
  const std::size_t type_begin = at;
  if (text_at(at) == "struct") {
    ++at;
    if (is_name(at)) {
      out.names.emplace(text_at(at));
      ++at;
    }
    if (text_at(at) == "{") {
      at = std::min(end, closing(tokens, at) + 1);
    }
  } else if (is_name(at)) {
    ++at;
    if (text_at(at) == "{") {  // a block: its members are in scope
      const std::size_t close = std::min(end, closing(tokens, at));
      for (std::size_t i = at + 1; i < close; ++i) {
        const bool ends_declarator = text_at(i + 1) == ";" || text_at(i + 1) == "," || text_at(i + 1) == "[";
        if (is_name(i) && ends_declarator && is_name(i - 1)) {
          out.names.emplace(text_at(i));
        }
      }
      out.names.emplace(text_at(at - 1));
      at = close + 1;
    }
  } else {
    return;
  }
  while (text_at(at) == "[") {
    at = std::min(end, closing(tokens, at) + 1);
  }
  if (!is_name(at)) {
    return;
  }
  if (text_at(at + 1) == "(") {
    FunctionText function;
    function.name = text_at(at);
    function.return_type = spelled(tokens, type_begin, at);
    function.line = tokens[at]->line;
    const std::size_t close = std::min(end, closing(tokens, at + 1));
    read_parameters(tokens, at + 1, close, function);
    function.signature = spelled(tokens, type_begin, std::min(end, close + 1));
    function.is_definition = text_at(close + 1) == "{";
    out.names.emplace(function.name);
    out.functions.push_back(std::move(function));
    return;
  }
  // Declarators: a name, then anything up to the next comma outside brackets.
  while (is_name(at)) {
    out.names.emplace(text_at(at));
    ++at;
    while (at < end && text_at(at) != ",") {
      const std::string_view text = text_at(at);
      at = text == "(" || text == "[" || text == "{" ? std::min(end, closing(tokens, at) + 1) : at + 1;
    }
    ++at;
  }
}

void read_statements(const Tokens& tokens, Scan& out) {
  std::size_t begin = 0;
  bool has_initializer = false;
  bool is_struct = false;
  bool is_function = false;
  for (std::size_t at = 0; at < tokens.size(); ++at) {
    const std::string_view text = tokens[at]->text;
    if (text == ";") {
      read_statement(tokens, begin, at, out);
      begin = at + 1;
      has_initializer = is_struct = is_function = false;
    } else if (text == "=") {
      has_initializer = true;
    } else if (text == "struct") {
      is_struct = true;
    } else if (text == "(" || text == "[") {
      is_function = is_function || text == "(";
      at = closing(tokens, at);
    } else if (text == "{") {
      const std::size_t close = closing(tokens, at);
      if (is_function && !has_initializer && !is_struct && tokens[at - 1]->text == ")") {
        read_statement(tokens, begin, std::min(close + 1, tokens.size()), out);
        begin = close + 1;
        is_function = false;
      }
      at = close;
    } else if (text == "}" || text == ")" || text == "]") {
      begin = at + 1;  // unbalanced: reported elsewhere
    }
  }
}

// Tokens of the first branch of every conditional and of all text outside: balanced if the file is.
Tokens one_branch(const Scan& scan) {
  Tokens out;
  std::vector<bool> is_taken;  // for each open conditional: is this its first branch
  std::size_t directive = 0;
  const auto step = [&](const Directive& what) {
    if (what.name == "if" || what.name == "ifdef" || what.name == "ifndef") {
      is_taken.push_back(true);
    } else if ((what.name == "else" || what.name == "elif") && !is_taken.empty()) {
      is_taken.back() = false;
    } else if (what.name == "endif" && !is_taken.empty()) {
      is_taken.pop_back();
    }
  };
  for (const Token& token : scan.tokens) {
    while (directive < scan.directives.size() && scan.directives[directive].line <= token.line) {
      step(scan.directives[directive]);
      ++directive;
    }
    if (token.directive < 0 && std::find(is_taken.begin(), is_taken.end(), false) == is_taken.end()) {
      out.push_back(&token);
    }
  }
  return out;
}

void check_balance(Scan& scan) {
  std::vector<const Directive*> open_conditionals;
  for (const Directive& directive : scan.directives) {
    if (directive.name == "if" || directive.name == "ifdef" || directive.name == "ifndef") {
      open_conditionals.push_back(&directive);
    } else if (directive.name == "endif" || directive.name == "else" || directive.name == "elif") {
      if (open_conditionals.empty()) {
        scan.problems.push_back({directive.line, fmt::format("#{} without #if", directive.name), "", "", ""});
      } else if (directive.name == "endif") {
        open_conditionals.pop_back();
      }
    }
  }
  for (const Directive* directive : open_conditionals) {
    scan.problems.push_back({directive->line, fmt::format("#{} has no #endif", directive->name), "", "", ""});
  }
  if (!scan.problems.empty()) {
    return;  // brackets cannot be told before the conditionals are right
  }
  std::vector<const Token*> open;
  for (const Token* token : one_branch(scan)) {
    const std::string_view text = token->text;
    if (text == "(" || text == "[" || text == "{") {
      open.push_back(token);
    } else if (text == ")" || text == "]" || text == "}") {
      const std::string_view partner = text == ")" ? "(" : text == "]" ? "[" : "{";
      if (open.empty()) {
        scan.problems.push_back({token->line, fmt::format("'{}' closes nothing", text), "", "", ""});
        return;
      }
      if (open.back()->text != partner) {
        scan.problems.push_back(
            {token->line,
             fmt::format("'{}' does not close the '{}' of line {}", text, open.back()->text, open.back()->line), "", "",
             ""});
        return;
      }
      open.pop_back();
    }
  }
  if (!open.empty()) {
    scan.problems.push_back({open.back()->line, fmt::format("'{}' is never closed", open.back()->text), "", "", ""});
  }
}

// Names in the branches that one_branch leaves out, read as if they stood alone.
void read_other_branches(Scan& scan) {
  Tokens branch;
  std::vector<bool> is_first;
  std::size_t directive = 0;
  int depth = 0;
  const auto flush = [&] {
    if (depth == 0) {
      read_statements(branch, scan);
    }
    branch.clear();
    depth = 0;
  };
  for (const Token& token : scan.tokens) {
    while (directive < scan.directives.size() && scan.directives[directive].line <= token.line) {
      const std::string_view name = scan.directives[directive].name;
      if (name == "if" || name == "ifdef" || name == "ifndef") {
        is_first.push_back(true);
      } else if ((name == "else" || name == "elif") && !is_first.empty()) {
        flush();
        is_first.back() = false;
      } else if (name == "endif" && !is_first.empty()) {
        flush();
        is_first.pop_back();
      }
      ++directive;
    }
    if (token.directive < 0 && std::find(is_first.begin(), is_first.end(), false) != is_first.end()) {
      depth += token.text == "{" ? 1 : token.text == "}" ? -1 : 0;
      branch.push_back(&token);
    }
  }
  flush();
}

// Reserved words of GLSL 4.60 (specification, section 3.6) that people choose as names of ports and parameters.
constexpr std::array kReserved = {
    std::string_view("active"),     std::string_view("asm"),       std::string_view("attribute"),
    std::string_view("bool"),       std::string_view("break"),     std::string_view("buffer"),
    std::string_view("case"),       std::string_view("cast"),      std::string_view("centroid"),
    std::string_view("class"),      std::string_view("coherent"),  std::string_view("common"),
    std::string_view("const"),      std::string_view("continue"),  std::string_view("default"),
    std::string_view("discard"),    std::string_view("do"),        std::string_view("double"),
    std::string_view("else"),       std::string_view("enum"),      std::string_view("extern"),
    std::string_view("external"),   std::string_view("false"),     std::string_view("filter"),
    std::string_view("fixed"),      std::string_view("flat"),      std::string_view("float"),
    std::string_view("for"),        std::string_view("goto"),      std::string_view("half"),
    std::string_view("highp"),      std::string_view("if"),        std::string_view("in"),
    std::string_view("inline"),     std::string_view("inout"),     std::string_view("input"),
    std::string_view("int"),        std::string_view("interface"), std::string_view("invariant"),
    std::string_view("layout"),     std::string_view("long"),      std::string_view("lowp"),
    std::string_view("mediump"),    std::string_view("namespace"), std::string_view("noinline"),
    std::string_view("out"),        std::string_view("output"),    std::string_view("partition"),
    std::string_view("patch"),      std::string_view("precise"),   std::string_view("precision"),
    std::string_view("public"),     std::string_view("readonly"),  std::string_view("resource"),
    std::string_view("restrict"),   std::string_view("return"),    std::string_view("sample"),
    std::string_view("shared"),     std::string_view("short"),     std::string_view("sizeof"),
    std::string_view("smooth"),     std::string_view("static"),    std::string_view("struct"),
    std::string_view("subroutine"), std::string_view("superp"),    std::string_view("switch"),
    std::string_view("template"),   std::string_view("this"),      std::string_view("true"),
    std::string_view("typedef"),    std::string_view("uint"),      std::string_view("uniform"),
    std::string_view("union"),      std::string_view("unsigned"),  std::string_view("using"),
    std::string_view("varying"),    std::string_view("void"),      std::string_view("volatile"),
    std::string_view("while"),      std::string_view("writeonly")};

}  // namespace

Scan scan(std::string_view text) {
  Scan out;
  Lexer(text, out).run();
  for (std::size_t i = 0; i < out.tokens.size(); ++i) {
    const Token& token = out.tokens[i];
    const bool is_first = i == 0 || out.tokens[i - 1].directive != token.directive;
    if (token.directive >= 0 && is_first &&
        out.directives[static_cast<std::size_t>(token.directive)].name == "define") {
      out.names.emplace(token.text);
    }
  }
  check_balance(out);
  if (out.problems.empty()) {
    read_statements(one_branch(out), out);
    read_other_branches(out);
  }
  return out;
}

FunctionText parse_signature(std::string_view signature) {
  const std::string text = std::string(signature) + ";";
  const Scan facts = scan(text);
  return facts.functions.empty() ? FunctionText{} : facts.functions.front();
}

std::string rename(std::string_view text, const Scan& facts, const std::set<std::string, std::less<>>& names,
                   std::string_view suffix) {
  std::string out;
  out.reserve(text.size() + text.size() / 8);
  std::size_t copied = 0;
  int braces = 0;
  int brackets = 0;
  std::vector<int> struct_braces;  // depth of braces at which a struct's body is open
  bool awaits_struct_body = false;
  const std::vector<Token>& tokens = facts.tokens;
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    const Token& token = tokens[i];
    if (token.directive < 0) {
      if (token.text == "struct") {
        awaits_struct_body = true;
      } else if (token.text == "{") {
        ++braces;
        if (awaits_struct_body) {
          struct_braces.push_back(braces);
          awaits_struct_body = false;
        }
      } else if (token.text == "}") {
        if (!struct_braces.empty() && struct_braces.back() == braces) {
          struct_braces.pop_back();
        }
        --braces;
      } else if (token.text == "[") {
        ++brackets;
      } else if (token.text == "]") {
        --brackets;
      } else if (token.text == ";" || token.text == "(") {
        awaits_struct_body = false;
      }
    }
    if (token.kind != TokenKind::kIdentifier || !names.contains(token.text)) {
      continue;
    }
    if (i > 0 && tokens[i - 1].text == "." && tokens[i - 1].directive == token.directive) {
      continue;
    }
    const std::string_view next = i + 1 < tokens.size() ? tokens[i + 1].text : std::string_view();
    const bool is_declarator = next == ";" || next == "," || next == "[";
    if (!struct_braces.empty() && brackets == 0 && is_declarator && token.directive < 0 &&
        !(next == "[" && i > 0 && (tokens[i - 1].text == ";" || tokens[i - 1].text == "{"))) {
      continue;
    }
    const std::size_t end = token.offset + token.text.size();
    out += text.substr(copied, end - copied);
    out += suffix;
    copied = end;
  }
  out += text.substr(copied);
  return out;
}

std::vector<Member> block_members(std::string_view members) {
  const std::string text(members);
  Scan facts;
  Lexer(text, facts).run();
  std::vector<Member> out;
  const std::vector<Token>& tokens = facts.tokens;
  int brackets = 0;
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    brackets += tokens[i].text == "[" ? 1 : tokens[i].text == "]" ? -1 : 0;
    const std::string_view next = i + 1 < tokens.size() ? tokens[i + 1].text : std::string_view();
    const bool is_first = i == 0 || tokens[i - 1].text == ";";
    if (tokens[i].kind == TokenKind::kIdentifier && brackets == 0 && !is_first &&
        (next == ";" || next == "," || next == "[")) {
      out.push_back({std::string(tokens[i].text), next == "[" && i + 2 < tokens.size() && tokens[i + 2].text == "]"});
    }
  }
  return out;
}

std::string glsl_name(std::string_view name) {
  const bool is_reserved = std::find(kReserved.begin(), kReserved.end(), name) != kReserved.end();
  return is_reserved ? std::string(name) + "_" : std::string(name);
}

}  // namespace heddle::vulkan::shader
