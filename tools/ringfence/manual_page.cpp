#include "manual_page.hpp"

#include <string_view>

#include <fmt/format.h>

#include "exit_code.hpp"
#include "option_groups.hpp"
#include "option_texts.hpp"

namespace ringfence::tools {
namespace {

/// Escapes what is special in a line of roff. A hyphen is printed as the ASCII character, so that options can be
/// copied.
std::string escaped(std::string_view text) {
  std::string line;
  if (text.starts_with('.') || text.starts_with('\'')) line = "\\&";
  for (const char c : text) {
    if (c == '\\') {
      line += "\\e";
    } else if (c == '-') {
      line += "\\-";
    } else {
      line += c;
    }
  }
  return line;
}

/// Names of an option with its placeholder: "-h, --help" or "--nodes N".
std::string heading_of(const CLI::Option& option) {
  if (option.get_positional() && !option.nonpositional()) return fmt::format("\\fI{}\\fR", escaped(option.get_name()));
  std::string names;
  for (const std::string& name : option.get_snames()) names += fmt::format("\\fB\\-{}\\fR, ", escaped(name));
  for (const std::string& name : option.get_lnames()) names += fmt::format("\\fB\\-\\-{}\\fR", escaped(name));
  const std::string placeholder = placeholder_of(option);
  return placeholder.empty() ? names : fmt::format("{} \\fI{}\\fR", names, escaped(placeholder));
}

std::string entry(const std::string& heading, const std::string& text) {
  return fmt::format(".TP\n{}\n{}\n", heading, escaped(text));
}

std::vector<const CLI::Option*> positionals_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) { return option->get_positional(); });
}

std::string synopsis_of(const CLI::App& command) {
  std::string line = fmt::format("\\fBringfence {}\\fR [\\fIOPTION\\fR]...", escaped(command.get_name()));
  for (const CLI::Option* option : positionals_of(command)) line += ' ' + heading_of(*option);
  return line;
}

std::string section_of(const CLI::App& command) {
  std::string text =
      fmt::format(".SS ringfence {}\n{}.\n", escaped(command.get_name()), escaped(command.get_description()));
  for (const CLI::Option* option : positionals_of(command)) text += entry(heading_of(*option), description_of(*option));
  for (const char* group : option_groups::all) {
    const std::vector<const CLI::Option*> options = options_of(command, group);
    if (options.empty()) continue;
    text += fmt::format(".PP\n\\fI{}\\fR\n", group);
    for (const CLI::Option* option : options) text += entry(heading_of(*option), description_of(*option));
  }
  return text;
}

constexpr const char* description = R"(.SH DESCRIPTION
Ringfence finds the collisions of a multiplayer world. A server, collision detection (CD) nodes and user nodes run each
frame together. The contacts do not depend on the number of nodes, nor on the regions, the threads or the machine.
.PP
The program generates a world or reads a recorded one, runs it, and reports times, contacts and a digest of all
contacts.
)";

constexpr const char* ending = R"(.SH SIGNALS
SIGINT and SIGTERM end a run after the frame in which they arrive. The report and all files are complete for the frames
before, and the exit code is 3. A second signal ends the process at once.
.B ringfence node
hands everything over to other nodes and ends with 0.
.SH EXAMPLES
.TP
\fBringfence run \-\-objects 4000 \-\-nodes 2 \-\-check\fR
Run a generated world and compare each frame with brute force.
.TP
\fBringfence replay \-\-scene scene.json \-\-motion motion.csv \-\-collisions \-\fR
Run a recorded world and print its contacts as CSV.
.TP
\fBringfence run \-\-nodes 4 \-\-trace t.json\fR
Write a timeline that https://ui.perfetto.dev opens.
)";

}  // namespace

std::string format_manual_page(const CLI::App& app, const std::string& version) {
  std::string page = fmt::format(".TH RINGFENCE 1 \"\" \"ringfence {}\" \"User Commands\"\n", version);
  page += ".SH NAME\nringfence \\- collision service for multiplayer worlds\n.SH SYNOPSIS\n";
  for (const CLI::App* command : commands_of(app)) page += synopsis_of(*command) + "\n.br\n";
  page += description;
  page += ".SH COMMANDS\n";
  for (const CLI::App* command : commands_of(app)) page += section_of(*command);
  page += ".SH OPTIONS WITHOUT A COMMAND\n";
  for (const CLI::Option* option : app.get_options()) page += entry(heading_of(*option), description_of(*option));
  page += ".SH EXIT STATUS\n";
  for (const ExitCodeText& each : exit_codes) {
    page += entry(fmt::format("\\fB{}\\fR", static_cast<int>(each.code)), each.text);
  }
  return page + ending;
}

}  // namespace ringfence::tools
