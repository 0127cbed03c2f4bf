#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace ringfence::worlds {

/// The whole file; `-` is standard input. Throws InputError naming the file and the system's reason.
std::string read_text(const std::filesystem::path& file);

/// Writes the whole file. Throws Error naming the file and the system's reason.
void write_text(const std::filesystem::path& file, std::string_view text);

}  // namespace ringfence::worlds
