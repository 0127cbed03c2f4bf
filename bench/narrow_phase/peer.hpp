#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "narrow_phase/crowd.hpp"

namespace ringfence::narrow_phase_bench {

/// A library that tests the candidates of a crowd for contact, with normal and depth. Everything that can be prepared
/// is prepared outside the timed call: shapes, transforms, objects that live as long as a pair.
class Peer {
 public:
  virtual ~Peer() = default;

  /// Selects the pairs (of Crowd::pairs) for the next tests. Not timed.
  void select(std::vector<std::uint32_t> pairs) {
    selected_ = std::move(pairs);
    touches_.assign(selected_.size(), 0);
    selected();
  }

  /// Tests the selected pairs. This is timed.
  virtual void test() = 0;

  /// Which of the selected pairs were in contact in the last test. Not timed.
  virtual std::span<const std::uint8_t> touches() { return touches_; }

 protected:
  virtual void selected() {}

  std::vector<std::uint32_t> selected_;
  std::vector<std::uint8_t> touches_;
};

std::unique_ptr<Peer> make_ringfence(const Crowd& crowd);
/// For meshes it reports all contacts of a pair, since it cannot report only the deepest.
std::unique_ptr<Peer> make_fcl(const Crowd& crowd);
/// Only whether a pair is in contact: stops at the first triangles that are.
std::unique_ptr<Peer> make_fcl_first(const Crowd& crowd);
std::unique_ptr<Peer> make_bullet(const Crowd& crowd);
std::unique_ptr<Peer> make_libccd(const Crowd& crowd);

}  // namespace ringfence::narrow_phase_bench
