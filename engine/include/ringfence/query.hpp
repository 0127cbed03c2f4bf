#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "ringfence/ids.hpp"
#include "ringfence/object.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/status.hpp"

/// Queries about the objects of one complete frame; Snapshot answers them. Metres, world axes.
///
/// Surfaces belong to shapes: touching counts. Disabled objects are not found. An answer depends on the query and on
/// the frame only: it has the same bits at any node count, in any deployment, on any machine, for any number of
/// threads.
namespace ringfence {

/// The bit of a category in QueryFilter::categories.
constexpr std::uint32_t bit_of(Category category) noexcept { return 1u << static_cast<unsigned>(category); }

/// Which objects a query may find. Default: all.
struct QueryFilter {
  std::uint32_t layers = 0xffffffffu;      ///< bit i: objects of layer i
  std::uint32_t categories = 0xffffffffu;  ///< bits by bit_of()
  std::uint32_t except_group = 0;          ///< leaves out the objects of this group; 0: none
  ObjectId except{};                       ///< leaves out this object; null: none
};

/// The frame that a query asks about: a number as FrameReport::frame. Empty: the snapshot's frame. Earlier ones are
/// there as far as WorldConfig::history reaches; the answers are those that the same query had when that frame was the
/// last, bit for bit.
///
/// A number between two frames asks about the time between them: positions are interpolated linearly, orientations
/// linearly and then normalised. An object that jumps there (World::place, MotionOutput::jump), changes its shape, or
/// is absent or disabled in the later frame, stands where it was in the earlier one. One that is absent in the earlier
/// frame is not found.
using QueryFrame = std::optional<double>;

/// A ray from `start` to `start + displacement`. Without a displacement it asks what contains the start.
struct RayQuery {
  Vec3d start;
  Vec3d displacement;
  QueryFilter filter{};
  QueryFrame frame{};
};

/// A convex shape whose origin moves from `start` by `displacement`, with a fixed orientation. Without a displacement
/// it asks what the shape overlaps.
struct SweepQuery {
  ShapeId shape;  ///< registered with World::add_shape; no mesh
  Pose start;
  Vec3d displacement;
  QueryFilter filter{};
  QueryFrame frame{};
};

/// A convex shape at a pose: what does it overlap or touch?
struct OverlapQuery {
  ShapeId shape;  ///< as in SweepQuery
  Pose pose;
  QueryFilter filter{};
  QueryFrame frame{};
};

/// The object nearest to a point, if it is not farther than `distance`.
struct NearestQuery {
  Vec3d point;
  double distance = std::numeric_limits<double>::infinity();  ///< metres, >= 0
  QueryFilter filter{};
  QueryFrame frame{};
};

/// What a query finds at one object.
struct Hit {
  /// Of the query: ok; not_finite, not_unit, bad_number, unknown_shape, bad_shape or frame_expired if it is refused;
  /// out_of_order if the Snapshot is empty; out_of_memory if there is none for an index or a batch. Then it finds
  /// nothing.
  Status status = Status::ok;
  std::uint32_t child = 0;      ///< part of a compound shape; reserved: always 0
  std::uint32_t triangle = 0;   ///< of a mesh: its number, from 0, without triangles of zero area; otherwise 0
  ObjectId object;              ///< null: nothing is found
  std::uint64_t user_data = 0;  ///< ObjectSpec::user_data
  /// Rays and sweeps: where on the displacement, 0 to 1. 0 if the query starts inside the object, or has no
  /// displacement.
  double fraction = 0;
  double distance = 0;  ///< nearest: metres from the point to the object; 0 inside
  /// Rays: start + fraction * displacement. Sweeps: where the surfaces touch. Nearest: the object's nearest point.
  /// Starting inside: the start. Overlaps: 0.
  Vec3d point;
  /// Rays and sweeps: unit vector from the object towards where the query comes from; -displacement / |displacement| if
  /// the query starts inside; 0 without a displacement. Otherwise 0.
  Vec3d normal;

  /// Whether an object is found.
  constexpr explicit operator bool() const noexcept { return static_cast<bool>(object); }
  constexpr bool operator==(const Hit&) const noexcept = default;
};

/// Whether a ray hits anything.
struct AnyHit {
  Status status = Status::ok;  ///< as in Hit
  bool hit = false;
  constexpr explicit operator bool() const noexcept { return hit; }
  constexpr bool operator==(const AnyHit&) const noexcept = default;
};

/// Lists of hits, one for each query of a batch. Meant to be used again: a batch allocates only if it needs more memory
/// than any before.
class HitLists {
 public:
  /// Number of queries of the last batch.
  std::size_t size() const noexcept { return lists_.size(); }
  /// The hits of one query. Rays and sweeps: in order of (fraction, number); overlaps: in order of number. Each object
  /// is in it once, with its first hit.
  std::span<const Hit> operator[](std::size_t query) const noexcept {
    return {hits_.data() + lists_[query].first, lists_[query].size};
  }
  /// As Hit::status: why a list may be empty.
  Status status(std::size_t query) const noexcept { return lists_[query].status; }
  /// The hits of all lists: one list after another, but not in the order of the queries if some ask about other frames.
  std::span<const Hit> all() const noexcept { return hits_; }

  /// Replaces the contents by this many empty lists with Status::ok.
  void start(std::size_t queries) {
    hits_.clear();
    lists_.assign(queries, List());
  }
  /// Appends an empty hit to a list, and returns it. Precondition: it is the list of the call before, or empty.
  Hit& add(std::size_t query) {
    List& list = lists_[query];
    if (list.size++ == 0) list.first = hits_.size();
    return hits_.emplace_back();
  }
  void set_status(std::size_t query, Status status) noexcept { lists_[query].status = status; }

 private:
  struct List {
    std::size_t first = 0;  ///< in hits_
    std::uint32_t size = 0;
    Status status = Status::ok;
  };
  std::vector<Hit> hits_;
  std::vector<List> lists_;
};

/// What queries cost. It depends on the machine's vector width and on what the index looks like; answers do not.
struct QueryWork {
  std::uint64_t queries = 0;
  std::uint64_t boxes = 0;  ///< bounding boxes that were tested, of objects and of groups of them
  std::uint64_t tests = 0;  ///< exact tests of one query against one object
  /// Exact tests that a support function ended, because it threw or returned an invalid point. The object is not in the
  /// answer.
  std::uint64_t failed_supports = 0;

  constexpr QueryWork& operator+=(const QueryWork& other) noexcept {
    queries += other.queries;
    boxes += other.boxes;
    tests += other.tests;
    failed_supports += other.failed_supports;
    return *this;
  }
};

}  // namespace ringfence
