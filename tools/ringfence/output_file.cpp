#include "output_file.hpp"

#include <cerrno>
#include <cstring>
#include <utility>

#include "exit_code.hpp"

namespace ringfence::tools {

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)), file_(path_ == "-" ? stdout : std::fopen(path_.c_str(), "wb")) {
  if (!file_) throw Error(fmt::format("{}: cannot be opened for writing: {}", path_, std::strerror(errno)));
}

OutputFile::~OutputFile() {
  if (file_ && file_ != stdout) std::fclose(file_);
}

void OutputFile::flush() {
  if (std::fwrite(text_.data(), 1, text_.size(), file_) != text_.size()) {
    throw IncompleteError(fmt::format("{}: cannot be written: {}", path_, std::strerror(errno)));
  }
  text_.clear();
}

void OutputFile::close() {
  flush();
  std::FILE* file = std::exchange(file_, nullptr);
  const bool written = file == stdout ? std::fflush(file) == 0 : std::fclose(file) == 0;
  if (!written) throw IncompleteError(fmt::format("{}: cannot be written: {}", path_, std::strerror(errno)));
}

}  // namespace ringfence::tools
