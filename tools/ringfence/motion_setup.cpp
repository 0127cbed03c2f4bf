#include "motion_setup.hpp"

#include <cstdint>
#include <cstring>
#include <type_traits>

#include "ringfence/error.hpp"
#include "worlds/replay_model.hpp"

namespace ringfence::tools {
namespace {

enum class Kind : std::uint32_t { steering = 1, replay = 2 };

/// Precedes the serialized records. The cluster checks that World and node have one version; the record size is an
/// additional check.
struct Head {
  Kind kind;
  std::uint32_t bytes_each;
  std::uint64_t count;
};

struct PackedRow {
  std::uint32_t frame;
  std::uint32_t object;
  std::uint32_t present, jump;
  Pose pose;
};
static_assert(sizeof(PackedRow) == 56 && std::is_trivially_copyable_v<PackedRow>);
static_assert(std::is_trivially_copyable_v<motion::SteeringConfig>);

template <class Record>
std::vector<std::byte> pack(Kind kind, std::span<const Record> records) {
  const Head head{kind, sizeof(Record), records.size()};
  std::vector<std::byte> bytes(sizeof head + records.size_bytes());
  std::memcpy(bytes.data(), &head, sizeof head);
  if (!records.empty()) std::memcpy(bytes.data() + sizeof head, records.data(), records.size_bytes());
  return bytes;
}

}  // namespace

std::vector<std::byte> pack_motion(const motion::SteeringConfig& steering) {
  return pack(Kind::steering, std::span<const motion::SteeringConfig>(&steering, 1));
}

std::vector<std::byte> pack_motion(const worlds::Motion& motion) {
  std::vector<PackedRow> rows;
  rows.reserve(motion.rows.size());
  for (const worlds::MotionRow& row : motion.rows) {
    rows.push_back({row.frame, row.object, row.present ? 1u : 0u, row.jump ? 1u : 0u, row.pose});
  }
  return pack(Kind::replay, std::span<const PackedRow>(rows));
}

std::shared_ptr<const MotionModel> unpack_motion(std::span<const std::byte> bytes) {
  Head head{};
  if (bytes.size() >= sizeof head) std::memcpy(&head, bytes.data(), sizeof head);
  const auto body = bytes.size() >= sizeof head ? bytes.subspan(sizeof head) : std::span<const std::byte>();
  const auto fits = [&](Kind kind, std::size_t each) {
    return head.kind == kind && head.bytes_each == each && head.count == body.size() / each && body.size() % each == 0;
  };
  if (fits(Kind::steering, sizeof(motion::SteeringConfig)) && head.count == 1) {
    motion::SteeringConfig steering;
    std::memcpy(&steering, body.data(), sizeof steering);
    return std::make_shared<motion::Steering>(steering);
  }
  if (fits(Kind::replay, sizeof(PackedRow))) {
    worlds::Motion motion;
    for (std::size_t i = 0; i < head.count; ++i) {
      PackedRow row;
      std::memcpy(&row, body.data() + i * sizeof row, sizeof row);
      motion.rows.push_back({row.frame, row.object, row.present != 0, row.jump != 0, row.pose});
    }
    return std::make_shared<worlds::ReplayModel>(motion);
  }
  throw Error("the motion model of the World has an unknown layout; expected a World of the same program and version");
}

}  // namespace ringfence::tools
