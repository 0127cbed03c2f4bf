#include "option_texts.hpp"

#include <algorithm>
#include <array>
#include <sstream>
#include <utility>

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

constexpr std::size_t help_width = 118;

/// The type name is "N" or "N:0 to 1024", where the second part is the valid range.
std::string range_text(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t colon = type.find(':');
  constexpr std::array names_with_colon{"HH:MM", "A:B", "FRAME:", "HOST:PORT"};
  const bool is_name = std::ranges::any_of(names_with_colon, [&](const char* name) { return type.starts_with(name); });
  return colon == std::string::npos || is_name ? "" : type.substr(colon + 1);
}

std::string default_of(const CLI::Option& option) {
  std::string text = option.get_default_str();
  std::erase_if(text, [](char c) { return c == '[' || c == ']'; });  // around a list
  return text;
}

std::string wrapped(const std::string& text, std::size_t width) {
  std::istringstream words(text);
  std::string lines, word;
  std::size_t length = 0;
  while (words >> word) {
    if (length > 0 && length + 1 + word.size() > width) {
      lines += '\n';
      length = 0;
    } else if (length > 0) {
      lines += ' ';
      ++length;
    }
    lines += word;
    length += word.size();
  }
  return lines;
}

}  // namespace

std::string placeholder_of(const CLI::Option& option) {
  if (option.get_type_size() == 0) return "";
  const std::string range = range_text(option);
  const std::string type = option.get_type_name();
  return range.empty() ? type : type.substr(0, type.size() - range.size() - 1);
}

std::string description_of(const CLI::Option& option) {
  std::vector<std::string> notes;
  if (option.get_type_size() != 0 && option.get_required()) notes.emplace_back("required");
  if (option.get_type_size() != 0 && !range_text(option).empty()) notes.push_back(range_text(option));
  if (option.get_type_size() != 0 && !default_of(option).empty()) notes.push_back("default " + default_of(option));
  std::vector<std::string> excluded;
  for (const CLI::Option* other : option.get_excludes()) excluded.push_back(other->get_name());
  std::sort(excluded.begin(), excluded.end());
  if (!excluded.empty()) notes.push_back(fmt::format("not with {}", fmt::join(excluded, ", ")));
  const std::string& text = option.get_description();
  return notes.empty() ? text : fmt::format("{} ({})", text, fmt::join(notes, "; "));
}

std::vector<std::string> words_of(const CLI::Option& option) {
  if (!placeholder_of(option).starts_with("WORD")) return {};
  const std::string& text = option.get_description();
  const std::size_t colon = text.rfind(": ");
  if (colon == std::string::npos) return {};
  std::vector<std::string> words;
  std::istringstream list(text.substr(colon + 2));
  for (std::string word; std::getline(list >> std::ws, word, ',');) words.push_back(word);
  return words;
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<const CLI::Option*> options_of(const CLI::App& command, const std::string& group) {
  return command.get_options(
      [&group](const CLI::Option* option) { return option->nonpositional() && option->get_group() == group; });
}

std::string HelpFormatter::make_group(std::string group, bool is_positional,
                                      std::vector<const CLI::Option*> options) const {
  std::string text = group + ":\n";
  for (const CLI::Option* option : options) text += make_option(option, is_positional);
  return is_positional ? text + "\n" : text;
}

std::string HelpFormatter::make_usage(const CLI::App* app, std::string name) const {
  return CLI::Formatter::make_usage(app, std::move(name)) + "\n";
}

std::string HelpFormatter::make_subcommand(const CLI::App* command) const {
  std::stringstream out;
  CLI::detail::format_help(out, command->get_name(),
                           wrapped(command->get_description(), help_width - get_column_width()), get_column_width());
  return out.str();
}

std::string HelpFormatter::make_option_opts(const CLI::Option* option) const {
  const std::string placeholder = option->get_positional() ? "" : placeholder_of(*option);
  return placeholder.empty() ? "" : " " + placeholder;
}

std::string HelpFormatter::make_option_desc(const CLI::Option* option) const {
  return wrapped(description_of(*option), help_width - get_column_width());
}

}  // namespace ringfence::tools
