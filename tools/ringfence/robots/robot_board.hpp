#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "gateway/client/replica.hpp"
#include "ringfence/collide.hpp"

namespace ringfence::tools {

/// What went wrong among the robots of a process, by kind, with the first example of each.
class RobotViolations {
 public:
  enum Kind : std::uint8_t {
    invalid_message,  ///< a message that is not as documented, or moves an unknown object
    missing_object,   ///< an avatar within the interest of another is not in its view
    wrong_position,   ///< it is, but elsewhere than in the updates of its own robot
    missing_contact,  ///< two avatars overlap, and one of them has no contact; or it has one without an overlap
    wrong_contact,    ///< the depth or the normal differs from a test of the two shapes
    lost_connection,  ///< the gateway or the network ended a connection
    kind_count,
  };
  static const char* name_of(Kind kind) noexcept;
  void add(Kind kind, const std::string& example);
  std::uint64_t count(Kind kind) const noexcept { return counts_[kind]; }
  const std::string& example(Kind kind) const noexcept { return examples_[kind]; }
  bool any() const noexcept;

 private:
  std::array<std::uint64_t, kind_count> counts_{};
  std::array<std::string, kind_count> examples_;
};

/// Compares what robots received about the same frame: each knows its own avatar exactly, so together they know what
/// each of them has to see. The robots pin some frames to the board; a frame is checked when newer ones have come.
class RobotBoard {
 public:
  explicit RobotBoard(RobotViolations& violations) : violations_(violations) {}

  /// Metres within which avatars see each other. Frames before this call are not checked.
  void set_interest(double interest) noexcept { interest_ = interest; }
  /// The shape of all avatars. Contacts are not checked before this call.
  void set_avatar(const ShapeDescription& shape) { avatar_.emplace(shape); }
  bool has_avatar() const noexcept { return avatar_.has_value(); }

  /// Adds what a robot has after an update, if its frame is one of those that are checked.
  void add(const gateway::Replica& replica);
  /// Checks what is left.
  void finish();
  std::uint64_t checked_pairs() const noexcept { return checked_pairs_; }
  std::uint64_t checked_contacts() const noexcept { return checked_contacts_; }

 private:
  struct Sight {
    ObjectNumber number = 0;
    gateway::QuantisedPosition position;
  };
  struct View {
    ObjectNumber number = 0;  ///< of the own avatar
    Pose pose;
    std::vector<Sight> avatars;  ///< in ascending order of number
    std::vector<gateway::OwnContact> contacts;
  };
  void check(std::uint64_t frame, std::vector<View>& views);
  void check_pair(std::uint64_t frame, const View& a, const View& b, double distance);
  void check_sight(std::uint64_t frame, const View& viewer, const View& seen);
  void check_contact(std::uint64_t frame, const View& a, const View& b);

  double interest_ = 0;
  std::optional<PreparedShape> avatar_;
  RobotViolations& violations_;
  std::map<std::uint64_t, std::vector<View>> views_;  ///< by acknowledgement number
  std::uint64_t checked_pairs_ = 0, checked_contacts_ = 0;
};

}  // namespace ringfence::tools
