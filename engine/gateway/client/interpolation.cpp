#include "gateway/client/interpolation.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace ringfence::gateway {
namespace {

constexpr std::size_t kept_offsets = 128;
constexpr double in_time = 0.97;         // share of the updates that the delay allows for
constexpr double settling_s = 0.4;       // time in which the delay adapts
constexpr double slack_s = 0.005;        // beyond what they require
constexpr double interval_share = 0.05;  // of a new interval in the mean
constexpr double longest_interval_s = 1;
constexpr double jump = 0.5;  // metres beyond what the fastest object moves

Pose pose_of(const Replica::Object& object) { return {position_of(object.position), orientation_of(object.turn)}; }

/// The shorter way between two orientations.
Quat between(const Quat& a, const Quat& b, float t) {
  const float dot = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
  const float u = 1 - t, w = dot < 0 ? -t : t;
  const Quat q{u * a.x + w * b.x, u * a.y + w * b.y, u * a.z + w * b.z, u * a.w + w * b.w};
  const float length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  const float scale = length > 0 ? 1 / length : 1;
  return {q.x * scale, q.y * scale, q.z * scale, q.w * scale};
}

}  // namespace

void DisplayClock::add(double server_s, double arrival_s) {
  if (!offsets_.empty() && server_s > last_s_) {
    interval_s_ += interval_share * (std::min(server_s - last_s_, longest_interval_s) - interval_s_);
  }
  last_s_ = server_s;
  offsets_.push_back(arrival_s - server_s);
  if (offsets_.size() > kept_offsets) offsets_.pop_front();
  std::vector<double> sorted(offsets_.begin(), offsets_.end());
  std::ranges::sort(sorted);
  base_s_ = sorted.front();
  const double late = sorted[static_cast<std::size_t>(static_cast<double>(sorted.size() - 1) * in_time)] - base_s_;
  wanted_s_ = interval_s_ + late + slack_s;
  if (offsets_.size() == 1) delay_s_ = wanted_s_;
}

double DisplayClock::display(double now_s) {
  const double passed = std::max(0.0, now_s - adapted_s_);
  adapted_s_ = now_s;
  delay_s_ += (wanted_s_ - delay_s_) * (1 - std::exp(-passed / settling_s));
  return now_s - base_s_ - delay_s_;
}

void Tracks::add(const Update& update, const Replica& replica) {
  const double time_s = static_cast<double>(update.time_us) * 1e-6;
  if (update.since == 0) tracks_.clear();
  for (const ObjectNumber number : update.removed) tracks_.erase(number);
  const auto add_each = [&](const auto& list) {
    for (const auto& each : list) {
      const auto found = replica.objects().find(each.number);
      if (found != replica.objects().end()) add(each.number, found->second, time_s);
    }
  };
  add_each(update.entered);
  add_each(update.moved);
  before_s_ = time_s;
}

void Tracks::add(ObjectNumber number, const Replica::Object& object, double time_s) {
  Track& track = tracks_[number];
  if (track.generation != object.generation) track = {object.generation, 0, {}};
  // An object that is in no update did not move until the update before this one.
  if (track.count > 0 && track.states[track.count - 1].time_s < before_s_) {
    push(track, {before_s_, track.states[track.count - 1].pose});
  }
  push(track, {time_s, pose_of(object)});
}

void Tracks::push(Track& track, const State& state) {
  if (track.count == kept) {
    std::shift_left(track.states.begin(), track.states.end(), 1);
    --track.count;
  }
  track.states[track.count++] = state;
}

Pose Tracks::sample(ObjectNumber number, const Replica::Object& object, double time_s) const {
  const auto found = tracks_.find(number);
  if (found == tracks_.end() || found->second.generation != object.generation) return pose_of(object);
  const Track& track = found->second;
  const auto end = track.states.begin() + static_cast<std::ptrdiff_t>(track.count);
  const auto after = std::upper_bound(track.states.begin(), end, time_s,
                                      [](double time, const State& state) { return time < state.time_s; });
  if (after == end) return track.states[track.count - 1].pose;
  if (after == track.states.begin()) return after->pose;
  const State& a = *(after - 1);
  const State& b = *after;
  const Vec3d &p = a.pose.position, &q = b.pose.position;
  const Vec3d way{q.x - p.x, q.y - p.y, q.z - p.z};
  if (std::hypot(way.x, way.y, way.z) > fastest_ * (b.time_s - a.time_s) + jump) return a.pose;
  const double t = (time_s - a.time_s) / (b.time_s - a.time_s);
  return {{p.x + way.x * t, p.y + way.y * t, p.z + way.z * t},
          between(a.pose.orientation, b.pose.orientation, static_cast<float>(t))};
}

}  // namespace ringfence::gateway
