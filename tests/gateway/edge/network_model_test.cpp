#include "gateway/edge/network_model.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include "gateway/edge/delay_line.hpp"
#include "gateway/edge/test_client.hpp"
#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

TEST_CASE("a network model is read in any order of its parts") {
  const NetworkModel model = NetworkModel::parse("loss=5%,delay=150ms,share=50%,jitter=2.5ms");
  CHECK(model.delay_s == doctest::Approx(0.150));
  CHECK(model.jitter_s == doctest::Approx(0.0025));
  CHECK(model.loss == doctest::Approx(0.05));
  CHECK(model.share == doctest::Approx(0.5));
  CHECK(NetworkModel::parse("address=127.0.0.2").address == "127.0.0.2");
  CHECK(NetworkModel::parse("").is_perfect());
}

TEST_CASE("a part that cannot be read is named in the error") {
  for (const char* const part :
       {"delay", "delay=", "delay=5", "delay=5s", "delay=-5ms", "delay=ms", "loss=101%", "loss=5", "loss=nan%",
        "jitter=infms", "wait=5ms", "share=1e3%", " delay=5ms", "address=", "address=here", "address=::1"}) {
    CHECK_THROWS_WITH_AS(NetworkModel::parse(part), doctest::Contains(part), Error);
    CHECK_THROWS_AS(NetworkModel::parse("share=1%," + std::string(part)), Error);
  }
  CHECK_THROWS_WITH_AS(NetworkModel::parse("delay=5ms,delay=6ms"), doctest::Contains("delay=6ms"), Error);
}

/// What a delay line delivers of `count` messages that it is given at once, in order of delivery.
std::vector<int> delivered(const NetworkModel& model, int count, bool may_be_lost) {
  net::io_context io;
  std::vector<int> numbers;
  DelayLine line(io, model, [&](DelayLine::Message& message) {
    numbers.push_back(std::to_integer<int>(message.bytes[0]) + 256 * std::to_integer<int>(message.bytes[1]));
  });
  for (int i = 0; i < count; ++i) {
    const std::array bytes{static_cast<std::byte>(i % 256), static_cast<std::byte>(i / 256)};
    line.add(1, true, may_be_lost, Delivery::newest, bytes);
  }
  io.run();
  return numbers;
}

TEST_CASE("messages that must arrive do so, in order") {
  NetworkModel model;
  model.delay_s = 0.001;
  model.jitter_s = 0.01;
  model.loss = 0.9;
  const std::vector<int> numbers = delivered(model, 1000, false);
  REQUIRE(numbers.size() == 1000);
  CHECK(std::is_sorted(numbers.begin(), numbers.end()));
}

TEST_CASE("messages that may be lost are lost in the given share, and overtake each other") {
  NetworkModel model;
  model.jitter_s = 0.01;
  model.loss = 0.25;
  constexpr int count = 10'000;
  const std::vector<int> numbers = delivered(model, count, true);
  // Six standard deviations of a binomial distribution: 6 * sqrt(10000 * 0.25 * 0.75) = 260.
  CHECK(numbers.size() > 7500 - 260);
  CHECK(numbers.size() < 7500 + 260);
  CHECK(std::set<int>(numbers.begin(), numbers.end()).size() == numbers.size());
  CHECK_FALSE(std::is_sorted(numbers.begin(), numbers.end()));
}

TEST_CASE("the same seed loses the same messages") {
  NetworkModel model;
  model.loss = 0.5;
  const auto first = delivered(model, 500, true), again = delivered(model, 500, true);
  CHECK(std::set<int>(first.begin(), first.end()) == std::set<int>(again.begin(), again.end()));
  model.seed = 2;
  const auto other = delivered(model, 500, true);
  CHECK(std::set<int>(first.begin(), first.end()) != std::set<int>(other.begin(), other.end()));
}

TEST_CASE("a model applies to its share of the connections") {
  net::io_context io;
  for (const int percent : {0, 1, 50, 99, 100}) {
    NetworkModel model;
    model.delay_s = 1;
    model.share = percent / 100.0;
    const DelayLine line(io, model, [](DelayLine::Message&) {});
    int count = 0;
    for (ConnectionId id = 1; id <= 1000; ++id) count += line.applies_to(id, "127.0.0.1") ? 1 : 0;
    CHECK(count == percent * 10);
  }
}

TEST_CASE("a model applies to the clients of its address") {
  net::io_context io;
  const DelayLine line(io, NetworkModel::parse("delay=1ms,address=127.0.0.2"), [](DelayLine::Message&) {});
  CHECK(line.applies_to(1, "127.0.0.2"));
  CHECK_FALSE(line.applies_to(1, "127.0.0.1"));
}

TEST_CASE("through an edge with loss, inputs are lost and all other messages arrive in order") {
  EdgeConfig config = test_config();
  config.network = NetworkModel::parse("delay=1ms,jitter=5ms,loss=100%");
  Edge edge(config);
  Frames frames(edge);
  TestClient client(edge);
  client.send(hello());
  const ConnectionId connection = frames.next().connection;
  for (std::uint32_t i = 0; i < 50; ++i) {
    Bytes input, question;
    write(Input{0, i + 1, 0, {}}, input);
    write(Describe{i}, question);
    client.send(input);
    client.send(question);
    frames.add(connection, Delivery::newest, bytes_of("update"));
    frames.add(connection, Delivery::reliable, bytes_of(std::to_string(i)));
  }
  frames.send();
  for (std::uint32_t i = 0; i < 50; ++i) {
    frames.next();
    const ClientMessage message = read_client_message(frames.message);
    REQUIRE(std::holds_alternative<Describe>(message));
    CHECK(std::get<Describe>(message).number == i);
    CHECK(client.read() == bytes_of(std::to_string(i)));
  }
}

}  // namespace
}  // namespace ringfence::gateway
