#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/host/host.hpp"
#include "queries/touched_boxes.hpp"

namespace ringfence::nodes {

/// The states of others that the user nodes of a thread have read in one frame, as spans of the publications: one user
/// node after another.
using SeenList = base::FlatList<std::span<const PublishedState>>;

/// What one user node has read: a part of a SeenList.
struct SeenPart {
  const SeenList* list = nullptr;  ///< null: nothing
  std::uint32_t first = 0;
  std::uint32_t count = 0;

  std::span<const std::span<const PublishedState>> spans() const noexcept {
    return list == nullptr ? std::span<const std::span<const PublishedState>>() : list->span().subspan(first, count);
  }
};

/// The objects that a user node has added to the UserStates of its thread: those with these numbers, in the order of
/// adding. It does not read them.
struct OwnStates {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

/// Reads for the user nodes of a thread what others have published near their avatars.
///
/// Descends the tree of each publication with the boxes around the avatars, and lists the states of the boxes that
/// these touch, so also some states that are farther away.
///
/// Cost: proportional to the avatars and to the boxes near them, not to the number of users.
/// Threads: belongs to the thread that steps the user nodes; others read the lists of a frame when it is complete.
/// Memory: a span for each run of boxes near an avatar; a third of a byte for each state of the largest publication.
class InterestReader {
 public:
  /// `interest`: metres around avatars; 0: nothing is read. The publications outlive the reader.
  InterestReader(const Publications& publications, double interest) noexcept
      : publications_(publications), interest_(interest) {}
  InterestReader(const InterestReader&) = delete;
  InterestReader& operator=(const InterestReader&) = delete;

  /// Before the first read() of a frame, when the server has allowed reading. What was read two frames ago is
  /// discarded. `own`: the publication of the thread.
  void begin(std::uint64_t frame, const HostPublication* own);
  /// The frame of the last begin().
  std::uint64_t frame() const noexcept { return frame_; }
  /// Reads near the avatars of `host`, each state once, except `own`.
  SeenPart read(const Host& host, const OwnStates& own);

 private:
  /// A publication that has states in this frame.
  struct Source {
    geometry::CornerBox bounds;
    const queries::BoxTree* tree;
    std::span<const PublishedState> states;
    std::span<const std::uint32_t> leaf_begins;
    bool is_own;
  };

  void start_list();
  void list_sources();
  void index_sources();
  void list_boxes(const Host& host);
  void list_own_places(const OwnStates& own);
  void list_near(const geometry::CornerBox& box);
  void read_one_box();
  void read_one_box(const Source& source);
  void read_union(const Source& source);
  void mark(const queries::BoxRange& range) noexcept;
  void read_marked();
  void read_range(const queries::BoxRange& range);
  void add(std::uint32_t first, std::uint32_t end);
  void select(const Source& source) noexcept;

  const Publications& publications_;
  double interest_;
  std::uint64_t frame_ = 0;
  const HostPublication* own_ = nullptr;
  std::vector<Source> sources_;             ///< of this frame
  queries::BoxTree source_tree_;            ///< of their bounds; box i is that of source i
  SeenList seen_[2];                        ///< by parity of the frame
  std::size_t seen_room_ = 0;               ///< for spans, of each of them when it is started
  std::vector<geometry::CornerBox> boxes_;  ///< around the avatars
  queries::TouchedBoxes touched_;
  std::vector<const Source*> near_;    ///< that one box touches
  std::vector<std::uint64_t> marked_;  ///< of several boxes: one bit for each box of the tree that one of them touches
  std::vector<std::uint32_t> own_places_;
  // Of the publication that is read:
  std::span<const PublishedState> states_;
  std::span<const std::uint32_t> leaf_begins_;
  std::span<const std::uint32_t> skipped_;  ///< places that the user node does not read, ascending
};

}  // namespace ringfence::nodes
