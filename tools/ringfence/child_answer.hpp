#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace ringfence::tools {

/// Descriptor to which a child process writes its answer, and how it ends if it has none.
inline constexpr int answer_file = 3;
inline constexpr int child_out_of_memory = 3, child_failed = 4;

/// The main function of a program that run_child starts: sets the limits, calls `work` with the other arguments and the
/// input, writes what it returns to the parent, and ends the process, also if `work` throws.
[[noreturn]] void answer_parent(
    int argc, char** argv,
    const std::function<std::string(std::span<const char* const> arguments, std::string_view input)>& work);

}  // namespace ringfence::tools
