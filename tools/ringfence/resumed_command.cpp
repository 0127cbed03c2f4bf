#include "resumed_command.hpp"

#include <algorithm>
#include <array>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "ringfence/error.hpp"
#include "usage_message.hpp"

namespace ringfence::tools {
namespace {

constexpr std::array input_files{"--scene", "--motion", "--cert", "--key", "--token-key", "--page"};
/// They belong to one process, or to frames that are over.
constexpr std::array not_resumed{"--journal", "--collisions", "--json",    "--frames-csv",     "--status",
                                 "--trace",   "--picture",    "--queries", "--answers",        "--fail",
                                 "--resize",  "--link",       "--check",   "--picture-colors", "--quiet"};

/// The name of an option on the command line; empty for a value.
std::string name_of_option(const std::string& text) {
  return text.starts_with("--") ? text.substr(0, text.find('=')) : std::string();
}

template <class Names>
bool contains(const Names& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// Removes the options with these names, each with the values that follow it.
template <class Names>
void remove(std::vector<std::string>& arguments, const Names& names) {
  bool removing = false;
  std::erase_if(arguments, [&](const std::string& text) {
    const std::string name = name_of_option(text);
    removing = name.empty() ? removing : contains(names, name);
    return removing;
  });
}

}  // namespace

std::string describe_run(const std::string& command, const std::vector<std::string>& given) {
  std::vector<std::string> arguments = given;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string name = name_of_option(arguments[i]);
    if (!contains(input_files, name)) continue;
    const std::size_t equals = arguments[i].find('=');
    if (equals != std::string::npos) {
      arguments[i] = fmt::format("{}={}", name, std::filesystem::absolute(arguments[i].substr(equals + 1)).string());
    } else if (i + 1 < arguments.size()) {
      arguments[i + 1] = std::filesystem::absolute(arguments[i + 1]);
    }
  }
  return nlohmann::json{{"command", command}, {"arguments", arguments}}.dump(-1, ' ', false,
                                                                             nlohmann::json::error_handler_t::replace);
}

std::vector<std::string> options_of_run(std::vector<std::string> given, const std::string& directory) {
  remove(given, std::array{"--accept-release"});
  if (const auto found = std::find(given.begin(), given.end(), directory); found != given.end()) given.erase(found);
  return given;
}

std::vector<std::string> command_of(const std::string& description, const std::vector<std::string>& replaced) {
  std::vector<std::string> arguments;
  std::string command;
  try {
    const nlohmann::json json = nlohmann::json::parse(description);
    command = json.at("command").get<std::string>();
    arguments = json.at("arguments").get<std::vector<std::string>>();
  } catch (const nlohmann::json::exception&) {
    command.clear();
  }
  if (command != "run" && command != "replay" && command != "serve") {
    throw Error(
        "the journal was not written by ringfence run, replay or serve: continue it with the program that wrote it, by "
        "JournalReader::restore");
  }
  remove(arguments, not_resumed);
  std::vector<std::string> names;
  for (const std::string& text : replaced) {
    if (const std::string name = name_of_option(text); !name.empty()) names.push_back(name);
  }
  remove(arguments, names);
  arguments.insert(arguments.end(), replaced.begin(), replaced.end());
  arguments.insert(arguments.begin(), command);
  return arguments;
}

CommandLine parse_command(const std::vector<std::string>& arguments) {
  std::vector<std::string> texts = arguments;
  texts.insert(texts.begin(), "ringfence");
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  CommandLineParser parser;
  try {
    return parser.parse(static_cast<int>(pointers.size()), pointers.data());
  } catch (const CLI::ParseError& error) {
    throw Error(fmt::format("the options of the run and those given do not fit together: {}",
                            usage_message(parser.app(), error)));
  }
}

}  // namespace ringfence::tools
