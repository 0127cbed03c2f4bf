#include "worlds/text_file.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include <fmt/format.h>

#include "worlds/input_error.hpp"

namespace ringfence::worlds {
namespace {

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

}  // namespace

std::string read_text(const std::filesystem::path& file) {
  std::unique_ptr<std::FILE, FileCloser> opened;
  std::FILE* source = stdin;
  if (file != "-") {
    opened.reset(std::fopen(file.c_str(), "rb"));
    if (!opened) throw InputError(fmt::format("{}: cannot be opened: {}", file.string(), std::strerror(errno)));
    source = opened.get();
  }
  std::string text;
  char block[1 << 16];
  for (std::size_t got; (got = std::fread(block, 1, sizeof block, source)) > 0;) text.append(block, got);
  if (std::ferror(source)) throw InputError(fmt::format("{}: cannot be read: {}", file.string(), std::strerror(errno)));
  return text;
}

void write_text(const std::filesystem::path& file, std::string_view text) {
  std::unique_ptr<std::FILE, FileCloser> opened(std::fopen(file.c_str(), "wb"));
  bool written = opened != nullptr;
  if (written) written = std::fwrite(text.data(), 1, text.size(), opened.get()) == text.size();
  if (opened) written = std::fclose(opened.release()) == 0 && written;
  if (!written) throw Error(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(errno)));
}

}  // namespace ringfence::worlds
