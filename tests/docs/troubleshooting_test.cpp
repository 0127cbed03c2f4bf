// The messages that docs/troubleshooting.md explains are those of the sources, and it has every status.
#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <regex>
#include <string>
#include <string_view>
#include <vector>

#include <doctest/doctest.h>

#include "docs/pages.hpp"
#include "ringfence/status.hpp"

namespace ringfence::docs {
namespace {

/// All sources of the library and the program as one text, in which adjacent string literals are joined.
std::string read_sources() {
  std::string text;
  for (const char* folder : {"engine", "tools/ringfence"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      if (entry.path().extension() == ".cpp" || entry.path().extension() == ".hpp") {
        text += read_file(entry.path());
      }
    }
  }
  return std::regex_replace(std::regex_replace(text, std::regex(R"(\\")"), "\""), std::regex(R"("\s*\n\s*")"), "");
}

// The first column of a table has messages in backticks; "…" stands for what varies.
TEST_CASE("every message on the page of troubleshooting is in the sources") {
  const std::string sources = read_sources();
  const std::regex quoted(R"(`([^`]+)`)");
  int parts = 0;
  for (const std::string& line : lines_of(read_file(root / "docs/troubleshooting.md"))) {
    const std::string cell = line.starts_with("| `") ? line.substr(0, line.find(" | ")) : "";
    for (const std::smatch& match :
         std::vector<std::smatch>(std::sregex_iterator(cell.begin(), cell.end(), quoted), {})) {
      std::string rest = match[1];
      while (!rest.empty()) {
        const std::size_t end = std::min(rest.find("…"), rest.size());
        const std::string part(trimmed(std::string_view(rest).substr(0, end)));
        rest.erase(0, end + std::string_view("…").size());
        if (part.size() >= 4) {
          ++parts;
          CHECK_MESSAGE(sources.find(part) != sources.npos,
                        "docs/troubleshooting.md has \"" << part << "\", which no source has");
        }
      }
    }
  }
  CHECK(parts > 60);
}

TEST_CASE("the page of troubleshooting has every status") {
  const std::string page = read_file(root / "docs/troubleshooting.md");
  for (std::size_t i = 1; i < status_count; ++i) {
    const std::string name = name_of(static_cast<Status>(i));
    CHECK_MESSAGE(page.find("`" + name + "`") != page.npos, name << " is missing");
  }
}

}  // namespace
}  // namespace ringfence::docs
