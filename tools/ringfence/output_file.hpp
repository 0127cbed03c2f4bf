#pragma once

#include <cstdio>
#include <string>
#include <string_view>

#include <fmt/format.h>

namespace ringfence::tools {

/// A file that is written during a run. It is opened before the first frame, so that an invalid path is reported
/// at once. Text is buffered and written in blocks of about 64 KiB.
class OutputFile {
 public:
  /// `-` is standard output. Throws Error if the file cannot be opened.
  explicit OutputFile(std::string path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  template <class... Values>
  void print(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
    if (text_.size() >= block) flush();
  }
  /// Writes bytes as they are.
  void write(std::string_view bytes) {
    text_.append(bytes);
    if (text_.size() >= block) flush();
  }
  /// Writes the rest and closes the file. Throws IncompleteError if a write failed.
  void close();

 private:
  static constexpr std::size_t block = 1 << 16;
  void flush();

  std::string path_;
  std::FILE* file_;
  fmt::memory_buffer text_;
};

}  // namespace ringfence::tools
