#pragma once

#include <cstddef>
#include <span>

namespace ringfence {

class World;

/// Records what determines the frames of a World, so that they can be reproduced; see WorldConfig::recorder.
/// Implemented by ringfence::Journal (ringfence/journal.hpp).
///
/// Threads: called on the thread that calls World. A call may wait. It must call no other function of the World than
/// save(), frames() and config(), and must not throw.
class Recorder {
 public:
  virtual ~Recorder() = default;

  /// The frame world.frames() begins. `inputs`: all that determines it beside the state of the World: the requests
  /// since the frame before. World::apply makes them again. Empty if there are none. Valid during the call. Returns
  /// false if the frame must not run because it cannot be recorded: begin_frame then returns Status::journal_failed.
  virtual bool begin_frame(World& world, std::span<const std::byte> inputs) = 0;
  /// The frame world.frames() - 1 is complete. `reproducible`: false if it also depended on something else, because a
  /// user node was late or the motion model threw. Returns false if the frame is not recorded as it has to be:
  /// finish_frame then returns Status::journal_failed, and no further frame runs.
  virtual bool finish_frame(World& world, bool reproducible) = 0;
};

}  // namespace ringfence
