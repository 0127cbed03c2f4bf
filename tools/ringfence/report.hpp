#pragma once

#include <cstdio>

#include "figures.hpp"
#include "frame_checker.hpp"
#include "job.hpp"
#include "output_file.hpp"
#include "resize.hpp"

namespace ringfence::tools {

/// The short report that a person reads.
void print_report(std::FILE* out, const Job& job, const Figures& figures, const Resizing& resizing,
                  const FrameChecker& checker);

/// --json: all figures.
void write_json_report(OutputFile& out, const Job& job, const Figures& figures, const Resizing& resizing,
                       const FrameChecker& checker);

}  // namespace ringfence::tools
