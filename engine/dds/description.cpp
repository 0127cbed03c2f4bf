#include "dds/description.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <variant>

#include "facade/config_check.hpp"
#include "ringfence/error.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::dds {

namespace {

template <class Value>
void put(std::vector<std::byte>& bytes, const Value& value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof value);
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

template <class Value>
void put_list(std::vector<std::byte>& bytes, const std::vector<Value>& list) {
  put(bytes, std::uint64_t{list.size()});
  const std::size_t at = bytes.size();
  bytes.resize(at + list.size() * sizeof(Value));
  if (!list.empty()) {
    std::memcpy(bytes.data() + at, list.data(), list.size() * sizeof(Value));
  }
}

class Unpacking {
 public:
  Unpacking(std::span<const std::byte> bytes, ShapeNumber shape) : bytes_(bytes), shape_(shape) {}

  template <class Value>
  Value take() {
    Value value;
    std::memcpy(&value, need(sizeof value), sizeof value);
    return value;
  }
  template <class Value>
  std::vector<Value> take_list() {
    const auto count = take<std::uint64_t>();
    if (count > bytes_.size() / sizeof(Value)) {
      fail();
    }
    std::vector<Value> list(static_cast<std::size_t>(count));
    if (!list.empty()) {
      std::memcpy(list.data(), need(list.size() * sizeof(Value)), list.size() * sizeof(Value));
    }
    return list;
  }
  void end() const {
    if (!bytes_.empty()) {
      fail();
    }
  }

 private:
  [[noreturn]] void fail() const {
    throw Error("shape " + std::to_string(shape_) +
                ": its bytes are not a valid shape; World and node may have different versions");
  }
  const std::byte* need(std::size_t bytes) {
    if (bytes_.size() < bytes) {
      fail();
    }
    const std::byte* at = bytes_.data();
    bytes_ = bytes_.subspan(bytes);
    return at;
  }

  std::span<const std::byte> bytes_;
  ShapeNumber shape_;
};

/// Throws Error if `holds` is false. `what` states what was found and what is expected.
void require(const char* where, bool holds, const std::string& what) {
  if (!holds) {
    throw Error(std::string(where) + ": " + what);
  }
}

template <class Record>
Record copy_of(const char* where, std::span<const std::byte> bytes) {
  require(where, bytes.size() == sizeof(Record),
          std::to_string(bytes.size()) + " bytes; expected " + std::to_string(sizeof(Record)));
  Record record;
  std::memcpy(&record, bytes.data(), sizeof record);
  return record;
}

/// Maximum number of objects or pairs to reserve for; see WorldConfig::capacities.
constexpr std::uint64_t max_reserved = std::uint64_t{1} << 31;

}  // namespace

WorldTermsRecord unpack_terms(std::span<const std::byte> bytes) {
  constexpr const char* where = "the World's terms";
  constexpr std::uint64_t max_setup_bytes = std::uint64_t{1} << 30;
  const auto terms = copy_of<WorldTermsRecord>(where, bytes);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double min = terms.bounds_min[axis];
    const double max = terms.bounds_max[axis];
    require(
        where, std::isfinite(min) && std::isfinite(max) && min <= max,
        "bounds " + std::to_string(min) + " to " + std::to_string(max) + "; expected finite numbers, with min <= max");
    require(where, terms.cells_log2[axis] <= 10,
            "2^" + std::to_string(terms.cells_log2[axis]) + " cells on an axis; expected at most 2^10");
  }
  // False for NaN.
  require(where, terms.lease_ms >= 10 && terms.lease_ms <= 60'000,
          "a lease of " + std::to_string(terms.lease_ms) + " ms; expected 10 to 60000");
  require(where, std::isfinite(terms.sense) && terms.sense >= 0,
          "a sense of " + std::to_string(terms.sense) + " m; expected 0 or more");
  require(where, terms.setup_bytes <= max_setup_bytes,
          "a setup of " + std::to_string(terms.setup_bytes) + " bytes; expected at most " +
              std::to_string(max_setup_bytes));
  require(where, terms.placement < static_cast<std::uint32_t>(Placement::automatic),
          "placement " + std::to_string(terms.placement) + "; expected 0 or 1");
  require(where, terms.state_bytes <= max_motion_state,
          std::to_string(terms.state_bytes) + " bytes of model state; expected at most " +
              std::to_string(max_motion_state));
  for (const std::uint32_t flag : {terms.has_model, terms.keep_resting, terms.remember_axes, terms.hosts}) {
    require(where, flag <= 1, "a flag is " + std::to_string(flag) + "; expected 0 or 1");
  }
  require(where, terms.max_objects >= 1 && terms.max_objects <= max_reserved,
          std::to_string(terms.max_objects) + " objects at most; expected 1 to " + std::to_string(max_reserved));
  return terms;
}

std::vector<std::byte> pack_assignment(const AssignmentRecord& record, std::span<const PeerRecord> peers) {
  std::vector<std::byte> bytes(sizeof record + peers.size_bytes());
  std::memcpy(bytes.data(), &record, sizeof record);
  std::memcpy(bytes.data() + sizeof record, peers.data(), peers.size_bytes());
  return bytes;
}

Assignment unpack_assignment(std::span<const std::byte> bytes, const WorldTermsRecord& terms) {
  constexpr const char* where = "the assignment by the World";
  const auto assignment =
      copy_of<AssignmentRecord>(where, bytes.first(std::min(bytes.size(), sizeof(AssignmentRecord))));
  require(where, assignment.count >= 1 && assignment.count <= facade::max_nodes,
          std::to_string(assignment.count) + " nodes; expected 1 to " + std::to_string(facade::max_nodes));
  require(where, assignment.number < assignment.count,
          "number " + std::to_string(assignment.number) + " of " + std::to_string(assignment.count) + " nodes");
  require(where, assignment.objects <= max_reserved && assignment.pairs <= max_reserved,
          std::to_string(assignment.objects) + " objects and " + std::to_string(assignment.pairs) +
              " pairs to reserve; expected at most " + std::to_string(max_reserved));
  // After nodes have left, the map has more nodes than the World, until the World sends another before the frame.
  require(where, assignment.map_nodes >= 1 && assignment.map_nodes <= facade::max_nodes,
          "a map of " + std::to_string(assignment.map_nodes) + " nodes; expected 1 to " +
              std::to_string(facade::max_nodes));
  const regions::CellGrid grid = grid_of(terms);
  require(
      where, assignment.map_words >= grid.cells() && assignment.map_words <= regions::RegionMap::max_words(grid),
      "a map of " + std::to_string(assignment.map_words) + " entries for " + std::to_string(grid.cells()) + " cells");
  const std::span<const std::byte> rest = bytes.subspan(sizeof assignment);
  require(where, rest.size() == std::size_t{assignment.count} * sizeof(PeerRecord),
          std::to_string(rest.size()) + " bytes of peers; expected " + std::to_string(assignment.count) + " records");
  std::vector<PeerRecord> peers(assignment.count);
  std::memcpy(peers.data(), rest.data(), rest.size());
  for (const PeerRecord& peer : peers) {
    require(where, peer.address.port <= 0xffff, "a peer's port is " + std::to_string(peer.address.port));
    require(where, (peer.incarnation != 0) == peer.address.is_known(), "a peer has only an incarnation or an address");
  }
  require(where, peers[assignment.number].incarnation == 0, "the node is its own peer");
  return {assignment, std::move(peers)};
}

regions::RegionMap unpack_regions(std::span<const std::byte> bytes, const WorldTermsRecord& terms,
                                  const AssignmentRecord& assignment) {
  constexpr const char* where = "the World's region map";
  const regions::CellGrid grid = grid_of(terms);
  require(where, bytes.size() == std::size_t{assignment.map_words} * sizeof(std::uint32_t),
          std::to_string(bytes.size()) + " bytes; expected " + std::to_string(assignment.map_words) + " entries");
  std::vector<std::uint32_t> table(assignment.map_words);
  if (!table.empty()) {
    std::memcpy(table.data(), bytes.data(), bytes.size());
  }
  require(where, regions::RegionMap::is_table(table, grid, assignment.map_nodes),
          "not every cell, or part of one, is owned by one of " + std::to_string(assignment.map_nodes) + " nodes");
  regions::RegionMap map(grid, 1);
  map.assign(table, assignment.map_nodes, assignment.epoch);
  return map;
}

std::vector<std::byte> pack_shape(const ShapeDescription& shape) {
  std::vector<std::byte> bytes;
  put(bytes, static_cast<std::uint64_t>(shape.index()));
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    put(bytes, *sphere);
  } else if (const auto* box = std::get_if<Box>(&shape)) {
    put(bytes, *box);
  } else if (const auto* capsule = std::get_if<Capsule>(&shape)) {
    put(bytes, *capsule);
  } else if (const auto* hull = std::get_if<ConvexHull>(&shape)) {
    put_list(bytes, hull->points);
  } else if (const auto* mesh = std::get_if<TriangleMesh>(&shape)) {
    put_list(bytes, mesh->vertices);
    put_list(bytes, mesh->indices);
  }
  return bytes;
}

ShapeDescription unpack_shape(std::span<const std::byte> bytes, ShapeNumber shape,
                              const std::function<std::shared_ptr<const SupportFunction>(ShapeId)>& support) {
  Unpacking unpacking(bytes, shape);
  ShapeDescription description;
  switch (static_cast<ShapeKind>(unpacking.take<std::uint64_t>())) {
    case ShapeKind::sphere:
      description = unpacking.take<Sphere>();
      break;
    case ShapeKind::box:
      description = unpacking.take<Box>();
      break;
    case ShapeKind::capsule:
      description = unpacking.take<Capsule>();
      break;
    case ShapeKind::hull:
      description = ConvexHull{unpacking.take_list<Vec3f>()};
      break;
    case ShapeKind::mesh: {
      TriangleMesh mesh;
      mesh.vertices = unpacking.take_list<Vec3f>();
      mesh.indices = unpacking.take_list<std::uint32_t>();
      description = std::move(mesh);
      break;
    }
    case ShapeKind::support: {
      SupportShape function{support ? support(ShapeId(shape)) : nullptr};
      if (function.function == nullptr) {
        throw Error("shape " + std::to_string(shape) +
                    " is a support function, which is not sent: supply it with NodeServiceConfig::support");
      }
      description = std::move(function);
      break;
    }
    default:
      throw Error("shape " + std::to_string(shape) + " has a kind that this version does not support");
  }
  unpacking.end();
  return description;
}

}  // namespace ringfence::dds
