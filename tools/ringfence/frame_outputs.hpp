#pragma once

#include <cstdint>
#include <memory>

#include "options.hpp"
#include "output_file.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// The files that get something from every counted frame: --collisions, --frames-csv, --trace.
class FrameOutputs {
 public:
  /// Opens them. Throws Error naming the one that cannot be.
  explicit FrameOutputs(const OutputOptions& options);

  /// After a frame; `frame` is its number in the outputs, from 0.
  void add_frame(std::uint64_t frame, const World& world);
  /// Writes what is left. Throws IncompleteError.
  void finish();

 private:
  void add_contacts(std::uint64_t frame, std::span<const Contact> contacts);
  void add_row(std::uint64_t frame, const FrameReport& report);
  void add_spans(std::uint64_t frame, const World& world);

  std::unique_ptr<OutputFile> collisions_, frames_, trace_;
  bool first_span_ = true;
  bool tracks_named_ = false;
  std::uint32_t nodes_named_ = 0;
  std::uint64_t epoch_ns_ = 0;  ///< where the timeline begins
};

}  // namespace ringfence::tools
