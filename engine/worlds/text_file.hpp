#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace ringfence::worlds {

/// Reads a whole file; `-` is standard input. Throws InputError with the file name and the system's error message if
/// the file cannot be read.
std::string read_text(const std::filesystem::path& file);

/// Creates or overwrites a file. Throws Error with the file name and the system's error message if the file cannot be
/// written.
void write_text(const std::filesystem::path& file, std::string_view text);

}  // namespace ringfence::worlds
