#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace ringfence::docs {

/// The source tree that the tests were built from.
inline const std::filesystem::path root = RINGFENCE_SOURCE_DIR;

/// One page of the documentation.
struct Page {
  std::string name;  ///< path relative to `root`
  std::string text;
};

/// README.md, CHANGELOG.md, CONTRIBUTING.md and the pages of docs/, without docs/notes and docs/data.
std::vector<Page> read_pages();
/// The same, and the pages of docs/notes and docs/data.
std::vector<Page> read_pages_and_notes();
/// Reads a file of the source tree; fails the test if it cannot.
std::string read_file(const std::filesystem::path& path);

std::vector<std::string> lines_of(std::string_view text);
/// `text` without blanks at both ends.
std::string_view trimmed(std::string_view text);

/// The rows of the first Markdown table after the line `heading`, without the header row. Cells are trimmed and have no
/// backticks. Fails the test if there is no such heading or table.
std::vector<std::vector<std::string>> table_after(std::string_view text, std::string_view heading);

}  // namespace ringfence::docs
