#include "nodes/server/contacts/contact_ledger.hpp"

#include <algorithm>
#include <cstring>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/server/contacts/ledger_node.hpp"

namespace ringfence::nodes {
namespace {

using namespace ledger_test;

bool same(const Contact& p, const Contact& q) { return std::memcmp(&p, &q, sizeof p) == 0; }

/// Produces the input of a ledger frame by frame and checks its output. There is no world and there are no roles.
class LedgerTest {
 public:
  enum class Form { sending, sharing };

  /// `deepest`: as WorldConfig::deepest_contacts. `frames`: how many the ledger keeps.
  LedgerTest(unsigned seed, Form form, std::uint32_t deepest = 0, std::size_t frames = 2)
      : random_(seed),
        form_(form),
        large_numbers_(seed % 2 == 0),
        deepest_(deepest),
        keeps_two_(frames == 2),
        ledger_(3, 16, deepest, frames) {
    for (int i = 0; i < 3; ++i) join();
  }

  void frame() {
    choose_contacts();
    ledger_.resize(nodes_.size());
    for (NodeNumber node = 0; node < nodes_.size(); ++node) {
      if (!nodes_[node]->free && !std::exchange(nodes_[node]->joined, true)) ledger_.join(node, frame_);
    }
    ledger_.begin(frame_);
    rows_ = rows_of(frame_, large_numbers_);
    const std::vector<ObjectRow>& rows = rows_;
    std::vector<std::vector<const ExpectedContact*>> runs(nodes_.size());
    for (const auto& [key, truth] : found_) {
      runs[truth.finder].push_back(&truth);
      // Two nodes find the pair, as after a bug elsewhere.
      if (duplicates_allowed && random_() % 16 == 0) {
        runs[node_from(truth.finder + 1)].push_back(&truth);
        ++surplus_;
      }
    }
    for (NodeNumber node = 0; node < nodes_.size(); ++node) {
      if (nodes_[node]->free) continue;
      nodes_[node]->find(frame_, runs[node], rows, found_before_, found_, random_);
      if (nodes_[node]->shares) {
        ledger_.receive(node, *nodes_[node]->lists);
      } else {
        send(node, runs[node], rows);
      }
      REQUIRE(ledger_.received(node) == runs[node].size());
    }
    ledger_.resolve_phases();
    unlist(runs);
    ledger_.share_out();
    phases_are_certain_ = surplus_ == 0 && surplus_before_ == 0;
    check_phases(runs);
    check_notices();
    const auto lost = write();
    check_lists();
    for (auto node = lost.rbegin(); node != lost.rend(); ++node) {
      leave(*node);
    }
    before_ = now_;
    found_before_ = found_;
    surplus_before_ = surplus_;
    ++frame_;
    if (random_() % 5 == 0) join();
    if (random_() % 7 == 0 && nodes_.size() > 1) leave(random_() % nodes_.size());
    if (random_() % 9 == 0) {
      // A new node takes the slot of another. It has no contacts of the frame before.
      leave(random_() % nodes_.size());
      join();
    }
  }

  /// The stopped threads continue and end. Then their memory is freed, or at random only by a later call.
  void continue_stopped() {
    for (Node* node : stopped_) {
      node->write();
    }
    stopped_.clear();
    if (random_() % 2 == 0) {
      ledger_.free_abandoned();
    }
  }

  bool duplicates_allowed = false;
  bool stops = false;              ///< the threads of lost nodes may stop while they write
  std::size_t written_again = 0;   ///< frames in which the lists were written again because a thread stopped
  std::size_t waits = 0;           ///< how often the ledger waited for a lost node that was writing
  std::size_t unlisted = 0;        ///< contacts that were found and not listed
  std::size_t for_users_only = 0;  ///< frames in which fewer ended contacts were listed for users than ended

 private:
  void join() {
    auto slot = std::find_if(nodes_.begin(), nodes_.end(), [](const auto& node) { return node->free; });
    slot = slot != nodes_.end() ? slot : nodes_.insert(slot, nullptr);
    *slot = std::make_unique<Node>();
    (*slot)->shares = form_ == Form::sharing;
  }
  /// The first slot from this one on, in a circle, that has a node.
  std::size_t node_from(std::size_t slot) const {
    while (nodes_[slot % nodes_.size()]->free) ++slot;
    return slot % nodes_.size();
  }
  void leave(std::size_t node) {
    if (node >= nodes_.size() || nodes_[node]->free) {
      return;
    }
    gone_.push_back(std::move(nodes_[node]));
    nodes_[node] = std::make_unique<Node>();
    nodes_[node]->free = true;
    while (!nodes_.empty() && nodes_.back()->free) nodes_.pop_back();
    if (nodes_.empty()) join();
  }
  NodeContacts* shared_of(std::size_t node) const { return nodes_[node]->shares ? nodes_[node]->lists.get() : nullptr; }

  // As a CD node does that does not share memory with the server.
  void send(NodeNumber node, const std::vector<const ExpectedContact*>& own, const std::vector<ObjectRow>& rows) {
    const ContactColumns columns(rows);
    const ContactObjects objects{rows, origins_, columns.numbers, columns.marks};
    for (const ExpectedContact* truth : own) {
      messages::CollisionRecord record;
      record.slot_a = truth->slot_a;
      record.slot_b = truth->slot_b;
      record.depth = truth->contact.depth;
      record.normal = truth->contact.normal;
      record.point = to_float(truth->contact.point - rows[truth->slot_a].pose.position);
      REQUIRE(ledger_.receive(node, record, objects));
    }
    const NodeContacts& lists = *nodes_[node]->lists;
    const auto flags = [](std::uint32_t ended, bool at_border) {
      return ended | (at_border ? messages::change_at_border : 0u);
    };
    for (const std::uint32_t position : lists.beginning) {
      const bool at_border = std::any_of(lists.border_beginning.begin(), lists.border_beginning.end(),
                                         [&](const BorderContact& one) { return one.position == position; });
      REQUIRE(ledger_.receive(node, messages::ChangeRecord{lists.keys[position], position, flags(0, at_border)}));
    }
    const auto border = lists.border_ending.span();
    for (const std::uint64_t key : lists.ending) {
      const bool at_border = std::find(border.begin(), border.end(), key) != border.end();
      REQUIRE(ledger_.receive(node, messages::ChangeRecord{key, 0, flags(messages::change_ended, at_border)}));
    }
    check_refused_changes(node, lists);
    ledger_.end_run(node, objects);
  }

  void check_refused_changes(NodeNumber node, const NodeContacts& lists) {
    const auto refuses = [&](const messages::ChangeRecord& record) { return !ledger_.receive(node, record); };
    const auto count = static_cast<std::uint32_t>(lists.keys.size());
    REQUIRE(refuses({1, count, 0}));
    REQUIRE((count == 0 || refuses({lists.keys[0] + 1, 0, 0})));
    REQUIRE((lists.beginning.empty() || refuses({lists.keys[lists.beginning[0]], lists.beginning[0], 0})));
    REQUIRE((lists.ending.size() < 2 || refuses({lists.ending[0], 0, messages::change_ended})));
    REQUIRE(refuses({~std::uint64_t{0}, 0, messages::change_ended}));
  }

  // Most contacts persist, and the same node finds most of these again.
  void choose_contacts() {
    found_.clear();
    surplus_ = 0;
    const auto rows = rows_of(frame_, large_numbers_);
    const auto add = [&](std::uint32_t slot_a, std::uint32_t slot_b, std::size_t finder) {
      const Key key{rows[slot_a].object.number, rows[slot_b].object.number};
      ExpectedContact& truth = found_[key];
      truth = {{}, slot_a, slot_b, node_from(finder % nodes_.size())};
      truth.contact.a = key.first;
      truth.contact.b = key.second;
      truth.contact.depth = static_cast<float>(random_() % (deepest_ != 0 ? 6 : 1000));
      truth.contact.normal = {truth.contact.depth, 1, 2};
      truth.contact.point = {1.0 * slot_a, 2.0 * slot_b, 3};
      truth.contact.phase = Phase::end;  // a phase that the ledger must correct
      const auto arm = [&](std::uint32_t slot) { return to_float(truth.contact.point - rows[slot].pose.position); };
      truth.contact.arm_a = arm(slot_a);
      truth.contact.arm_b = arm(slot_b);
      truth.contact.generation_a = rows[slot_a].object.generation;
      truth.contact.generation_b = rows[slot_b].object.generation;
      truth.contact.user_data_a = origins_of(rows)[slot_a].user_data;
      truth.contact.user_data_b = origins_of(rows)[slot_b].user_data;
      truth.contact.layer_a = rows[slot_a].layer;
      truth.contact.layer_b = rows[slot_b].layer;
    };
    if (frame_ % 11 != 10) {
      for (const auto& [key, truth] : found_before_) {
        if (random_() % 8 != 0) {
          add(truth.slot_a, truth.slot_b, random_() % 6 == 0 ? random_() : truth.finder);
        }
      }
    }
    for (std::uint64_t i = random_() % 40; i > 0; --i) {
      const auto a = static_cast<std::uint32_t>(random_() % (slots - 1));
      add(a, a + 1 + static_cast<std::uint32_t>(random_() % (slots - a - 1)), random_());
    }
    now_.clear();
    for (const auto& [key, truth] : found_) {
      if (is_listed(key, truth)) now_[key] = truth;
    }
    unlisted += found_.size() - now_.size();
  }

  // By definition: how many contacts of an object are deeper, or equally deep with a lower pair.
  bool is_listed(const Key& key, const ExpectedContact& truth) const {
    const auto rank = [&](ObjectNumber number) {
      return std::count_if(found_.begin(), found_.end(), [&](const auto& other) {
        const bool deeper = other.second.contact.depth > truth.contact.depth ||
                            (other.second.contact.depth == truth.contact.depth && other.first < key);
        return deeper && (other.first.first == number || other.first.second == number);
      });
    };
    return deepest_ == 0 || rank(key.first) < deepest_ || rank(key.second) < deepest_;
  }

  // The nodes' lists after `unlist`, and what remains of the runs.
  void unlist(std::vector<std::vector<const ExpectedContact*>>& runs) {
    REQUIRE(ledger_.unlisted() == found_.size() - now_.size());
    for (NodeNumber node = 0; node < nodes_.size(); ++node) {
      NodeContacts& lists = *nodes_[node]->lists;
      const auto keys = lists.keys.span();
      REQUIRE((!nodes_[node]->shares || ledger_.unlisted(node).empty()));
      std::vector<std::uint32_t> positions;
      for (const UnlistedContact& one : ledger_.unlisted(node)) {
        const auto at = std::lower_bound(keys.begin(), keys.end(), one.key);
        REQUIRE(at != keys.end());
        REQUIRE(*at == one.key);
        positions.push_back(static_cast<std::uint32_t>(at - keys.begin()));
        REQUIRE(lists.found[positions.back()].slot_a == one.slot_a);
        REQUIRE(lists.found[positions.back()].slot_b == one.slot_b);
      }
      lists.unlist(positions);
      std::erase_if(runs[node], [&](const ExpectedContact* one) {
        return now_.count({one->contact.a, one->contact.b}) == 0;
      });
      REQUIRE((nodes_[node]->free || lists.keys.size() == runs[node].size()));
    }
  }

  Phase phase_of(const Key& key) const { return before_.count(key) != 0 ? Phase::persist : Phase::begin; }

  // The phases that the nodes have after the corrections.
  void check_phases(const std::vector<std::vector<const ExpectedContact*>>& runs) {
    for (NodeNumber node = 0; node < nodes_.size(); ++node) {
      NodeContacts& lists = *nodes_[node]->lists;
      REQUIRE((!nodes_[node]->shares || ledger_.corrections(node).empty()));
      for (const std::uint32_t position : ledger_.corrections(node)) {
        REQUIRE(lists.begun[position] == 1);
        lists.begun[position] = 0;
      }
      for (std::uint32_t i = 0; phases_are_certain_ && i < runs[node].size(); ++i) {
        const bool begins = phase_of({runs[node][i]->contact.a, runs[node][i]->contact.b}) == Phase::begin;
        REQUIRE((lists.begun[i] != 0) == begins);
      }
    }
  }

  void check_notices() {
    const auto all = ledger_.notices(true);
    REQUIRE(all.size() == now_.size());
    std::size_t i = 0;
    for (const auto& [key, truth] : now_) {
      Contact expected = truth.contact;
      Contact written;
      all[i].write(written);
      expected.phase = phases_are_certain_ ? phase_of(key) : written.phase;
      REQUIRE((duplicates_allowed || same(written, expected)));
      REQUIRE(all[i].key == word_of(key));
      REQUIRE(all[i].found.a == truth.slot_a);
      REQUIRE((duplicates_allowed || all[i].found.by == truth.finder));
      ++i;
    }
    check_ended_notices();
    std::vector<std::uint64_t> user_contacts;
    for (const auto& node : nodes_) {
      for (const UserContact& contact : node->lists->user_contacts) {
        user_contacts.push_back(contact.key);
      }
    }
    std::sort(user_contacts.begin(), user_contacts.end());
    user_contacts.erase(std::unique(user_contacts.begin(), user_contacts.end()), user_contacts.end());
    const auto notices = ledger_.notices(false);
    REQUIRE(notices.size() == user_contacts.size());
    for (std::size_t k = 0; k < notices.size(); ++k) {
      REQUIRE(notices[k].key == user_contacts[k]);
    }
    user_contacts_before_ = std::move(user_contacts);
  }

  void check_ended_notices() {
    if (!phases_are_certain_) {
      return;
    }
    std::vector<std::uint64_t> user_contacts;
    const auto all = ledger_.ended_notices(true);
    std::size_t e = 0;
    for (const auto& [key, truth] : before_) {
      if (now_.count(key) != 0) {
        continue;
      }
      Contact expected = truth.contact;
      expected.phase = Phase::end;
      REQUIRE(e < all.size());
      Contact written;
      all[e].write(written);
      REQUIRE(same(written, expected));
      REQUIRE(all[e].key == word_of(key));
      REQUIRE(all[e].found.a == truth.slot_a);
      REQUIRE(all[e].found.b == truth.slot_b);
      ++e;
      if (std::binary_search(user_contacts_before_.begin(), user_contacts_before_.end(), word_of(key))) {
        user_contacts.push_back(word_of(key));
      }
    }
    REQUIRE(e == all.size());
    // The list has at least the ended contacts that concern users.
    const auto notices = ledger_.ended_notices(false);
    std::size_t k = 0;
    for (const ContactNotice& one : notices) {
      k += k < user_contacts.size() && one.key == user_contacts[k] ? 1 : 0;
    }
    REQUIRE(k == user_contacts.size());
    for_users_only += notices.size() < e ? 1 : 0;
  }

  // Each node writes its slice or is lost: before it enters the gate, while it is inside, or after it has left.
  std::vector<std::size_t> write() {
    std::vector<std::size_t> lost, late;
    for (NodeNumber node = 0; node < nodes_.size(); ++node) {
      NodeContacts* const shared = shared_of(node);
      const auto fate = frame_ % 4 == 3 ? random_() % 6 : 5;
      if (shared != nullptr && fate > 0) {
        REQUIRE(shared->gate.enter());
        if (fate > 1) {
          nodes_[node]->write();
        } else {
          late.push_back(node);
        }
      }
      if (fate < 3) {
        ledger_.lose(node);
        REQUIRE((shared == nullptr || !shared->gate.enter()));  // too late to write
        lost.push_back(node);
      }
    }
    if (stops && !late.empty()) {
      REQUIRE_FALSE(ledger_.complete());
      write_again(lost, late);
      late.clear();
    }
    for (const std::size_t node : late) {
      REQUIRE_FALSE(ledger_.complete());
      ++waits;
      nodes_[node]->write();
    }
    // The frame before stays readable while this one is made.
    const auto before = ledger_.contacts(frame_ - 1);
    REQUIRE(before.size() == (frame_ == 0 ? 0 : before_.size()));
    REQUIRE(std::equal(before.begin(), before.end(), before_.begin(),
                       [](const Contact& contact, const auto& expected) { return contact.a == expected.first.first; }));
    REQUIRE(ledger_.complete());
    return lost;
  }

  // The threads of late nodes have stopped while writing. The test loses all nodes, and the ledger writes again.
  void write_again(std::vector<std::size_t>& lost, const std::vector<std::size_t>& late) {
    for (NodeNumber node = 0; node < nodes_.size(); ++node) {
      if (!std::binary_search(lost.begin(), lost.end(), node)) {
        ledger_.lose(node);
      }
    }
    ledger_.write_again();
    for (const std::size_t node : late) {
      stopped_.push_back(nodes_[node].get());
    }
    lost.clear();
    for (std::size_t node = 0; node < nodes_.size(); ++node) {
      lost.push_back(node);
    }
    ++written_again;
  }

  void check_lists() {
    REQUIRE(ledger_.duplicates() == surplus_);
    REQUIRE(ledger_.size() == now_.size() + surplus_);
    const auto contacts = ledger_.contacts(frame_);
    REQUIRE(contacts.size() == now_.size());
    REQUIRE(ledger_.keys(frame_).size() == now_.size());
    REQUIRE(ledger_.found(frame_).size() == now_.size());
    std::size_t i = 0;
    std::size_t began = 0;
    for (const auto& [key, truth] : now_) {
      Contact expected = truth.contact;
      expected.phase = phases_are_certain_ ? phase_of(key) : contacts[i].phase;
      began += expected.phase == Phase::begin ? 1 : 0;
      REQUIRE(same(contacts[i], expected));
      REQUIRE(ledger_.keys(frame_)[i] == word_of(key));
      REQUIRE(ledger_.found(frame_)[i].a == truth.slot_a);
      REQUIRE(ledger_.found(frame_)[i].b == truth.slot_b);
      REQUIRE((duplicates_allowed || ledger_.found(frame_)[i].by == truth.finder));
      ++i;
    }
    REQUIRE(ledger_.began() == began);
    if (!phases_are_certain_) {
      return;
    }
    std::size_t e = 0;
    const auto ended = ledger_.ended(frame_);
    for (const auto& [key, truth] : before_) {
      if (now_.count(key) != 0) {
        continue;
      }
      Contact expected = truth.contact;  // the geometry of the last contact
      expected.phase = Phase::end;
      REQUIRE(e < ended.size());
      REQUIRE(same(ended[e], expected));
      REQUIRE(ledger_.ended_keys(frame_)[e] == word_of(key));
      ++e;
    }
    REQUIRE(e == ended.size());
    REQUIRE((frame_ == 0 || !keeps_two_ || ledger_.contacts(frame_ - 1).size() == before_.size()));
  }

  std::mt19937_64 random_;
  Form form_;
  bool large_numbers_;
  std::uint32_t deepest_;
  bool keeps_two_;
  ContactLedger ledger_;
  std::vector<std::unique_ptr<Node>> nodes_;
  std::vector<std::unique_ptr<Node>> gone_;  ///< their memory stays valid
  std::vector<Node*> stopped_;               ///< nodes in `gone_` that are still writing
  ExpectedContacts found_, found_before_;    ///< by any node
  ExpectedContacts now_, before_;            ///< those that are listed
  std::vector<std::uint64_t> user_contacts_before_;
  std::size_t surplus_before_ = 0;
  /// No two nodes found the same pair, neither in this frame nor in the frame before.
  bool phases_are_certain_ = true;
  std::size_t surplus_ = 0;
  std::uint64_t frame_ = 0;
  std::vector<ObjectRow> rows_;  ///< of the frame
  std::vector<ObjectOrigin> origins_ = origins_of(std::vector<ObjectRow>(slots));
};

TEST_CASE(
    "the ledger's contacts and phases equal those of a map of the two frames, whichever nodes write or are lost") {
  for (const LedgerTest::Form form : {LedgerTest::Form::sending, LedgerTest::Form::sharing}) {
    for (unsigned seed = 100; seed < 106; ++seed) {
      CAPTURE(seed);
      CAPTURE(static_cast<int>(form));
      LedgerTest ledger_test(seed, form);
      for (int frame = 0; frame < 200; ++frame) {
        CAPTURE(frame);
        ledger_test.frame();
      }
      CHECK((ledger_test.waits > 0) == (form != LedgerTest::Form::sending));
      CHECK((ledger_test.for_users_only > 10 || form != LedgerTest::Form::sharing));
    }
  }
}

TEST_CASE(
    "a ledger that keeps one frame has the same contacts and phases, and those of the frame before until the end") {
  for (const LedgerTest::Form form : {LedgerTest::Form::sending, LedgerTest::Form::sharing}) {
    for (unsigned seed = 500; seed < 506; ++seed) {
      CAPTURE(seed);
      CAPTURE(static_cast<int>(form));
      LedgerTest ledger_test(seed, form, seed % 2, 1);
      for (int frame = 0; frame < 200; ++frame) {
        CAPTURE(frame);
        ledger_test.duplicates_allowed = seed % 2 == 0 && frame % 7 == 1;
        ledger_test.frame();
      }
    }
  }
}

TEST_CASE(
    "a pair that two nodes found is kept once and counted, and phases are correct from the frame after the next on") {
  for (const LedgerTest::Form form : {LedgerTest::Form::sending, LedgerTest::Form::sharing}) {
    for (unsigned seed = 200; seed < 204; ++seed) {
      CAPTURE(seed);
      CAPTURE(static_cast<int>(form));
      LedgerTest ledger_test(seed, form);
      for (int frame = 0; frame < 120; ++frame) {
        CAPTURE(frame);
        ledger_test.duplicates_allowed = frame % 3 == 1;
        ledger_test.frame();
      }
    }
  }
}

TEST_CASE("with a limit the ledger's contacts and phases are those of the listed contacts alone") {
  for (const LedgerTest::Form form : {LedgerTest::Form::sending, LedgerTest::Form::sharing}) {
    for (unsigned seed = 400; seed < 406; ++seed) {
      for (const std::uint32_t deepest : {1u, 3u}) {
        CAPTURE(seed);
        CAPTURE(deepest);
        CAPTURE(static_cast<int>(form));
        LedgerTest ledger_test(seed, form, deepest);
        for (int frame = 0; frame < 100; ++frame) {
          CAPTURE(frame);
          ledger_test.frame();
        }
        CHECK(ledger_test.unlisted > 100);
      }
    }
  }
}

TEST_CASE("a thread that stops while it writes a list and continues frames later changes nothing") {
  for (unsigned seed = 300; seed < 306; ++seed) {
    CAPTURE(seed);
    LedgerTest ledger_test(seed, LedgerTest::Form::sharing);
    ledger_test.stops = true;
    for (int frame = 0; frame < 200; ++frame) {
      CAPTURE(frame);
      ledger_test.duplicates_allowed = frame % 7 == 1;
      ledger_test.frame();
      if (frame % 5 == 4) {
        ledger_test.continue_stopped();
      }
    }
    CHECK(ledger_test.written_again > 0);
  }
}

TEST_CASE("contacts that concern peers are listed by peer, in order") {
  constexpr unsigned seed = 9;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  PeerLists runs;
  for (NodeNumber nodes = 1; nodes < 20; ++nodes) {
    CAPTURE(nodes);
    runs.clear();
    std::vector<std::vector<std::uint32_t>> expected(nodes);
    for (std::uint32_t position = 0; position < 60; ++position) {
      const auto peer = static_cast<NodeNumber>(random() % nodes);
      if (random() % 3 != 0) {
        runs.add(peer, position);
        expected[peer].push_back(position);
      }
    }
    runs.finish(nodes);
    std::size_t size = 0;
    for (NodeNumber peer = 0; peer < nodes; ++peer) {
      const auto run = runs.of(peer);
      REQUIRE(std::vector<std::uint32_t>(run.begin(), run.end()) == expected[peer]);
      size += run.size();
    }
    REQUIRE(runs.size() == size);
  }
}

}  // namespace
}  // namespace ringfence::nodes
