#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ringfence/config.hpp"
#include "ringfence/recorder.hpp"
#include "ringfence/world.hpp"

/// A journal of a World in a directory: snapshots, and the inputs of every frame, from which the World continues after
/// a crash, and from which any frame can be reproduced. A library of its own, CMake target ringfence::journal. See
/// docs/journal.md.
namespace ringfence {

/// When a frame is safe.
enum class JournalSync : std::uint8_t {
  /// finish_frame returns when the inputs of the frame are on the disk: nothing that was acknowledged is ever lost.
  always,
  /// Frames are written as soon as possible, and are on the disk with the next snapshot at the latest. If the process
  /// ends, the frames that were not written are lost, usually one or two; if the machine fails, those since the last
  /// snapshot.
  snapshot,
  /// The same, but the system decides when it writes to the disk: if the machine fails, the journal may be unusable.
  never,
};
/// Name of a value in options and reports.
constexpr const char* name_of(JournalSync sync) noexcept {
  constexpr const char* names[] = {"always", "snapshot", "never"};
  return names[static_cast<std::size_t>(sync)];
}

struct JournalConfig {
  std::filesystem::path directory;  ///< created if it does not exist
  JournalSync sync = JournalSync::snapshot;
  std::uint32_t snapshot_every = 600;  ///< frames; at least 1
  /// Snapshots that are kept, at least 1; older ones, and the frames before the oldest one, are removed.
  std::uint32_t keep_snapshots = 3;
  /// Bytes that may wait to be written. If there are more, the next frame waits.
  std::size_t backlog = std::size_t{64} << 20;
  /// Text of the caller that is kept in the journal, such as the options of the run. Only for a new journal.
  std::string description;
  /// Bytes of the caller that each snapshot gets; World::saved_bytes returns them. Called in finish_frame: what the
  /// caller does after a frame is not in them. Null: none.
  std::function<std::vector<std::byte>()> own;
  /// Whether frames may be added to a journal that another release wrote.
  bool accept_release = false;
  LogHook log;  ///< null: nothing is logged. Called on the thread that calls World
};

/// Writes a journal, on a thread of its own. Give it to WorldConfig::recorder.
///
/// Failure: the functions throw Error, which names the file and says what to do. If writing fails later: with
/// JournalSync::always, begin_frame or finish_frame returns journal_failed and no further frame runs; otherwise the
/// journal ends, the log says so, and the World goes on.
class Journal final : public Recorder {
 public:
  /// A new journal. Throws Error if the directory already holds one.
  static std::shared_ptr<Journal> create(JournalConfig config);
  /// Adds to a journal: the World that it is given to was restored with JournalReader::restore to its last frame.
  /// Throws Error if there is no journal, if another process writes it, or if another release wrote it.
  static std::shared_ptr<Journal> append(JournalConfig config);
  /// Waits until everything is written.
  ~Journal() override;

  bool begin_frame(World& world, std::span<const std::byte> inputs) override;
  bool finish_frame(World& world, bool reproducible) override;

  /// Waits until everything so far is written. Returns false if the journal has ended because of a failure.
  bool flush();
  /// Why the journal has ended; empty if it has not.
  std::string failure() const;

  struct Implementation;
  explicit Journal(std::unique_ptr<Implementation> implementation);

 private:
  std::unique_ptr<Implementation> implementation_;
};

/// A snapshot in a journal: the World before the frame with that number.
struct JournalSnapshot {
  std::uint64_t frame = 0;
  std::uint64_t bytes = 0;   ///< in the journal, without what an earlier snapshot has too
  std::uint64_t memory = 0;  ///< as World::save wrote it
};

/// Frames without a gap, whose inputs are in a journal.
struct JournalFrames {
  std::uint64_t first = 0, last = 0;
  std::uint64_t bytes = 0;   ///< of their inputs, in the journal
  std::uint64_t inputs = 0;  ///< of their inputs, as the World made them
};

struct JournalContents {
  std::string description, release;
  std::vector<JournalSnapshot> snapshots;     ///< ascending
  std::vector<JournalFrames> frames;          ///< ascending; more than one if there are gaps
  std::vector<std::uint64_t> irreproducible;  ///< frames that are known only from the snapshot after them
  std::uint64_t file_bytes = 0;               ///< of all files
};

/// Reads a journal, also while another process writes it.
///
/// Failure: as Journal. What is damaged is named, and everything before it can be read.
class JournalReader {
 public:
  explicit JournalReader(const std::filesystem::path& directory);
  ~JournalReader();
  JournalReader(const JournalReader&) = delete;
  JournalReader& operator=(const JournalReader&) = delete;

  JournalContents contents() const;
  /// Size of the inputs of a frame in the journal.
  std::uint64_t frame_bytes(std::uint64_t frame) const;
  /// The number of frames of a World that is restored to the end.
  std::uint64_t frames() const;
  /// The World after `frames` frames: from the last snapshot before, and the inputs since. `config` as for
  /// World(WorldConfig, Source&); it must have no recorder and no remote nodes. `each`, if not null, is called with the
  /// snapshot, and after each frame that was run. Throws Error if the journal does not have these frames.
  World restore(WorldConfig config, std::uint64_t frames, const std::function<void(const World&)>& each = {}) const;
  /// Runs the frames from each snapshot to the next, and compares the result with that snapshot. Returns the first
  /// frame after which they differ; empty if none does.
  std::optional<std::uint64_t> verify(const WorldConfig& config) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace ringfence
