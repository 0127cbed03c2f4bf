#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "figures.hpp"
#include "job.hpp"
#include "ringfence/journal.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Called with a number of complete frames, and the digest of the counted ones among them.
using FrameObserver = std::function<void(std::uint64_t frames, std::uint64_t digest)>;

/// The journal of a run, if it has one: makes the world, new or as the journal has it, and keeps the digest of the
/// counted frames in the snapshots.
class JournalRun {
 public:
  /// `job` and `figures` outlive this object. `observe`, if not null, is called for each frame that count_frame() adds
  /// to the digest, or that make_world() runs again. Throws Error if the journal cannot be read or written.
  JournalRun(const Job& job, Figures& figures, FrameObserver observe = {});

  /// The world of the job: loaded from its scene, or restored to the last frame of the journal, with the digest of the
  /// frames before. Throws Error.
  World make_world(WorldConfig config);
  /// Adds a frame to the digest, of a world whose other figures are not collected.
  void count_frame(const World& world);
  /// Waits until everything is written. Throws IncompleteError if the journal has ended before.
  void finish();

 private:
  std::vector<std::byte> own_bytes() const;
  World continue_world(WorldConfig config);
  void add_frame(const World& world, bool is_snapshot);
  JournalConfig journal_config(const LogHook& log);

  const Job& job_;
  Figures& figures_;
  FrameObserver observe_;
  std::uint64_t digested_ = 0;  ///< counted frames in the digest before this process
  std::shared_ptr<Journal> journal_;
};

/// What each snapshot has for a run: the digest of its counted frames so far.
struct DigestSoFar {
  std::uint64_t value = 0;
  std::uint64_t frames = 0;  ///< counted frames in it

  /// Zero if the bytes are not those of a run.
  static DigestSoFar of(const World& world) noexcept;
};

}  // namespace ringfence::tools
