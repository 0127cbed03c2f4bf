// The files, tests and code examples that the pages of the documentation refer to exist.
#include "docs/pages.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <regex>
#include <set>
#include <string>
#include <string_view>
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

/// The anchor of a heading: lower case, spaces as hyphens, nothing but letters, digits, hyphens and underscores.
std::string anchor_of(std::string_view heading) {
  std::string anchor;
  for (const char c : trimmed(heading)) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) || c == '-' || c == '_') {
      anchor += static_cast<char>(std::tolower(byte));
    } else if (c == ' ') {
      anchor += '-';
    }
  }
  return anchor;
}

std::set<std::string> anchors_of(const std::string& prose) {
  std::set<std::string> anchors;
  for (const std::string& line : lines_of(prose)) {
    if (line.starts_with("#")) {
      anchors.insert(anchor_of(std::string_view(line).substr(line.find_first_not_of('#'))));
    }
  }
  return anchors;
}

/// Checks a link of `page` to `target`, a path relative to the page with an anchor, or one of the two.
void check_link(const Page& page, const std::string& target) {
  const std::size_t hash = std::min(target.find('#'), target.size());
  const std::string path = target.substr(0, hash);
  const auto file = path.empty() ? root / page.name : (root / page.name).parent_path() / path;
  if (!std::filesystem::exists(file)) {
    FAIL_CHECK(page.name << " links " << target << ", which does not exist");
  } else if (hash < target.size()) {
    const std::set<std::string> anchors = anchors_of(prose_of({"", read_file(file)}));
    CHECK_MESSAGE(anchors.contains(target.substr(hash + 1)),
                  page.name << " links " << target << ", but that page has no such heading");
  }
}

TEST_CASE("every link and picture of a page has an existing target, and every anchor an existing heading") {
  const std::regex link(R"re(\]\(([^)]+)\)|(?:src|srcset|href)="([^"]+)")re");
  int links = 0;
  for (const Page& page : read_pages_and_notes()) {
    const std::string prose = prose_of(page);
    for (const std::smatch& match : matches_of(prose, link)) {
      const std::string target = match[1].matched ? match[1] : match[2];
      if (!target.starts_with("http")) {
        ++links;
        check_link(page, target);
      }
    }
  }
  CHECK(links > 100);
}

TEST_CASE("every page is linked from README and from the index of the documentation") {
  for (const char* index : {"README.md", "docs/index.md"}) {
    const std::string text = read_file(root / index);
    for (const Page& page : read_pages()) {
      const std::string name = page.name.substr(page.name.rfind('/') + 1);
      if (page.name.starts_with("docs/") && name != "index.md") {
        CHECK_MESSAGE(text.find(name + ")") != text.npos, index << " does not link " << page.name);
      }
    }
  }
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
