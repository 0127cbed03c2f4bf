#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "narrow_phase/crowd.hpp"

namespace ringfence::narrow_phase_bench {

/// A library that answers the candidates of a crowd: which touch, with normal and depth. Everything that can be
/// prepared is prepared outside the timed call: shapes, transforms, objects that live as long as a pair does.
class Peer {
 public:
  virtual ~Peer() = default;

  /// Says which of Crowd::pairs the next tests are of. Not timed.
  void select(std::vector<std::uint32_t> pairs) {
    selected_ = std::move(pairs);
    touches_.assign(selected_.size(), 0);
    selected();
  }

  /// Tests the selected pairs. This is what is timed.
  virtual void test() = 0;

  /// Which of the selected pairs touch, by the last test. Not timed.
  virtual std::span<const std::uint8_t> touches() { return touches_; }

 protected:
  virtual void selected() {}

  std::vector<std::uint32_t> selected_;
  std::vector<std::uint8_t> touches_;
};

std::unique_ptr<Peer> make_ringfence(const Crowd& crowd);
/// For meshes all contacts of a pair, as the deepest is among them.
std::unique_ptr<Peer> make_fcl(const Crowd& crowd);
/// Whether a pair touches and no more: it stops at the first triangles that do.
std::unique_ptr<Peer> make_fcl_first(const Crowd& crowd);
std::unique_ptr<Peer> make_bullet(const Crowd& crowd);
std::unique_ptr<Peer> make_libccd(const Crowd& crowd);

}  // namespace ringfence::narrow_phase_bench
