#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace ringfence::tools {

/// Texts of an option, made from what the parser knows of it. Help, manual page and completion use the same.

/// What stands for the value: "N", "FILE"; empty for a flag.
std::string placeholder_of(const CLI::Option& option);

/// The description with the valid range, the default, and the options that exclude it, for example "number of CD nodes
/// (0 to 1024; default 1)".
std::string description_of(const CLI::Option& option);

/// The words that the option accepts, if it accepts only some: what add_choice, add_word and add_switch were given.
std::vector<std::string> words_of(const CLI::Option& option);

/// The commands of `app`, in the order of their definition.
std::vector<const CLI::App*> commands_of(const CLI::App& app);

/// The options of a command that belong to a group of option_groups.hpp, without positionals, in the order of their
/// definition.
std::vector<const CLI::Option*> options_of(const CLI::App& command, const std::string& group);

/// Help in groups. Descriptions are wrapped.
class HelpFormatter : public CLI::Formatter {
 public:
  HelpFormatter() { column_width(34); }
  std::string make_group(std::string group, bool is_positional, std::vector<const CLI::Option*> options) const override;
  std::string make_usage(const CLI::App* app, std::string name) const override;
  std::string make_subcommand(const CLI::App* command) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
};

}  // namespace ringfence::tools
