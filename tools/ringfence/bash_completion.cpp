#include "bash_completion.hpp"

#include <vector>

#include <fmt/format.h>

#include "option_texts.hpp"

namespace ringfence::tools {
namespace {

std::string names_of(const CLI::App& command) {
  std::string names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names += (names.empty() ? "--" : " --") + name;
  }
  return names;
}

bool is_path(const CLI::Option& option) {
  const std::string placeholder = placeholder_of(option);
  return placeholder == "FILE" || placeholder == "PREFIX";
}

/// The case of the options of a command that take a value: words, a path, or a value that cannot be completed.
std::string value_cases(const CLI::App& command) {
  std::string text;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_lnames().empty() || placeholder_of(*option).empty()) continue;
    const std::vector<std::string> words = words_of(*option);
    const std::string action = is_path(*option) ? "compopt -o default"
                               : words.empty()  ? ":"
                                                : fmt::format("_ringfence_words '{}'", fmt::join(words, " "));
    text += fmt::format("    '{} --{}') {}; return ;;\n", command.get_name(), option->get_lnames().front(), action);
  }
  return text;
}

std::string positional_words(const CLI::App& command) {
  std::string all;
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_positional()) continue;
    for (const std::string& word : words_of(*option)) all += ' ' + word;
  }
  return all;
}

bool has_path_argument(const CLI::App& command) {
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional() && is_path(*option)) return true;
  }
  return false;
}

constexpr const char* script_head =
    R"(# Completion of ringfence for bash. Generated from the help of the program: do not edit.

# Completes the last word of a list that commas separate.
_ringfence_words() {
  local before=
  if [[ $current == *,* ]]; then before=${current%,*},; fi
  mapfile -t COMPREPLY < <(compgen -P "$before" -W "$1" -- "${current##*,}")
}

_ringfence() {
  local current=${COMP_WORDS[COMP_CWORD]} option=${COMP_WORDS[COMP_CWORD-1]} command=${COMP_WORDS[1]}
  COMPREPLY=()
  # bash makes three words of --option=value.
  if [[ $current == = ]]; then
    current=
  elif [[ $option == = ]]; then
    option=${COMP_WORDS[COMP_CWORD-2]}
  fi
)";

}  // namespace

std::string format_bash_completion(const CLI::App& app) {
  std::string commands, values, options;
  for (const CLI::App* command : commands_of(app)) {
    commands += command->get_name() + ' ';
    values += value_cases(*command);
    const std::string path = has_path_argument(*command) ? "compopt -o default; " : "";
    options += fmt::format("    '{}') {}_ringfence_words '{}{}' ;;\n", command->get_name(), path, names_of(*command),
                           positional_words(*command));
  }
  std::string script = script_head;
  script += fmt::format("  if [[ $COMP_CWORD -eq 1 ]]; then\n    _ringfence_words '{}{}'\n    return\n  fi\n", commands,
                        names_of(app));
  script += "  case \"$command $option\" in\n" + values + "  esac\n";
  script += "  case $command in\n" + options + "  esac\n}\n\ncomplete -F _ringfence ringfence\n";
  return script;
}

}  // namespace ringfence::tools
