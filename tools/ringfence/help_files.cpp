// Writes the manual page or the bash completion of the program `ringfence` to standard output.
// usage: ringfence_help_files man|bash
#include <cstdio>
#include <string_view>

#include <fmt/format.h>

#include "bash_completion.hpp"
#include "manual_page.hpp"
#include "options.hpp"

int main(int argc, char** argv) {
  using namespace ringfence::tools;
  const std::string_view kind = argc == 2 ? argv[1] : "";
  const CommandLineParser parser;
  if (kind == "man") {
    fmt::print("{}", format_manual_page(parser.app(), RINGFENCE_VERSION));
  } else if (kind == "bash") {
    fmt::print("{}", format_bash_completion(parser.app()));
  } else {
    fmt::print(stderr, "ringfence_help_files: expected man or bash\n");
    return 2;
  }
  return std::fflush(stdout) == 0 ? 0 : 3;
}
