// SPDX-License-Identifier: Apache-2.0
// heddle completion: scripts that let a shell ask `heddle complete` at every tab.

#include "cli/completion.hpp"

#include "cli/session.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

namespace heddle::cli {

namespace {

// The answer's first line has the words "files" (names of files suit too) and "nospace" (the word goes on); then a
// candidate a line, behind a tab what it is.

constexpr std::string_view kBash = R"(# bash completion for heddle:  source <(heddle completion bash)
_heddle() {
  # COMP_WORDS is cut at = and :, so the line is read again; as in the shell, a backslash keeps a space.
  local line=${COMP_LINE:0:COMP_POINT} words answer candidate cut
  read -a words <<<"$line"
  [[ $line == *[[:space:]] ]] && words+=("")
  local current=${words[-1]}
  mapfile -t answer < <(command "${words[0]/#\~/$HOME}" complete "${words[@]:1}" 2>/dev/null)
  # readline replaces only what follows the last break.
  local breaks=${COMP_WORDBREAKS//[^=:]/}
  [[ -n $breaks && $current == *[$breaks]* ]] && cut=${current%"${current##*[$breaks]}"}
  COMPREPLY=()
  for candidate in "${answer[@]:1}"; do
    candidate=${candidate%%$'\t'*}
    COMPREPLY+=("${candidate#"$cut"}")
  done
  [[ ${answer[0]} == *nospace* ]] && compopt -o nospace 2>/dev/null
  if [[ ${answer[0]} == *files* ]]; then
    compopt -o filenames 2>/dev/null
    local file
    while IFS= read -r file; do COMPREPLY+=("$file"); done < <(compgen -f -- "${current##*=}")
  fi
}
complete -F _heddle heddle
)";

constexpr std::string_view kZsh = R"(#compdef heddle
# zsh completion for heddle:  source <(heddle completion zsh), after compinit
_heddle() {
  local -a answer candidates
  answer=("${(@f)$(command ${~words[1]} complete "${(@)words[2,CURRENT-1]}" "$PREFIX" 2>/dev/null)}")
  candidates=("${(@)${(@)answer[2,-1]}%%$'\t'*}")
  candidates=(${candidates:#})
  if [[ $answer[1] == *nospace* ]]; then
    (( $#candidates )) && compadd -Q -S '' -a candidates
  else
    (( $#candidates )) && compadd -Q -a candidates
  fi
  if [[ $answer[1] == *files* ]]; then
    compset -P '*='
    _files
  fi
  return 0
}
compdef _heddle heddle
)";

constexpr std::string_view kFish = R"(# fish completion for heddle:  heddle completion fish | source
function __heddle_complete
    set -l words (commandline -opc)
    set -l current (commandline -ct)
    set -l answer (command $words[1] complete $words[2..-1] "$current" 2>/dev/null)
    test (count $answer) -gt 1; and printf '%s\n' $answer[2..-1]
    if string match -q '*files*' -- "$answer[1]"
        set -l port (string match -r '^.*=' -- "$current")
        for file in (__fish_complete_path (string replace -r '^.*=' '' -- "$current"))
            echo "$port$file"
        end
    end
end
complete -c heddle -f -a '(__heddle_complete)'
)";

}  // namespace

void add_completion(CLI::App& app, int* exit_status) {
  CLI::App* command = app.add_subcommand(
      "completion",
      "print a shell's completion script: source <(heddle completion bash); zsh; heddle completion fish | source");
  auto shell = std::make_shared<std::string>();
  command->add_option("shell", *shell, "bash, zsh or fish")->required()->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->callback([shell, exit_status] {
    fmt::print("{}", *shell == "bash" ? kBash : *shell == "zsh" ? kZsh : kFish);
    *exit_status = HEDDLE_OK;
  });
}

}  // namespace heddle::cli
