#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "broad_phase/box_set.hpp"
#include "broad_phase/crowds.hpp"
#include "broad_phase/kernels.hpp"
#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// The boxes that have a crowd (see crowds.hpp), in sets of their own: those of one crowd that do not collide with each
/// other are never compared, however many of them are on one spot.
///
/// The crowds with the most such boxes, up to `most_crowds`, have two sets each. All boxes of the other crowds are in
/// one more set, whose pairs have to be filtered.
///
/// Memory: grows with the number of boxes and crowds, and is kept.
class CrowdSets {
 public:
  static constexpr std::size_t most_crowds = 16;

  /// Takes the slots that have a crowd out of `slots`, and returns the number
  /// of the others, which keep their order.
  std::size_t take(std::span<const std::uint32_t> crowds, std::span<std::uint32_t> slots);
  bool empty() const noexcept { return taken_.empty(); }
  /// The slots that take() has taken.
  std::span<const std::uint64_t> taken() const noexcept { return taken_; }
  static std::uint32_t slot_of(std::uint64_t taken) noexcept { return static_cast<std::uint32_t>(taken); }

  /// Builds the sets of the slots that take() has taken. The arguments are as
  /// in BoxSet::build(). `others` are the slots of a set that each() compares them with.
  void build(const Kernels& kernels, std::span<const geometry::Bounds> bounds, const std::uint8_t* layers,
             const std::uint32_t* masks, std::span<const std::uint32_t> others);
  /// Whether the pairs of the last set have to be filtered.
  bool needs_filter() const noexcept { return rest_is_used_; }

  /// Calls within(set) for each set whose boxes collide with each other, then
  /// between(p, q) for each two sets whose boxes do.
  template <class Within, class Between>
  void list_pairs(Within within, Between between) {
    for (std::size_t i = 0; i < used_; ++i) {
      if (!parts_[i]->excess) within(parts_[i]->boxes);
    }
    for (std::size_t i = 0; i < used_; ++i) {
      for (std::size_t j = i + 1; j < used_; ++j) {
        const Part &p = *parts_[i], &q = *parts_[j];
        if (p.crowd != q.crowd && geometry::touch(p.reach, q.reach)) between(parts_[i]->boxes, parts_[j]->boxes);
      }
    }
  }
  /// Calls visit(set, near) for each set. `near` has those of the other boxes that can be in a pair with a box of the
  /// set; null: all of them.
  template <class Visit>
  void each(Visit visit) {
    for (std::size_t i = 0; i < used_; ++i) visit(parts_[i]->boxes, parts_[i]->has_near ? &parts_[i]->near : nullptr);
  }

 private:
  static constexpr std::uint32_t many_crowds = 0xffffffff;  ///< crowds have 31 bits
  struct Part {
    BoxSet boxes{0};
    std::uint32_t crowd = 0;   ///< without excess_bit; or many_crowds
    bool excess = false;       ///< its boxes do not collide with each other
    geometry::Bounds reach{};  ///< around all boxes
    BoxSet near{0};            ///< of the other boxes, those that touch `reach`
    bool has_near = false;
  };
  /// The boxes of a crowd in taken_: first those that collide with each other.
  struct Crowd {
    std::size_t first, excess, end;
  };

  void list_crowds();
  void add_part(const Kernels& kernels, std::span<const geometry::Bounds> bounds, const std::uint8_t* layers,
                const std::uint32_t* masks, std::uint32_t crowd, bool excess);
  void find_near(Part& part, const Kernels& kernels, std::span<const geometry::Bounds> bounds,
                 const std::uint8_t* layers, const std::uint32_t* masks);

  std::vector<std::uint64_t> taken_;  ///< crowd, with its excess bit lowest, and
                                      ///< slot; ascending after build()
  std::vector<Crowd> crowds_;
  std::vector<std::uint32_t> slots_;  ///< of one set
  std::span<const std::uint32_t> others_;
  std::vector<std::unique_ptr<Part>> parts_;
  std::size_t used_ = 0;  ///< parts of this build
  bool rest_is_used_ = false;
};

}  // namespace ringfence::broad_phase
