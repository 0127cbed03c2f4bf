#pragma once

#include <cstdint>
#include <memory>

#include "options.hpp"
#include "output_file.hpp"
#include "ringfence/world.hpp"
#include "timeline_file.hpp"

namespace ringfence::tools {

/// Writes the output files that grow with every counted frame: --collisions, --frames-csv and --trace.
class FrameOutputs {
 public:
  /// Opens the files. Throws Error that names a file which cannot be opened.
  explicit FrameOutputs(const OutputOptions& options);

  /// To be called after each counted frame. `frame` is its number in the files, from 0.
  void add_frame(std::uint64_t frame, const World& world);
  /// Writes the rest and closes the files. Throws IncompleteError if that fails.
  void finish();

 private:
  void add_contacts(std::uint64_t frame, std::span<const Contact> contacts);
  void add_row(std::uint64_t frame, const FrameReport& report);

  std::unique_ptr<OutputFile> collisions_, frames_;
  std::unique_ptr<TimelineFile> timeline_;
};

}  // namespace ringfence::tools
