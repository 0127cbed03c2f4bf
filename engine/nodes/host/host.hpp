#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/host/frame_inputs.hpp"
#include "nodes/host/host_contacts.hpp"
#include "nodes/host/host_senses.hpp"
#include "nodes/host/hosted_objects.hpp"
#include "nodes/host/model_failures.hpp"
#include "nodes/host/move_scratch.hpp"
#include "ringfence/motion_model.hpp"

namespace ringfence::nodes {

/// Numbers of refused outputs of the model in the last move, by reason. The objects did not move.
struct HostRefusals {
  std::uint64_t model_failed = 0, not_finite = 0, not_unit = 0;
};

/// The objects that one role hosts, and their motion: S(k) from S(k-1) and C(k-1).
///
/// Used by user nodes, the server and CD nodes alike; an object's states do not depend on the role that hosts it.
/// Threads: belongs to its role. Memory: grows with the hosted objects and their contacts.
class Host : public HostedObjects {
 public:
  static constexpr std::size_t batch = 64;  ///< largest number of objects per call of the model

  /// `model` may be null (nothing moves by itself); if not, it outlives the host. `objects` is the number to reserve
  /// for. `fault` may be null; if not, it outlives the host, and the role can stop there before it calls the model.
  /// With `shares_scratch` the host is one of many that share a scratch: call use() before each move.
  Host(const MotionModel* model, std::size_t objects, FaultPoint* fault = nullptr, bool shares_scratch = false);

  /// The next move uses `scratch`. changed() and differs() are in it: valid until another host moves with it.
  void use(MoveScratch& scratch) noexcept { scratch_ = &scratch; }

  /// Whether the model reads contacts; if not, they are not sorted here.
  bool uses_contacts() const noexcept { return uses_contacts_; }
  /// The contacts that the model reads.
  HostContacts& contacts() noexcept { return contacts_; }
  const HostContacts& contacts() const noexcept { return contacts_; }
  /// Sets whether the next move lists all hosted objects in changed().
  void list_all(bool all) noexcept { list_all_next_ = all; }
  /// Sets for all moves whether changed() also lists the objects with flag_host_owned that do not differ; at first it
  /// does.
  void list_host_owned(bool all) noexcept { lists_host_owned_ = all; }
  /// In the next move() the object takes `pose` and is present, whatever the model computes. Applies to one frame.
  void steer(ObjectNumber number, const Pose& pose) { steered_.push_back({number, pose}); }

  /// In the next move, and only in that, the model receives the input of the object, if it is hosted then.
  void give_input(const ObjectInput& input) { frame_inputs_.add(input); }

  /// From now on the model may ask queries within `distance` metres, if that is above 0. Once.
  void sense(double distance);
  /// The frame that the model may ask about in the next move; see HostSenses::set_frame(). Ignored without sense().
  void set_sensed(const queries::RecordedFrame* frame) noexcept {
    if (senses_ != nullptr) senses_->set_frame(frame);
  }

  /// Computes S(frame) of all hosted objects from S(frame - 1) and C(frame - 1). Afterwards changed() lists the indices
  /// of the objects whose pose, presence or state differs, and others: see list_all() and list_host_owned(). Objects
  /// for which the model throws or returns an invalid pose do not move: see refusals().
  void move(std::uint64_t frame);
  /// The same in batches, so that changes are processed while they are in the cache. Call begin_move(), then
  /// move_next() until it returns false. After each call changed() lists the objects of that batch. Precondition: no
  /// steer() since the last move.
  void begin_move(std::uint64_t frame);
  bool move_next();
  std::span<const std::uint32_t> changed() const noexcept { return scratch_->changed.span(); }
  /// Parallel to changed(), one byte each: whether the object differs.
  std::span<const std::uint8_t> differs() const noexcept { return scratch_->differs.span(); }
  const HostRefusals& refusals() const noexcept { return refusals_; }
  /// Prefetches the objects that move() accesses, for a host of few objects.
  void prefetch_move() const noexcept {
    prefetch_first();
    base::prefetch_for_read(states_.data());
    base::prefetch_for_read(touched_.data());
  }
  /// Adds the number of hosted objects, and those refusals.
  void report(messages::NodeFrameStats& stats) const noexcept;
  /// The frame of the last move.
  std::uint64_t frame() const noexcept { return frame_; }
  /// Why the model threw in the last move.
  const ModelFailures& failures() const noexcept { return failures_; }

 private:
  void end_move() noexcept;
  void move_batches(std::size_t first, std::size_t end);
  void collect_changed(std::size_t first, std::size_t end);
  void move_batch(std::size_t first, std::size_t count);
  bool call_model(std::size_t first, std::size_t count);
  void prefetch(std::size_t i) const noexcept;
  std::span<const std::uint32_t> contacts_of(std::size_t i) const noexcept {
    return uses_contacts_ ? contacts_.of(i) : std::span<const std::uint32_t>();
  }
  void accept(std::size_t first, std::size_t count);
  bool accept(std::size_t i, const MotionOutput& output, const std::byte* next);

  const MotionModel* model_;
  FaultPoint* fault_;
  bool uses_contacts_;
  bool list_all_next_ = false;
  bool list_all_ = false;         ///< list_all() applies to this move
  bool lists_host_owned_ = true;  ///< see list_host_owned()
  HostContacts contacts_;
  struct Steered {
    ObjectNumber number;
    Pose pose;
  };
  std::vector<Steered> steered_;
  FrameInputs frame_inputs_;
  std::unique_ptr<HostSenses> senses_;  ///< null: the model may not ask queries
  std::uint64_t frame_ = 0;             ///< frame being moved
  std::size_t next_moved_ = 0;          ///< first object of the next move_next()
  HostRefusals refusals_;
  ModelFailures failures_;
  std::unique_ptr<MoveScratch> own_scratch_;  ///< null: the host shares that of its thread
  MoveScratch* scratch_ = nullptr;
};

}  // namespace ringfence::nodes
