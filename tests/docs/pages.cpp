#include "docs/pages.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>

#include <doctest/doctest.h>

namespace ringfence::docs {

std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  REQUIRE_MESSAGE(in.good(), path.string() << " cannot be read");
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

namespace {

/// Adds the Markdown files in `folder` and below whose paths `wanted` accepts.
template <typename Wanted>
void add_pages(std::vector<Page>& pages, const std::filesystem::path& folder, Wanted wanted) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
    const std::string name = entry.path().lexically_relative(root).generic_string();
    if (entry.path().extension() == ".md" && wanted(name)) {
      pages.push_back({name, read_file(entry.path())});
    }
  }
  std::sort(pages.begin(), pages.end(), [](const Page& p, const Page& q) { return p.name < q.name; });
}

bool is_history(const std::string& name) { return name.starts_with("docs/notes/") || name.starts_with("docs/data/"); }

}  // namespace

std::vector<Page> read_pages() {
  std::vector<Page> pages;
  for (const char* name : {"README.md", "CHANGELOG.md", "CONTRIBUTING.md"}) {
    pages.push_back({name, read_file(root / name)});
  }
  add_pages(pages, "docs", [](const std::string& name) { return !is_history(name); });
  return pages;
}

std::vector<Page> read_pages_and_notes() {
  std::vector<Page> pages = read_pages();
  add_pages(pages, "docs", is_history);
  return pages;
}

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    lines.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  return begin == text.npos ? std::string_view{} : text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

std::vector<std::vector<std::string>> table_after(std::string_view text, std::string_view heading) {
  const std::vector<std::string> lines = lines_of(text);
  auto line = std::find(lines.begin(), lines.end(), heading);
  REQUIRE_MESSAGE(line != lines.end(), "there is no line \"" << std::string(heading) << "\"");
  const auto is_row = [](const std::string& row) { return row.starts_with("|"); };
  line = std::find_if(line, lines.end(), is_row);
  std::vector<std::vector<std::string>> rows;
  for (; line != lines.end() && is_row(*line); ++line) {
    std::vector<std::string> cells;
    std::string_view rest = std::string_view(*line).substr(1);
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find('|'), rest.size());
      std::string cell(trimmed(rest.substr(0, end)));
      std::erase(cell, '`');
      cells.push_back(std::move(cell));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    rows.push_back(std::move(cells));
  }
  REQUIRE_MESSAGE(rows.size() > 2, "there is no table after \"" << std::string(heading) << "\"");
  rows.erase(rows.begin(), rows.begin() + 2);
  return rows;
}

}  // namespace ringfence::docs
