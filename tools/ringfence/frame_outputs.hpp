#pragma once

#include <cstdint>
#include <memory>

#include "options.hpp"
#include "output_file.hpp"
#include "ringfence/world.hpp"

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
  void add_spans(std::uint64_t frame, const World& world);

  std::unique_ptr<OutputFile> collisions_, frames_, trace_;
  bool first_span_ = true;
  bool tracks_named_ = false;
  std::uint32_t nodes_named_ = 0;  ///< the tracks of all nodes with lower ids have names
  std::uint64_t epoch_ns_ = 0;     ///< time 0 of the trace, on the monotonic clock
};

}  // namespace ringfence::tools
