#include "nodes/exchange/frame_control.hpp"

#include <vector>

#include <doctest/doctest.h>

#include "nodes/exchange/counted_bell.hpp"

namespace ringfence::nodes::test {
namespace {

using Slots = std::vector<NodeNumber>;

Slots senders_of(FrameControl& frame_control) {
  Slots slots;
  frame_control.take_senders([&](NodeNumber slot) { slots.push_back(slot); });
  return slots;
}

TEST_CASE("a mark has frame, epoch and step, and the default is of no frame") {
  using Mark = FrameMark<ReportedStep>;
  CHECK(!Mark().is_of(0));
  const std::uint64_t frame = (std::uint64_t{3} << 32) + 7;
  const Mark mark(frame, 0x1fffffffu, ReportedStep::tested);
  CHECK(mark.is_of(frame));
  CHECK(!mark.is_of(frame + 1));
  CHECK(mark.has_epoch(0x1fffffffu));
  CHECK(!mark.has_epoch(0));
  CHECK(mark.step() == ReportedStep::tested);
  CHECK(mark == Mark(frame, 0x1fffffffu, ReportedStep::tested));
  CHECK(!(mark == Mark(frame, 0x1fffffffu, ReportedStep::done)));
}

TEST_CASE("a step is announced once, and nodes read which frame it is of") {
  FrameControl frame_control;
  CHECK(frame_control.announced().step() == AnnouncedStep::none);
  CHECK(frame_control.announce(12, 3, AnnouncedStep::frame_begin));
  CHECK(!frame_control.announce(12, 3, AnnouncedStep::frame_begin));
  CHECK(frame_control.announced() == FrameControl::Announced(12, 3, AnnouncedStep::frame_begin));
  CHECK(frame_control.frame() == 12);
  CHECK(frame_control.announce(12, 4, AnnouncedStep::frame_begin));  // after a loss
}

TEST_CASE("the server finds each node that has sent something or ended a step") {
  FrameControl frame_control;
  frame_control.expect({7, 1}, false);
  frame_control.note_messages(1);
  frame_control.arrive(1, ReportedStep::moved);
  frame_control.note_messages(64);
  frame_control.arrive(64, ReportedStep::tested);
  CHECK(senders_of(frame_control) == Slots{1, 64});
  CHECK(senders_of(frame_control).empty());
  CHECK(frame_control.arrived(ReportedStep::moved, 0) == 2);
  CHECK(frame_control.arrived(ReportedStep::moved, 1) == 0);
  CHECK(frame_control.arrived(ReportedStep::tested, 1) == 1);
  frame_control.expect({7, 1}, false);
  CHECK(frame_control.arrived(ReportedStep::moved, 0) == 0);
}

TEST_CASE("the last node to end a step wakes the server, messages only if it is eager, and after a loss each node") {
  CountedBell server;
  FrameControl frame_control;
  frame_control.set_server_bell(&server.bell());
  frame_control.expect({7, 1}, false);
  CHECK(!server.was_rung());
  frame_control.note_messages(0);
  frame_control.arrive(0, ReportedStep::moved);
  frame_control.arrive(2, ReportedStep::moved);
  frame_control.arrive(1, ReportedStep::tested);
  CHECK(!server.was_rung());
  frame_control.arrive(1, ReportedStep::moved);
  CHECK(!server.was_rung());
  frame_control.arrive(64, ReportedStep::moved);  // alone in its group
  CHECK(server.was_rung());
  frame_control.arrive(64, ReportedStep::tested);
  CHECK(!server.was_rung());
  frame_control.wake_for_each();
  frame_control.arrive(0, ReportedStep::tested);
  CHECK(server.was_rung());
  frame_control.arrive(64, ReportedStep::tested);
  CHECK(server.was_rung());
  frame_control.expect({7, 1}, true);
  frame_control.note_messages(0);
  CHECK(server.was_rung());
}

}  // namespace
}  // namespace ringfence::nodes::test
