#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/host/host.hpp"

namespace ringfence::nodes {

/// The states of others that the user nodes of a thread have read in one frame, as spans of the publications: one user
/// node after another.
using SeenList = base::FlatList<std::span<const link::PublishedState>>;

/// What one user node has read: a part of a SeenList.
struct SeenPart {
  const SeenList* list = nullptr;  ///< null: nothing
  std::uint32_t first = 0;
  std::uint32_t count = 0;

  std::span<const std::span<const link::PublishedState>> spans() const noexcept {
    return list == nullptr ? std::span<const std::span<const link::PublishedState>>()
                           : list->span().subspan(first, count);
  }
};

/// The states that a user node has added to the publication of its thread: those with these numbers, in the order of
/// adding. It does not read them.
struct OwnStates {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

/// Reads for the user nodes of a thread what others have published near their avatars.
///
/// Cost: proportional to the avatars, to the cells near them and to the states there, not to the number of users.
/// Threads: belongs to the thread that steps the user nodes; others read the lists of a frame when it is complete.
/// Memory: a span for each row of cells with states near an avatar; for a user with several avatars, one bit for each
/// cell of the grid.
class InterestReader {
 public:
  /// `interest`: metres around avatars; 0: nothing is read. The publications outlive the reader.
  InterestReader(const Publications& publications, double interest) noexcept
      : publications_(publications), interest_(interest) {}
  InterestReader(const InterestReader&) = delete;
  InterestReader& operator=(const InterestReader&) = delete;

  /// Before the first read() of a frame. What was read two frames ago is discarded. `own`: the publication of the
  /// thread.
  void begin(std::uint64_t frame, const Published* own) noexcept {
    frame_ = frame;
    own_ = own;
    seen_[frame_ & 1].clear();
  }
  /// The frame of the last begin().
  std::uint64_t frame() const noexcept { return frame_; }
  /// Reads near the avatars of `host`, each state once, except `own`. The server has allowed it.
  SeenPart read(const Host& host, const OwnStates& own);

 private:
  /// Cells with consecutive numbers, both ends included.
  struct CellSpan {
    std::uint32_t first, last;
  };
  void list_boxes(const Host& host);
  void list_own_places(const OwnStates& own);
  /// Calls read(published) for each valid publication.
  template <class Read>
  void each_publication(Read read);
  void read_union();
  void want(const CellSpan& cells) noexcept;
  void list_ranges();
  void read_ranges(const Published& published);
  void read_box(const Published& published, const regions::CellBox& box);
  void read_rows(const Published& published, const regions::CellBox& box);
  /// Reads the cells of a publication for which wanted(cell) returns true.
  template <class Wanted>
  void read_cells(const Published& published, Wanted wanted);
  void add(std::span<const link::PublishedState> states);
  void add_if_any(std::span<const link::PublishedState> states);

  const Publications& publications_;
  double interest_;
  std::uint64_t frame_ = 0;
  const Published* own_ = nullptr;
  SeenList seen_[2];                     ///< by parity of the frame
  std::vector<regions::CellBox> boxes_;  ///< around the avatars
  std::vector<std::uint64_t> wanted_;    ///< of several boxes: one bit for each cell
  std::vector<CellSpan> ranges_;         ///< the same, in order
  /// Places in `own_` that the user node does not read, ascending; empty while another publication is read.
  std::span<const std::uint32_t> skipped_;
  std::vector<std::uint32_t> own_places_;
  const link::PublishedState* first_state_ = nullptr;  ///< of the publication that is read
};

}  // namespace ringfence::nodes
