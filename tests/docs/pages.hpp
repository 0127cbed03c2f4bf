#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace ringfence::docs {

/// The checkout that the tests were built from.
inline const std::filesystem::path root = RINGFENCE_SOURCE_DIR;

/// One page of the documentation, by its path in the checkout.
struct Page {
  std::string name;
  std::string text;
};

/// README.md, CHANGELOG.md and docs/*.md.
std::vector<Page> read_pages();
/// A file of the checkout; fails the test when it cannot be read.
std::string read_file(const std::filesystem::path& path);

std::vector<std::string> lines_of(std::string_view text);
/// Without blanks at both ends.
std::string_view trimmed(std::string_view text);

/// The rows of the first Markdown table after the line `heading`, without its head: the cells, trimmed and without
/// backticks. Fails the test when there is no such heading or table.
std::vector<std::vector<std::string>> table_after(std::string_view text, std::string_view heading);

}  // namespace ringfence::docs
