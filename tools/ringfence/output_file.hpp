#pragma once

#include <cstdio>
#include <string>
#include <string_view>

#include <fmt/format.h>

namespace ringfence::tools {

/// A text file that is written while frames run; opened before the first, so that a wrong path is told at once.
///
/// Text is gathered in memory and written in blocks.
class OutputFile {
 public:
  /// `-` is standard output. Throws Error when the file cannot be opened.
  explicit OutputFile(std::string path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  template <class... Values>
  void print(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
    if (text_.size() >= block) flush();
  }
  /// Writes what is left and closes. Throws IncompleteError when anything could not be written.
  void close();

 private:
  static constexpr std::size_t block = 1 << 16;
  void flush();

  std::string path_;
  std::FILE* file_;
  fmt::memory_buffer text_;
};

}  // namespace ringfence::tools
