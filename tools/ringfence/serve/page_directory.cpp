#include "serve/page_directory.hpp"

#include <filesystem>
#include <system_error>

namespace ringfence::tools {

std::string page_directory(const std::string& chosen) {
  if (!chosen.empty()) return chosen;
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path installed = program.parent_path().parent_path() / "share" / "ringfence" / "web";
  return !error && std::filesystem::is_directory(installed) ? installed.string() : std::string();
}

}  // namespace ringfence::tools
