#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace ringfence::tools {

/// A validator that accepts values in [low, high]. Its message states the range. It refuses NaN.
template <class T>
CLI::Validator between(T low, T high) {
  return {[low, high](std::string& text) {
            T value{};
            // The parser converts -1 to the largest unsigned number.
            const bool negative = std::is_unsigned_v<T> && text.starts_with('-');
            const bool right = !negative && CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
            return right ? std::string() : fmt::format("found {}; expected {} to {}", text, low, high);
          },
          fmt::format("{} to {}", low, high)};
}

template <class Value, std::size_t count>
std::map<std::string, Value> by_name(const Value (&values)[count]) {
  std::map<std::string, Value> names;
  for (const Value value : values) names.emplace(name_of(value), value);
  return names;
}

template <class Value, std::size_t count>
std::string list_names(const Value (&values)[count]) {
  std::string words;
  for (const Value each : values) words += fmt::format("{}{}", words.empty() ? "" : ", ", name_of(each));
  return words;
}

/// Adds an option whose value is one of `values`, given by its name.
template <class Value, std::size_t count>
void add_choice(CLI::App& command, const char* option, Value& value, const Value (&values)[count], const char* help) {
  const auto names = by_name(values);
  const std::string words = list_names(values);
  const auto read = [names, words, &value, option](const std::string& text) {
    const auto found = names.find(text);
    if (found == names.end()) {
      throw CLI::ValidationError(option, fmt::format("found {}; expected one of {}", text, words));
    }
    value = found->second;
  };
  command.add_option_function<std::string>(option, read, fmt::format("{}: {}", help, words))
      ->default_str(name_of(value))
      ->type_name("WORD");
}

/// Adds an option whose value is one of `words`, without a default.
inline CLI::Option* add_word(CLI::App& command, const char* option, std::string& value,
                             const std::vector<std::string>& words, const char* help) {
  const auto read = [words, &value, option](const std::string& text) {
    if (std::find(words.begin(), words.end(), text) == words.end()) {
      throw CLI::ValidationError(option, fmt::format("found {}; expected one of {}", text, fmt::join(words, ", ")));
    }
    value = text;
  };
  return command.add_option_function<std::string>(option, read, fmt::format("{}: {}", help, fmt::join(words, ", ")))
      ->type_name("WORD");
}

/// Adds an option whose value is `on` or `off`.
inline void add_switch(CLI::App& command, const char* option, bool& value, const char* help) {
  const auto read = [&value, option](const std::string& text) {
    if (text != "on" && text != "off") {
      throw CLI::ValidationError(option, fmt::format("found {}; expected one of on, off", text));
    }
    value = text == "on";
  };
  command.add_option_function<std::string>(option, read, fmt::format("{}: on, off", help))
      ->default_str(value ? "on" : "off")
      ->type_name("WORD");
}

/// Adds an option whose value is a comma-separated list of names from `values`.
template <class Value, std::size_t count>
void add_choice_list(CLI::App& command, const char* option, std::vector<Value>& list, const Value (&values)[count],
                     const char* help) {
  const auto names = by_name(values);
  const std::string words = list_names(values);
  const auto read = [names, words, &list, option](const std::vector<std::string>& texts) {
    list.clear();
    for (const std::string& text : texts) {
      const auto found = names.find(text);
      if (found == names.end()) {
        throw CLI::ValidationError(option, fmt::format("found {}; expected some of {}", text, words));
      }
      list.push_back(found->second);
    }
  };
  std::string given;
  for (const Value each : list) given += fmt::format("{}{}", given.empty() ? "" : ",", name_of(each));
  command.add_option_function<std::vector<std::string>>(option, read, fmt::format("{}: {}", help, words))
      ->delimiter(',')
      ->default_str(given)
      ->type_name("WORD,...");
}

}  // namespace ringfence::tools
