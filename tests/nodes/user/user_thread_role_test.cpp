#include "nodes/user/user_thread_role.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <doctest/doctest.h>

#include "link/channel.hpp"
#include "messages/run.hpp"
#include "nodes/host/host_records.hpp"

namespace ringfence::nodes {
namespace {

using messages::Endpoint;
using messages::MessageType;
using Numbers = std::vector<std::uint32_t>;

/// Records which objects it moves, and abandons the thread in the move of one of them.
class RecordingModel : public MotionModel {
 public:
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      moved.push_back(inputs[i].number);
      outputs[i].pose.position.x += 1;
      if (inputs[i].number == abandon_in) CHECK(watch.abandon(watch.current()));
    }
  }
  mutable Numbers moved;
  mutable MoveWatch watch;
  ObjectNumber abandon_in = 0;
};

/// A thread with user nodes of the given numbers, each with an avatar of that number. The test is the server.
struct Fixture {
  static constexpr double interest = 8;
  explicit Fixture(const Numbers& numbers, std::size_t ring_bytes = 1 << 16)
      : to_users(ring_bytes, nullptr, nullptr), from_users(ring_bytes, nullptr, nullptr) {
    for (const UserNumber number : numbers) {
      UserSetup setup;
      setup.user = number;
      setup.model = &model;
      setup.objects = 4;
      users.push_back(std::make_unique<UserRole>(setup));
    }
    UserThreadSetup setup;
    setup.server = {&from_users.sender(), &to_users.receiver(), nullptr, &publication};
    setup.publications = &publications;
    setup.parts.reader = &reader;
    setup.parts.watch = &model.watch;
    setup.first_frame = 1;
    role = std::make_unique<UserThreadRole>(setup, list());
  }
  std::vector<UserRole*> list(UserNumber without = no_user_number) {
    std::vector<UserRole*> all;
    for (const auto& user : users) {
      if (user->number() != without) all.push_back(user.get());
    }
    return all;
  }
  void send(MessageType type, Endpoint to, std::uint64_t frame) {
    run.start(0);
    REQUIRE(run.pump(to_users.sender(), {type, Endpoint::server(), to, frame, 1}, messages::record_bytes(type, 0),
                     traffic, [](std::size_t, std::byte*) {}));
  }
  void adopt(UserNumber user, ObjectNumber number) {
    run.start(1);
    REQUIRE(run.send(to_users.sender(), {MessageType::adopt, Endpoint::server(), Endpoint::user(user), 1, 1}, traffic,
                     [&](std::size_t) {
                       messages::HandOverRecord record = record_of(number);
                       record.category = static_cast<std::uint16_t>(Category::avatar);
                       return record;
                     }));
    (void)role->step();
  }
  /// The senders of the messages of a type that have arrived since the last call, whatever it was for.
  Numbers senders_of(MessageType type) {
    Numbers senders;
    for (auto bytes = from_users.receiver().next(); !bytes.empty(); bytes = from_users.receiver().next()) {
      messages::MessageView message;
      REQUIRE(messages::decode(bytes, 0, message) == Status::ok);
      CHECK(message.header().last == 1);
      if (message.type() == type) senders.push_back(Endpoint{message.header().source}.number());
    }
    from_users.receiver().release();
    return senders;
  }

  RecordingModel model;
  Publications publications;
  HostPublication publication{0, interest};
  InterestReader reader{publications, interest};
  link::Channel to_users, from_users;
  std::vector<std::unique_ptr<UserRole>> users;
  std::unique_ptr<UserThreadRole> role;
  messages::RunSender run;
  messages::TrafficCounts traffic{};
};

TEST_CASE("a message reaches the user node that it names, and one to all reaches each in the order of their numbers") {
  Fixture test({2, 5, 7});
  for (const UserNumber user : {7u, 2u, 5u}) test.adopt(user, user);
  CHECK(test.users[0]->host().find(2) == 0);
  CHECK(test.users[0]->host().find(5) == base::NumberIndex::none);
  test.send(MessageType::frame_begin, Endpoint::all_users(), 1);
  CHECK(test.role->step() == Step::progressed);
  CHECK(test.model.moved == Numbers{2, 5, 7});
  CHECK(test.senders_of(MessageType::state_update) == Numbers{2, 5, 7});
  CHECK(test.role->step() == Step::idle);
}

TEST_CASE("the thread publishes and acknowledges a frame once for all its user nodes") {
  Fixture test({2, 5, 7});
  for (const UserNumber user : {2u, 5u, 7u}) test.adopt(user, user);
  test.send(MessageType::frame_begin, Endpoint::all_users(), 1);
  CHECK(test.role->step() == Step::progressed);
  CHECK(test.senders_of(MessageType::published) == Numbers{Endpoint::all_users().number()});
  CHECK(test.publication.publication.states(1).size() == 3);
  test.send(MessageType::notify, Endpoint::user(5), 1);
  CHECK(test.role->step() == Step::progressed);
  CHECK(test.senders_of(MessageType::frame_done).empty());
  test.send(MessageType::notify, Endpoint::all_users(), 1);
  CHECK(test.role->step() == Step::progressed);
  CHECK(test.senders_of(MessageType::frame_done) == Numbers{Endpoint::all_users().number()});
}

TEST_CASE("a user node reads what the others of its thread have published, and not its own states") {
  Fixture test({2, 5, 7});
  for (const UserNumber user : {7u, 2u, 5u}) test.adopt(user, user);
  test.adopt(5, 9);
  test.send(MessageType::frame_begin, Endpoint::all_users(), 1);
  (void)test.role->step();
  test.publications.relays[1] = {&test.publication.published};
  test.send(MessageType::read_publications, Endpoint::all_users(), 1);
  CHECK(test.role->step() == Step::progressed);
  const auto seen = [&](std::size_t user) {
    Numbers numbers;
    for (const auto states : test.users[user]->seen(1)) {
      for (const PublishedState& state : states) numbers.push_back(state.number);
    }
    return numbers;
  };
  CHECK(seen(0) == Numbers{5, 9, 7});
  CHECK(seen(1) == Numbers{2, 7});
  CHECK(seen(2) == Numbers{2, 5, 9});
}

TEST_CASE("messages to user nodes that are gone, and those of frames before the role's first one, are ignored") {
  Fixture test({2});
  test.adopt(2, 2);
  test.send(MessageType::frame_begin, Endpoint::all_users(), 0);
  test.send(MessageType::notify, Endpoint::user(1), 1);
  test.send(MessageType::notify, Endpoint::user(900), 1);
  (void)test.role->step();
  CHECK(test.model.moved.empty());
  CHECK(test.senders_of(MessageType::frame_done).empty());
}

TEST_CASE("a full ring stops the user nodes, and each continues where it was when there is room") {
  Numbers numbers;
  for (UserNumber user = 0; user < 200; ++user) numbers.push_back(user);
  Fixture test(numbers, 4096);
  for (const UserNumber user : numbers) test.adopt(user, user + 1);
  test.send(MessageType::frame_begin, Endpoint::all_users(), 1);
  CHECK(test.role->step() == Step::progressed);
  CHECK(test.role->step() == Step::blocked);
  CHECK(test.model.moved.size() < 100);
  Numbers senders;
  for (int round = 0; round < 200 && senders.size() < numbers.size(); ++round) {
    for (const UserNumber sender : test.senders_of(MessageType::state_update)) senders.push_back(sender);
    (void)test.role->step();
  }
  CHECK(senders == numbers);
  CHECK(test.model.moved.size() == numbers.size());
  CHECK(test.role->step() == Step::idle);
}

TEST_CASE("a new thread goes on after the user node in whose move the old one was abandoned") {
  for (const UserNumber stalled : {2u, 5u, 7u}) {
    CAPTURE(stalled);
    Fixture test({2, 5, 7});
    for (const UserNumber user : {2u, 5u, 7u}) test.adopt(user, user);
    test.model.abandon_in = stalled;
    test.send(MessageType::frame_begin, Endpoint::all_users(), 1);
    test.send(MessageType::notify, Endpoint::user(2), 1);
    CHECK(test.role->step() == Step::abandoned);
    MoveWatch watch;
    UserThreadParts parts;
    parts.reader = &test.reader;
    parts.watch = &watch;
    UserThreadRole successor(*test.role, parts, test.list(stalled));
    CHECK(successor.step() == Step::progressed);
    CHECK(test.model.moved == Numbers{2, 5, 7});
    Numbers others{2, 5, 7};
    std::erase(others, stalled);
    CHECK(test.senders_of(MessageType::state_update) == others);
    CHECK(test.publication.publication.states(1).size() == others.size());
  }
}

}  // namespace
}  // namespace ringfence::nodes
