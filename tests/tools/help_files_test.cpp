// The manual page and the bash completion agree with what the program prints for --help.
#include <algorithm>
#include <cctype>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "tools/program.hpp"
#include "worlds/text_file.hpp"

namespace ringfence {
namespace {

using worlds::read_text;

const std::vector<std::string> commands{"run",     "replay", "record",  "scale", "profile", "node",
                                        "convert", "resume", "journal", "serve", "token",   "robots"};

/// The long options that the help of a command lists.
std::set<std::string> options_in_help(const std::string& command) {
  const std::string help = test::ringfence(command + " --help").out;
  const std::regex option(R"((^|\n)  (-h,)?(--[a-z-]+))");
  std::set<std::string> options;
  for (std::sregex_iterator each(help.begin(), help.end(), option), end; each != end; ++each) {
    options.insert((*each)[3].str());
  }
  return options;
}

/// What the completion offers for a command line whose last word is incomplete.
std::set<std::string> completed(const std::vector<std::string>& line) {
  std::string words;
  for (const std::string& word : line) words += " '" + word + "'";
  const std::string script =
      std::string("source ") + RINGFENCE_BASH_COMPLETION + "; compopt() { COMPREPLY=(FILES); }; COMP_WORDS=(" + words +
      "); COMP_CWORD=" + std::to_string(line.size() - 1) + "; _ringfence; printf \"%s\\n\" \"${COMPREPLY[@]}\"";
  const test::ProgramResult result =
      test::run_shell("bash -c '" + std::regex_replace(script, std::regex("'"), "'\\''") + "' 2>&1");
  REQUIRE_MESSAGE(result.code == 0, result.out);
  std::istringstream lines(result.out);
  std::set<std::string> offered;
  for (std::string text; std::getline(lines, text);) {
    if (!text.empty()) offered.insert(text);
  }
  return offered;
}

/// The page as a reader sees it, without the commands and escapes of roff.
std::string section_of_manual(const std::string& command) {
  std::string page = read_text(RINGFENCE_MAN_PAGE);
  page = std::regex_replace(page, std::regex(R"(\\f[BIR])"), "");
  page = std::regex_replace(page, std::regex(R"(\\-)"), "-");
  const std::size_t begin = page.find(".SS ringfence " + command + "\n");
  REQUIRE(begin != std::string::npos);
  return page.substr(begin, std::min(page.find("\n.SS", begin + 1), page.find("\n.SH", begin + 1)) - begin);
}

}  // namespace

TEST_CASE("the manual page has each option of each command, with its description and no other option") {
  for (const std::string& command : commands) {
    CAPTURE(command);
    const std::set<std::string> expected = options_in_help(command);
    REQUIRE(expected.size() >= 4);
    const std::string section = section_of_manual(command);
    const std::regex entry(R"(\n\.TP\n(-h, )?(--[a-z-]+)( [^\n]+)?\n[^\n.]+)");
    std::set<std::string> found;
    for (std::sregex_iterator each(section.begin(), section.end(), entry), end; each != end; ++each) {
      found.insert((*each)[2].str());
    }
    CHECK(found == expected);
  }
  CHECK(section_of_manual("run").find("number of objects, avatars included (1 to 10000000; default 4000)") !=
        std::string::npos);
}

TEST_CASE("the manual page has the exit codes and what signals do") {
  const std::string page = read_text(RINGFENCE_MAN_PAGE);
  CHECK(page.starts_with(".TH RINGFENCE 1"));
  CHECK(page.find(".SH EXIT STATUS\n.TP\n\\fB0\\fR\ndone\n") != std::string::npos);
  CHECK(page.find("\\fB3\\fR\nnot complete: ended by SIGINT or SIGTERM") != std::string::npos);
  CHECK(page.find(".SH SIGNALS\n") != std::string::npos);
}

TEST_CASE("the completion offers each command, and each option of a command") {
  const std::set<std::string> offered = completed({"ringfence", ""});
  for (const std::string& command : commands) CHECK_MESSAGE(offered.contains(command), command);
  CHECK(completed({"ringfence", "re"}) == std::set<std::string>{"record", "replay", "resume"});
  for (const std::string& command : commands) {
    CAPTURE(command);
    CHECK(completed({"ringfence", command, "--"}) == options_in_help(command));
  }
}

TEST_CASE("the completion offers the words of an option, also after = and after a comma") {
  const std::set<std::string> deployments{"user", "user-collision", "user-server"};
  CHECK(completed({"ringfence", "run", "--deployment", ""}) == deployments);
  CHECK(completed({"ringfence", "run", "--deployment", "="}) == deployments);
  CHECK(completed({"ringfence", "run", "--deployment", "=", "user-c"}) == std::set<std::string>{"user-collision"});
  CHECK(completed({"ringfence", "scale", "--broad-phase", "server,re"}) == std::set<std::string>{"server,region"});
  CHECK(completed({"ringfence", "run", "--balance", "o"}) == std::set<std::string>{"on", "off"});
  CHECK(completed({"ringfence", "scale", "--model", ""}) == std::set<std::string>{"2004", "today"});
  CHECK(completed({"ringfence", "convert", "a"}) == std::set<std::string>{"air"});
}

TEST_CASE("the completion offers file names where an option takes a path, and nothing for a number") {
  CHECK(completed({"ringfence", "replay", "--scene", ""}) == std::set<std::string>{"FILES"});
  CHECK(completed({"ringfence", "record", "--out", "a"}) == std::set<std::string>{"FILES"});
  CHECK(completed({"ringfence", "run", "--nodes", ""}).empty());
}

}  // namespace ringfence
