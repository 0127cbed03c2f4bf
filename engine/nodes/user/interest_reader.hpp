#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/host/host.hpp"

namespace ringfence::nodes {

/// What a user node reads of the others: the states that they have published near its avatars.
///
/// Cost: proportional to its avatars, to the cells near them and to the states there, not to the number of users.
/// Threads: belongs to its user node. Memory: for a user with several avatars, one bit for each cell of the grid.
class InterestReader {
 public:
  /// `interest`: metres around its avatars; 0: it reads nothing. The publications outlive the reader.
  InterestReader(const Publications& publications, UserNumber user, double interest) noexcept
      : publications_(publications), user_(user), interest_(interest) {}

  /// Reads what was published in `frame` near the avatars of `host`. The server has allowed it.
  void read(const Host& host, std::uint64_t frame);
  /// Prefetches what read() writes for a user with one avatar.
  void prefetch_arrays() const noexcept {
    base::prefetch_for_read(boxes_.data());
    base::prefetch_for_read(seen_[0].data());
    base::prefetch_for_read(seen_[1].data());
  }
  /// What was read in that frame, each state once; as spans of the publications.
  std::span<const std::span<const link::PublishedState>> seen(std::uint64_t frame) const noexcept {
    return seen_[frame & 1];
  }

 private:
  /// Cells with consecutive numbers, both ends included.
  struct CellSpan {
    std::uint32_t first, last;
  };
  void list_boxes(const Host& host);
  /// Calls read(published) for each publication that the index of user nodes does not list.
  template <class Read>
  void each_publication(Read read) const;
  void read_one(const regions::CellBox& box);
  void read_union();
  void want(const CellSpan& cells) noexcept;
  void list_ranges();
  void read_ranges(const Published& published);
  void read_indexed(const CellSpan& cells);
  void read_box(const Published& published, const regions::CellBox& box);
  void read_rows(const Published& published, const regions::CellBox& box);
  /// Reads the cells of a publication for which wanted(cell) returns true.
  template <class Wanted>
  void read_cells(const Published& published, Wanted wanted);

  const Publications& publications_;
  UserNumber user_;
  double interest_;
  std::uint64_t frame_ = 0;
  std::vector<std::span<const link::PublishedState>> seen_[2];
  std::vector<regions::CellBox> boxes_;  ///< around the avatars
  std::vector<std::uint64_t> wanted_;    ///< of several boxes: one bit for each cell
  std::vector<CellSpan> ranges_;         ///< the same, in order
};

}  // namespace ringfence::nodes
