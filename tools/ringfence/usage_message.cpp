#include "usage_message.hpp"

#include <algorithm>
#include <numeric>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "option_texts.hpp"

namespace ringfence::tools {
namespace {

constexpr std::size_t max_typos = 2;  ///< a name with more edits is not what was meant

std::string join_with_or(const std::vector<std::string>& words, std::string_view last_separator = " or ") {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 == words.size() ? last_separator : ", ";
    text += words[i];
  }
  return text;
}

/// The long names of a command's options, with dashes.
std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

/// Number of inserted, deleted, replaced and exchanged neighbouring characters between two words (Damerau 1964, in the
/// variant that edits no character twice).
std::size_t edits_between(std::string_view p, std::string_view q) {
  std::vector<std::size_t> two_back, last, row(q.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= p.size(); ++i) {
    two_back = last;
    last = row;
    row[0] = i;
    for (std::size_t j = 1; j <= q.size(); ++j) {
      const std::size_t replaced = last[j - 1] + (p[i - 1] == q[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, replaced});
      if (i > 1 && j > 1 && p[i - 1] == q[j - 2] && p[i - 2] == q[j - 1])
        row[j] = std::min(row[j], two_back[j - 2] + 1);
    }
  }
  return row.back();
}

/// The word that was most likely meant: the nearest within max_typos, or the only one that begins with `word`. Empty if
/// there is none.
std::string find_meant(const std::string& word, const std::vector<std::string>& words) {
  std::string nearest;
  std::size_t fewest = max_typos + 1;
  std::vector<std::string> longer;
  for (const std::string& each : words) {
    if (const std::size_t edits = edits_between(word, each); edits < fewest) {
      fewest = edits;
      nearest = each;
    }
    if (word.size() > 3 && each.starts_with(word)) longer.push_back(each);
  }
  return nearest.empty() && longer.size() == 1 ? longer.front() : nearest;
}

std::string with_suggestion(std::string text, const std::string& meant) {
  return meant.empty() ? text : fmt::format("{}; did you mean {}?", text, meant);
}

std::string unknown_option(const CLI::App& app, const CLI::App& command, const std::string& option) {
  std::vector<std::string> owners;
  for (const CLI::App* other : commands_of(app)) {
    const std::vector<std::string> names = option_names(*other);
    if (std::find(names.begin(), names.end(), option) != names.end()) owners.push_back(other->get_name());
  }
  const bool of_command = std::find(owners.begin(), owners.end(), command.get_name()) != owners.end();
  if (of_command) return option + ": expected after the command";
  if (!owners.empty() && &command != &app) {
    return fmt::format("{}: not an option of {}; {} {} it", option, command.get_name(), join_with_or(owners, " and "),
                       owners.size() == 1 ? "has" : "have");
  }
  if (!owners.empty())
    return fmt::format("{}: expected after the command, which is one of {}", option, list_commands(app));
  return with_suggestion(option + ": unknown option", find_meant(option, option_names(command)));
}

std::string unexpected_argument(const CLI::App& app, const CLI::App& command) {
  const std::vector<std::string> extras = app.remaining(true);
  if (extras.empty()) return "found more arguments than expected";
  const std::string& word = extras.front();
  if (word.starts_with('-')) return unknown_option(app, command, word.substr(0, word.find('=')));
  if (&command != &app)
    return fmt::format("{}: unexpected argument; options of {} start with --", word, command.get_name());
  std::vector<std::string> names;
  for (const CLI::App* each : commands_of(app)) names.push_back(each->get_name());
  const std::string meant = find_meant(word, names);
  return fmt::format("{}: unknown command; {}", word,
                     meant.empty() ? "expected " + list_commands(app) : fmt::format("did you mean {}?", meant));
}

/// CLI11 reports too few and too many values of an option in one kind of error.
std::string wrong_count(const CLI::App& command, const std::string& what) {
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() > 1 && option->get_items_expected_max() == 1) {
      return fmt::format("{}: given {} times; expected once", option->get_name(), option->count());
    }
  }
  const std::string name = what.substr(0, what.find(':'));
  const CLI::Option* const option = command.get_option_no_throw(name);
  if (option == nullptr) return what;
  const std::vector<std::string> words = words_of(*option);
  return fmt::format("{}: found no value; expected {}", name,
                     words.empty() ? placeholder_of(*option) : join_with_or(words));
}

}  // namespace

std::string list_commands(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : commands_of(app)) names.push_back(command->get_name());
  return join_with_or(names);
}

std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const auto parsed = app.get_subcommands();
  const CLI::App& command = parsed.empty() ? app : *parsed.front();
  const auto kind = static_cast<CLI::ExitCodes>(error.get_exit_code());
  std::string what = error.what();
  // A misspelled option, or a misspelled command, is also reported as a missing one.
  const bool missing = kind == CLI::ExitCodes::RequiredError;
  if (kind == CLI::ExitCodes::ExtrasError || (missing && !app.remaining(true).empty())) {
    return unexpected_argument(app, command);
  }
  if (missing && &command == &app) return "found no command; expected " + list_commands(app);
  if (kind == CLI::ExitCodes::ArgumentMismatch) return wrong_count(command, what);
  constexpr std::string_view excludes = " excludes ";
  if (const std::size_t at = what.find(excludes); kind == CLI::ExitCodes::ExcludesError && at != std::string::npos) {
    return fmt::format("{}: not possible together with {}", what.substr(0, at), what.substr(at + excludes.size()));
  }
  constexpr std::string_view requires_text = " requires ";
  if (const std::size_t at = what.find(requires_text);
      kind == CLI::ExitCodes::RequiresError && at != std::string::npos) {
    return fmt::format("{}: expected {} too", what.substr(0, at), what.substr(at + requires_text.size()));
  }
  return what;
}

}  // namespace ringfence::tools
