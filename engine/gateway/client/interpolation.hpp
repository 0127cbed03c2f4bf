#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <unordered_map>

#include "gateway/client/replica.hpp"

namespace ringfence::gateway {

// Other objects are displayed a little in the past, between two states that were received, so that they move evenly
// although updates arrive unevenly. interpolation.js does the same for browsers.

/// Converts the client's clock to the time of the server that is displayed. The delay is as large as the arrivals of
/// the last 128 updates require: all but 3 % of them were in time with it.
class DisplayClock {
 public:
  /// An update arrived. `server_s`: its time; `arrival_s`: of the client's clock. Seconds.
  void add(double server_s, double arrival_s);
  /// The time of the server to display now. Precondition: an update was added.
  double display(double now_s);
  /// Between the fastest arrival and what is displayed, seconds.
  double delay_s() const noexcept { return delay_s_; }

 private:
  std::deque<double> offsets_;  ///< arrivals minus times of the server
  double interval_s_ = 0.05, last_s_ = 0;
  double base_s_ = 0;  ///< the least offset
  double delay_s_ = 0, wanted_s_ = 0, adapted_s_ = 0;
};

/// The last states of the objects that move.
class Tracks {
 public:
  /// `fastest`: m/s; what is faster has jumped and is not interpolated.
  explicit Tracks(double fastest = 50) : fastest_(fastest) {}

  /// Adds the states of an update that `replica` has applied.
  void add(const Update& update, const Replica& replica);
  /// The pose of an object of the replica at a time of the server, seconds: between two states, or the last one if none
  /// is newer.
  Pose sample(ObjectNumber number, const Replica::Object& object, double time_s) const;

 private:
  struct State {
    double time_s = 0;
    Pose pose;
  };
  static constexpr std::size_t kept = 8;
  struct Track {
    std::uint32_t generation = 0;
    std::size_t count = 0;
    std::array<State, kept> states;  ///< the newest last
  };
  void add(ObjectNumber number, const Replica::Object& object, double time_s);
  static void push(Track& track, const State& state);

  double fastest_;
  std::unordered_map<ObjectNumber, Track> tracks_;
  double before_s_ = 0;  ///< time of the update before
};

}  // namespace ringfence::gateway
