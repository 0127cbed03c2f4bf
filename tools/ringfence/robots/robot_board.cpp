#include "robots/robot_board.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

constexpr std::uint64_t check_every = 10;  // frames
constexpr std::uint64_t wait_frames = 40;  // for robots whose updates come late

double distance_of(const Vec3d& a, const Vec3d& b) noexcept {
  const double x = a.x - b.x, y = a.y - b.y, z = a.z - b.z;
  return std::sqrt(x * x + y * y + z * z);
}

}  // namespace

const char* RobotViolations::name_of(Kind kind) noexcept {
  constexpr std::array names{"invalid_message", "missing_object", "wrong_position",
                             "missing_contact", "wrong_contact",  "lost_connection"};
  static_assert(names.size() == kind_count);
  return names[kind];
}

void RobotViolations::add(Kind kind, const std::string& example) {
  if (counts_[kind]++ == 0) examples_[kind] = example;
}

bool RobotViolations::any() const noexcept {
  return std::ranges::any_of(counts_, [](std::uint64_t count) { return count > 0; });
}

void RobotBoard::add(const gateway::Replica& replica) {
  const std::uint64_t frame = replica.acknowledgement();
  if (frame % check_every != 0 || !replica.own()) return;
  View view{replica.own()->number, replica.own()->pose, {}, replica.contacts()};
  for (const auto& [number, object] : replica.objects()) {
    if (object.category == Category::avatar) view.avatars.push_back({number, object.position});
  }
  std::ranges::sort(view.avatars, {}, &Sight::number);
  views_[frame].push_back(std::move(view));
  while (!views_.empty() && views_.begin()->first + wait_frames <= frame) {
    check(views_.begin()->first, views_.begin()->second);
    views_.erase(views_.begin());
  }
}

void RobotBoard::finish() {
  for (auto& [frame, views] : views_) check(frame, views);
  views_.clear();
}

// Sorted by x, so that only neighbours are compared.
void RobotBoard::check(std::uint64_t frame, std::vector<View>& views) {
  std::ranges::sort(views, {}, [](const View& view) { return view.pose.position.x; });
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      if (views[j].pose.position.x - views[i].pose.position.x > interest_) break;
      const double distance = distance_of(views[i].pose.position, views[j].pose.position);
      if (distance < interest_) check_pair(frame, views[i], views[j], distance);
    }
  }
}

void RobotBoard::check_pair(std::uint64_t frame, const View& a, const View& b, double distance) {
  ++checked_pairs_;
  check_sight(frame, a, b);
  check_sight(frame, b, a);
  if (avatar_ && distance < 2 * avatar_->bounding_radius()) check_contact(frame, a, b);
}

void RobotBoard::check_sight(std::uint64_t frame, const View& viewer, const View& seen) {
  const auto found = std::ranges::lower_bound(viewer.avatars, seen.number, {}, &Sight::number);
  if (found == viewer.avatars.end() || found->number != seen.number) {
    violations_.add(RobotViolations::missing_object,
                    fmt::format("frame {}: avatar {} does not see avatar {}", frame - 1, viewer.number, seen.number));
  } else if (found->position != gateway::quantise(seen.pose.position)) {
    violations_.add(
        RobotViolations::wrong_position,
        fmt::format("frame {}: avatar {} sees avatar {} elsewhere than it is", frame - 1, viewer.number, seen.number));
  }
}

void RobotBoard::check_contact(std::uint64_t frame, const View& a, const View& b) {
  const auto reported = [](const View& view, ObjectNumber other) -> std::optional<gateway::OwnContact> {
    const auto found = std::ranges::find_if(view.contacts, [&](const gateway::OwnContact& contact) {
      return contact.other == other && contact.phase != Phase::end;
    });
    return found == view.contacts.end() ? std::nullopt : std::optional(*found);
  };
  const bool is_first = a.number < b.number;
  const View &low = is_first ? a : b, &high = is_first ? b : a;
  const std::optional<ContactGeometry> expected = collide(*avatar_, low.pose, *avatar_, high.pose).contact;
  ++checked_contacts_;
  for (const bool is_low : {true, false}) {
    const View &viewer = is_low ? low : high, &other = is_low ? high : low;
    const auto contact = reported(viewer, other.number);
    if (contact.has_value() != expected.has_value()) {
      violations_.add(RobotViolations::missing_contact,
                      fmt::format("frame {}: avatars {} and {} {}, but the contact of {} says otherwise", frame - 1,
                                  low.number, high.number, expected ? "touch" : "do not touch", viewer.number));
      continue;
    }
    if (!contact) continue;
    const auto depth = static_cast<std::uint64_t>(std::nearbyint(expected->depth / gateway::quantum));
    if (contact->depth != depth) {
      violations_.add(RobotViolations::wrong_contact,
                      fmt::format("frame {}: contact of avatars {} and {}: depth {}, expected {} quanta", frame - 1,
                                  low.number, high.number, contact->depth, depth));
    }
  }
}

}  // namespace ringfence::tools
