#include <algorithm>

#include "narrow_phase/peer.hpp"

namespace ringfence::narrow_phase_bench {
namespace {

class Ringfence final : public Peer {
 public:
  explicit Ringfence(const Crowd& crowd) : crowd_(crowd), narrow_phase_(*crowd.shapes) {}

  void test() override { contacts_ = narrow_phase_.test(crowd_.bodies, given_); }

  std::span<const std::uint8_t> touches() override {
    std::fill(touches_.begin(), touches_.end(), std::uint8_t{0});
    for (const narrow_phase::PairContact& contact : contacts_) touches_[contact.pair] = 1;
    return touches_;
  }

 protected:
  void selected() override {
    given_.clear();
    for (const std::uint32_t pair : selected_) given_.push_back(crowd_.pairs[pair]);
    contacts_ = {};
  }

 private:
  const Crowd& crowd_;
  narrow_phase::NarrowPhase narrow_phase_;
  std::vector<geometry::CandidatePair> given_;
  std::span<const narrow_phase::PairContact> contacts_;
};

}  // namespace

std::unique_ptr<Peer> make_ringfence(const Crowd& crowd) { return std::make_unique<Ringfence>(crowd); }

}  // namespace ringfence::narrow_phase_bench
