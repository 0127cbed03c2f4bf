#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "output_file.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Writes the timeline of a run in Chrome's trace event format (JSON), which Perfetto opens.
///
/// One process each for the frames, the server, the CD nodes and the users, with one track for each thread; and
/// counters: candidates and contacts of each frame, and the load of each node, its CPU time in milliseconds.
class TimelineFile {
 public:
  /// Throws Error if the file cannot be opened.
  explicit TimelineFile(const std::string& path);

  /// To be called after each counted frame. `frame` is its number in the file.
  void add_frame(std::uint64_t frame, const World& world);
  /// Writes the rest and closes the file. Throws IncompleteError if that fails.
  void finish();

 private:
  /// A process of the file, or a thread of one.
  struct Track {
    std::uint32_t process, thread;
  };
  static Track track_of(const TimelineSpan& span, const FrameReport& report);

  void begin_event();
  void name_process(std::uint32_t process, std::string_view name);
  void name_thread(Track track, std::string_view name);
  void name_tracks(const World& world);
  void add_span(Track track, std::string_view name, std::uint64_t begin_ns, std::uint64_t end_ns);
  void add_counter(std::uint32_t process, std::string_view name, std::uint64_t at_ns, double value);
  double microseconds(std::uint64_t at_ns) const noexcept { return static_cast<double>(at_ns - epoch_ns_) * 1e-3; }

  OutputFile file_;
  bool first_event_ = true;
  bool has_epoch_ = false;
  std::uint64_t epoch_ns_ = 0;     ///< time 0 of the file, on the monotonic clock
  std::uint32_t nodes_named_ = 0;  ///< the tracks of all nodes with lower ids have names
};

}  // namespace ringfence::tools
