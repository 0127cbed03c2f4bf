// The program serves a world to robots over sockets.
#include <csignal>
#include <regex>
#include <string>

#include <doctest/doctest.h>

#include "tools/program.hpp"
#include "tools/running_program.hpp"

namespace ringfence {
namespace {

using test::ProgramResult;
using test::RunningProgram;
using test::TemporaryFolder;

/// The address that a server prints first.
std::string url_of(const RunningProgram& server) {
  std::string text;
  while (text.find('\n') == std::string::npos) {
    const std::string part = server.read_some();
    REQUIRE_FALSE(part.empty());
    text += part;
  }
  return text.substr(0, text.find('\n'));
}

/// "8f3fff66008b74df of 83 frames" in the report of a server.
std::string digest_of(const std::string& report) {
  std::smatch found;
  return std::regex_search(report, found, std::regex("digest ([0-9a-f]{16} of [0-9]+ frames)")) ? found[1].str() : "";
}

void walk_robots(const std::string& url, const std::string& more) {
  const ProgramResult robots = test::ringfence("robots --url " + url + " --clients 12 --seconds 1.5 " + more);
  CHECK_MESSAGE(robots.code == 0, robots.out);
}

}  // namespace

TEST_CASE("the digest of a served world is that of its journal without clients") {
  const TemporaryFolder folder;
  const std::string journal = folder / "journal";
  RunningProgram server({"serve", "--listen", "127.0.0.1:0", "--objects", "400", "--nodes", "2", "--robots", "5",
                         "--journal", journal, "--snapshot-every", "100000"},
                        folder / "errors");
  REQUIRE(server.started());
  walk_robots(url_of(server), "");
  server.signal(SIGTERM);
  const std::string digest = digest_of(server.read_all());
  REQUIRE_FALSE(digest.empty());
  CHECK(server.wait() == 0);
  CHECK(test::ringfence("journal " + journal + " --verify").code == 0);
  // The only snapshot is that of the beginning, so this computes every frame again.
  const std::string frames = std::regex_replace(digest, std::regex(".* of | frames"), "");
  const ProgramResult again = test::ringfence("resume " + journal + " --nodes 0 --frames " + frames);
  CHECK(again.code == 0);
  CHECK_MESSAGE(digest_of(again.out) == digest, again.out);
}

TEST_CASE("players come back to a world that was killed and continued from its journal") {
  const TemporaryFolder folder;
  const std::string journal = folder / "journal", key = folder / "key";
  REQUIRE(test::run_shell("printf 0123456789abcdef0123456789abcdef > " + key).code == 0);
  const std::string token = "--token-key " + key;
  {
    RunningProgram server({"serve", "--listen", "127.0.0.1:0", "--objects", "300", "--token-key", key, "--journal",
                           journal, "--sync", "always"},
                          folder / "errors");
    REQUIRE(server.started());
    walk_robots(url_of(server), token);
    server.signal(SIGKILL);
    CHECK(server.wait() == -SIGKILL);
  }
  RunningProgram server({"resume", journal, "--listen", "127.0.0.1:0", "--token-key", key, "--frames", "0"},
                        folder / "errors");
  REQUIRE(server.started());
  const std::string url = url_of(server);
  walk_robots(url, token);
  server.signal(SIGTERM);
  const std::string report = server.read_all();
  CHECK(server.wait() == 0);
  CHECK_FALSE(digest_of(report).empty());
  CHECK(test::ringfence("journal " + journal + " --verify").code == 0);
}

TEST_CASE("clients may send an input in each frame, however short frames are") {
  const TemporaryFolder folder;
  RunningProgram server({"serve", "--listen", "127.0.0.1:0", "--objects", "100", "--tick", "400"}, folder / "errors");
  REQUIRE(server.started());
  const ProgramResult robots =
      test::ringfence("robots --url " + url_of(server) + " --clients 2 --seconds 3 --inputs every");
  CHECK_MESSAGE(robots.code == 0, robots.out);
}

TEST_CASE("a worse network of one address does not delay the clients of another") {
  const TemporaryFolder folder;
  RunningProgram server({"serve", "--listen", "127.0.0.1:0", "--objects", "100", "--network",
                         "delay=200ms,jitter=20ms,loss=5%,address=127.0.0.2"},
                        folder / "errors");
  REQUIRE(server.started());
  const std::string url = url_of(server);
  const auto round_trip_ms = [&](const std::string& from) {
    const ProgramResult robots = test::ringfence("robots --url " + url + " --clients 4 --seconds 2 --from " + from);
    CHECK_MESSAGE(robots.code == 0, robots.out);
    std::smatch found;
    REQUIRE_MESSAGE(std::regex_search(robots.out, found, std::regex("round trip: p50 ([0-9]+)")), robots.out);
    return std::stoi(found[1].str());
  };
  const int near = round_trip_ms("127.0.0.1"), far = round_trip_ms("127.0.0.2");
  CHECK(far >= 400);
  CHECK(near < far);
  const ProgramResult robots = test::ringfence("robots --url " + url + " --from here");
  CHECK(robots.code == 2);
  CHECK_MESSAGE(robots.out.find("found here; expected an IP address") != std::string::npos, robots.out);
}

TEST_CASE("what clients may not rely on is refused at the start, with what to do") {
  const auto refused = [](const std::string& arguments, const std::string& message) {
    const ProgramResult result = test::ringfence("serve " + arguments);
    CHECK(result.code == 2);
    CHECK_MESSAGE(result.out.find(message) != std::string::npos, result.out);
  };
  refused("--listen 0.0.0.0:0", "0.0.0.0 is open to other machines: give a certificate and its key");
  refused("--listen somewhere:80", "expected an IP address such as 127.0.0.1 or 0.0.0.0");
  refused("--listen 127.0.0.1", "--listen: found 127.0.0.1; expected HOST:PORT");
  refused("--network delay=1", "delay");
  refused("--network delay=1ms,address=::1", "address=::1");
  refused("--token-key /nowhere", "/nowhere");
}

}  // namespace ringfence
