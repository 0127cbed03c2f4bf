#include "gateway/client/interpolation.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::gateway {
namespace {

constexpr double frame_s = 0.05;

/// A client that receives the updates of an object which moves along x at 3 m/s, until it stops.
class Watched {
 public:
  static constexpr double speed = 3;

  explicit Watched(double stops_s = 1e9) : stops_s_(stops_s) {}
  double actual(double time_s) const { return speed * std::min(time_s, stops_s_); }

  void receive(std::uint64_t frame) {
    const double time_s = static_cast<double>(frame) * frame_s;
    Update update;
    update.frame = frame;
    update.since = frame == 0 ? 0 : frame - last_;
    update.time_us = static_cast<std::uint64_t>(std::llround(time_s * 1e6));
    const QuantisedPosition position = quantise(Vec3d{actual(time_s), 0, 0});
    const std::uint32_t turn = quantise(Quat{0, 0, 0, 1});
    if (frame == 0) {
      update.entered.push_back({7, 1, ShapeId(0), Category::active, no_user, position, turn, {}});
    } else if (position != replica_.objects().at(7).position) {
      update.moved.push_back({7, false, 0, position});
    }
    if (replica_.apply(update) != Replica::Outcome::applied) return;
    tracks_.add(update, replica_);
    last_ = frame;
  }
  double sample(double time_s) const { return tracks_.sample(7, replica_.objects().at(7), time_s).position.x; }
  Replica& replica() { return replica_; }
  Tracks& tracks() { return tracks_; }

 private:
  double stops_s_;
  std::uint64_t last_ = 0;
  Replica replica_;
  Tracks tracks_;
};

}  // namespace

TEST_CASE("between two states, an object is displayed where it was") {
  Watched watched(0.6);
  for (const std::uint64_t frame : {0, 1, 2, 4, 5, 8, 9, 10, 11, 12, 13, 20, 21}) watched.receive(frame);
  for (double time = 0.4; time < 1.1; time += 0.01) {
    CHECK(watched.sample(time) == doctest::Approx(watched.actual(time)).epsilon(0.01));
  }
}

TEST_CASE("a jump is not displayed as a way") {
  Replica replica;
  Tracks tracks(10);
  Update update;
  const std::uint32_t turn = quantise(Quat{0, 0, 0, 1});
  update.frame = 1;
  update.time_us = 50'000;
  update.entered.push_back({7, 1, ShapeId(0), Category::active, no_user, quantise(Vec3d{0, 0, 0}), turn, {}});
  REQUIRE(replica.apply(update) == Replica::Outcome::applied);
  tracks.add(update, replica);
  Update next;
  next.frame = 2;
  next.since = 1;
  next.time_us = 100'000;
  next.moved.push_back({7, false, 0, quantise(Vec3d{5, 0, 0})});
  REQUIRE(replica.apply(next) == Replica::Outcome::applied);
  tracks.add(next, replica);
  const auto x = [&](double time_s) { return tracks.sample(7, replica.objects().at(7), time_s).position.x; };
  CHECK(x(0.09) == 0);
  CHECK(x(0.1) == 5);
  CHECK(x(9) == 5);
}

TEST_CASE("with jitter and loss, what is displayed moves evenly and not more than the jitter too late") {
  Watched watched;
  DisplayClock clock;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> jitter(0, 0.1);
  std::multimap<double, std::uint64_t> arrivals;
  constexpr double delay_s = 0.3;
  for (std::uint64_t frame = 0; frame < 400; ++frame) {
    if (frame > 0 && random() % 20 == 0) continue;  // lost
    arrivals.emplace(static_cast<double>(frame) * frame_s + delay_s + (frame == 0 ? 0 : jitter(random)), frame);
  }
  double last = 0;
  int even = 0, drawn = 0;
  for (double now = delay_s; now < 19; now += 1.0 / 60) {
    while (!arrivals.empty() && arrivals.begin()->first <= now) {
      const auto [arrival, frame] = *arrivals.begin();
      watched.receive(frame);
      clock.add(static_cast<double>(frame) * frame_s, arrival);
      arrivals.erase(arrivals.begin());
    }
    const double time = clock.display(now), x = watched.sample(time);
    if (now > 5) {
      ++drawn;
      // A hundredth of a second of the displayed clock may be won or lost while the delay adapts.
      even += std::abs((x - last) - Watched::speed / 60) < 0.03 ? 1 : 0;
      CHECK(now - time < delay_s + 0.1 + 2 * frame_s + 0.01);
      CHECK(now - time > delay_s);
    }
    last = x;
  }
  CHECK(even > drawn * 95 / 100);
}

TEST_CASE("orientations are interpolated on the shorter way, and keep unit length") {
  Replica replica;
  Tracks tracks;
  Update update;
  update.frame = 1;
  update.time_us = 0;
  const double half = std::sqrt(0.5);
  const Quat first{0, 0, 0, 1}, second{0, 0, static_cast<float>(-half), static_cast<float>(-half)};
  update.entered.push_back({7, 1, ShapeId(0), Category::active, no_user, {}, quantise(first), {}});
  REQUIRE(replica.apply(update) == Replica::Outcome::applied);
  tracks.add(update, replica);
  Update next;
  next.frame = 2;
  next.since = 1;
  next.time_us = 100'000;
  next.moved.push_back({7, true, quantise(second), {}});
  REQUIRE(replica.apply(next) == Replica::Outcome::applied);
  tracks.add(next, replica);
  const Quat q = tracks.sample(7, replica.objects().at(7), 0.05).orientation;
  CHECK(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w == doctest::Approx(1));
  CHECK(std::abs(q.z) == doctest::Approx(std::sin(M_PI / 8)).epsilon(0.01));
}

}  // namespace ringfence::gateway
