// The files, tests and code examples that the pages of the documentation refer to exist.
#include "docs/pages.hpp"

#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::docs {
namespace {

std::vector<std::smatch> matches_of(const std::string& text, const std::regex& pattern) {
  return {std::sregex_iterator(text.begin(), text.end(), pattern), std::sregex_iterator()};
}

/// The text of a page without its code blocks.
std::string prose_of(const Page& page) {
  std::string prose;
  bool code = false;
  for (const std::string& line : lines_of(page.text)) {
    if (line.starts_with("```")) {
      code = !code;
    } else if (!code) {
      prose += line + '\n';
    }
  }
  return prose;
}

TEST_CASE("every link of a page to a file has an existing target") {
  const std::regex link(R"(\]\(([^)#]+)(#[^)]*)?\))");
  int links = 0;
  for (const Page& page : read_pages()) {
    const std::string prose = prose_of(page);
    for (const std::smatch& match : matches_of(prose, link)) {
      const std::string target = match[1];
      if (target.starts_with("http")) {
        continue;
      }
      ++links;
      const auto file = (root / page.name).parent_path() / target;
      CHECK_MESSAGE(std::filesystem::exists(file), page.name << " links " << target << ", which does not exist");
    }
  }
  CHECK(links > 10);
}

TEST_CASE("every file and folder that a page names exists") {
  const std::regex path(R"(`((engine|tests|tools|docs|bench)/[A-Za-z0-9_./-]*)`)");
  int paths = 0;
  for (const Page& page : read_pages()) {
    const std::string prose = prose_of(page);
    for (const std::smatch& match : matches_of(prose, path)) {
      ++paths;
      CHECK_MESSAGE(std::filesystem::exists(root / match[1].str()),
                    page.name << " names " << match[1].str() << ", which does not exist");
    }
  }
  CHECK(paths > 50);
}

// Pages quote tests as `tests/module/file.cpp`: "name", with more names of the same file after "; ".
TEST_CASE("every test that a page quotes exists in the file that it names") {
  const std::regex quote(R"(`(tests/[a-z_/]+\.cpp)`: ("[^"]+"(; "[^"]+")*))");
  const std::regex line_break(R"(TEST_CASE\(\s+)");
  const std::regex sentence(R"("([^"]+)\")");
  int quoted = 0;
  for (const Page& page : read_pages()) {
    const std::string prose = prose_of(page);
    for (const std::smatch& match : matches_of(prose, quote)) {
      if (!std::filesystem::exists(root / match[1].str())) {
        continue;  // the test above reports it
      }
      // A long name is on the line after `TEST_CASE(`.
      const std::string source = std::regex_replace(read_file(root / match[1].str()), line_break, "TEST_CASE(");
      const std::string sentences = match[2];
      for (const std::smatch& each : matches_of(sentences, sentence)) {
        ++quoted;
        CHECK_MESSAGE(source.find("TEST_CASE(\"" + each[1].str() + "\"") != source.npos,
                      page.name << " quotes \"" << each[1].str() << "\", which is not in " << match[1].str());
      }
    }
  }
  CHECK(quoted > 20);
}

/// The non-empty lines without indentation, each with a newline at its end.
std::string normalised(const std::vector<std::string>& lines) {
  std::string text = "\n";
  for (const std::string& line : lines) {
    if (const std::string_view bare = trimmed(line); !bare.empty()) {
      text += std::string(bare) + '\n';
    }
  }
  return text;
}

TEST_CASE("every C++ block of a page is part of an example, which is compiled and run") {
  std::vector<std::string> examples;
  for (const auto& entry : std::filesystem::directory_iterator(root / "docs" / "examples")) {
    examples.push_back(normalised(lines_of(read_file(entry.path()))));
  }
  int blocks = 0;
  for (const Page& page : read_pages()) {
    std::vector<std::string> block;
    bool inside = false;
    for (const std::string& line : lines_of(page.text)) {
      if (inside && line.starts_with("```")) {
        inside = false;
        ++blocks;
        const std::string text = normalised(block);
        bool found = false;
        for (const std::string& example : examples) {
          found |= example.find(text) != example.npos;
        }
        CHECK_MESSAGE(found, page.name << " shows code that is not part of an example:" << text);
      } else if (inside) {
        block.push_back(line);
      } else if (line == "```cpp") {
        inside = true;
        block.clear();
      }
    }
  }
  CHECK(blocks >= 4);
}

}  // namespace
}  // namespace ringfence::docs
