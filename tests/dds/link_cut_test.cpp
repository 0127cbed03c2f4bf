// A link between two machines that is cut and restored: two network namespaces with a pair of interfaces between them.
#include <cstdlib>
#include <string>

#include <doctest/doctest.h>
#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include "dds/node_world.hpp"
#include "tools/program.hpp"

namespace ringfence {
namespace {

using test::NodeWorld;

bool run(const std::string& command) { return std::system((command + " >/dev/null 2>&1").c_str()) == 0; }

/// Two network namespaces that act as two machines, `here` for the World and `there` for nodes, and a link between
/// them. The destructor removes them.
class TwoMachines {
 public:
  TwoMachines() {
    const std::string mark = std::to_string(getpid());
    here_ = "rf-a" + mark;
    there_ = "rf-b" + mark;
    made_ = geteuid() == 0 && run("ip netns add " + here_) && run("ip netns add " + there_) &&
            run("ip -n " + here_ + " link add rfa type veth peer name rfb netns " + there_) &&
            run("ip -n " + here_ + " addr add 10.77.0.1/24 dev rfa") &&
            run("ip -n " + there_ + " addr add 10.77.0.2/24 dev rfb") && raise(here_, "lo") && raise(there_, "lo") &&
            raise(here_, "rfa") && raise(there_, "rfb");
    home_ = open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
  }
  ~TwoMachines() {
    go_home();
    close(home_);
    run("ip netns del " + here_);
    run("ip netns del " + there_);
  }
  TwoMachines(const TwoMachines&) = delete;
  TwoMachines& operator=(const TwoMachines&) = delete;

  /// Whether the constructor succeeded; it needs root.
  bool made() const { return made_; }
  const std::string& here() const { return here_; }
  const std::string& there() const { return there_; }
  /// Moves the calling thread, and the processes that it starts, to that machine.
  void go(const std::string& machine) const {
    const int space = open(("/var/run/netns/" + machine).c_str(), O_RDONLY | O_CLOEXEC);
    REQUIRE(space >= 0);
    REQUIRE(setns(space, CLONE_NEWNET) == 0);
    close(space);
  }
  void go_home() const { setns(home_, CLONE_NEWNET); }
  void cut() const { REQUIRE(run("ip -n " + there_ + " link set rfb down")); }
  void restore() const { REQUIRE(raise(there_, "rfb")); }

  /// A placement in which the nodes' processes run on `there` and the World on `here`.
  test::ProcessPlacement place() const {
    return {"rfa", "rfb", [this] { go(there_); }, [this] { go(here_); }};
  }

 private:
  static bool raise(const std::string& machine, const std::string& link) {
    return run("ip -n " + machine + " link set " + link + " up");
  }

  std::string here_, there_;
  bool made_ = false;
  int home_ = -1;
};

bool skipped(const TwoMachines& machines) {
  if (!machines.made()) {
    MESSAGE("skipped: two network namespaces with a link between them cannot be made here; run as root, with iproute2");
  }
  return !machines.made();
}

}  // namespace

TEST_CASE("nodes behind a cut link are lost in any deployment, and join again when it is restored") {
  const TwoMachines machines;
  if (skipped(machines)) {
    return;
  }
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      INFO("deployment ", std::string(name_of(deployment)), ", placement ", std::string(name_of(placement)));
      machines.go(machines.here());
      NodeWorld nodes(deployment, placement, 2, machines.place());
      nodes.run(20);
      nodes.run(1, [&] { machines.cut(); });
      CHECK(nodes.run_until([&] { return nodes.lost() == 2; }));
      nodes.run(5);
      CHECK(nodes.assigned_nodes() == 0);
      machines.restore();
      CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 2; }));
      nodes.run(5);
      CHECK(nodes.is_right());
    }
  }
}

TEST_CASE("recorded air traffic runs on two nodes of another machine, discovered by multicast or by address") {
  const TwoMachines machines;
  if (skipped(machines)) {
    return;
  }
  const std::string air = std::string("replay --scene ") + RINGFENCE_DATA + "/air/scene.json --motion " +
                          RINGFENCE_DATA + "/air/motion.csv ";
  const std::string expected = test::digest_in(test::ringfence(air + "--nodes 2").out);
  REQUIRE(expected.size() == 16);
  for (const std::string peers : {"", "--peers 10.77.0.1"}) {
    std::vector<std::unique_ptr<test::Process>> processes;
    machines.go(machines.there());
    for (int node = 0; node < 2; ++node) {
      std::vector<std::string> words = {RINGFENCE_PROGRAM, "node", "--interface", "rfb", "--once", "--quiet"};
      if (!peers.empty()) {
        words.insert(words.end(), {"--peers", "10.77.0.1"});
      }
      processes.push_back(std::make_unique<test::Process>(words));
    }
    machines.go(machines.here());
    const test::ProgramResult answer = test::ringfence(air + "--link dds --wait-nodes 2 --interface rfa");
    CHECK_MESSAGE(answer.code == 0, answer.out);
    CHECK(test::digest_in(answer.out) == expected);
    for (const auto& process : processes) {
      CHECK(test::wait_until([&] { return process->has_ended(); }));
      CHECK(process->exit_code() == 0);
    }
    machines.go_home();
  }
}

}  // namespace ringfence
