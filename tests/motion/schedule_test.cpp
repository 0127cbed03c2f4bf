#include "motion/schedule.hpp"

#include <doctest/doctest.h>

#include "ringfence/error.hpp"

namespace ringfence::motion {

TEST_CASE("every time between two events lies in the interval") {
  for (const Interval interval : {Interval{200, 800}, Interval{60, 400}, Interval{1, 1}, Interval{5, 5}, Interval{1, 2},
                                  Interval{3, 8}, Interval{1, 1000}}) {
    CAPTURE(interval.min);
    CAPTURE(interval.max);
    const Schedule schedule(interval, 42, 7);
    for (std::uint32_t subject = 0; subject < 20; ++subject) {
      SchedulePeriod epoch = schedule.at(subject, 0);
      for (int turn = 0; turn < 50; ++turn) {
        const SchedulePeriod next = schedule.at(subject, epoch.end);
        REQUIRE(next.number == epoch.number + 1);
        REQUIRE(next.end - epoch.end >= interval.min);
        REQUIRE(next.end - epoch.end <= interval.max);
        epoch = next;
      }
    }
  }
}

TEST_CASE("a turn is the same from whichever of its frames it is found") {
  const Schedule schedule({3, 17}, 9, 1);
  SchedulePeriod current = schedule.at(4, 0);
  for (std::uint64_t frame = 0; frame < 2000; ++frame) {
    const SchedulePeriod epoch = schedule.at(4, frame);
    if (frame < current.end) {
      REQUIRE(epoch.number == current.number);
      REQUIRE(epoch.end == current.end);
    } else {
      REQUIRE(frame == current.end);
      REQUIRE(epoch.end > frame);
      current = epoch;
    }
  }
}

TEST_CASE("subjects do not turn all at once") {
  const Schedule schedule({200, 800}, 1, 1);
  int early = 0;
  for (std::uint32_t subject = 0; subject < 1000; ++subject) early += schedule.at(subject, 0).end < 250;
  CHECK(early > 300);
  CHECK(early < 700);
}

TEST_CASE("an interval that is empty, zero or too long is refused and named") {
  CHECK_THROWS_WITH_AS(Schedule({0, 5}, 1, 1), "interval 0:5: expected A:B frames with 1 <= A <= B <= 1000000000",
                       Error);
  CHECK_THROWS_AS(Schedule({6, 5}, 1, 1), Error);
  CHECK_THROWS_AS(Schedule({1, 1'000'000'001}, 1, 1), Error);
}

}  // namespace ringfence::motion
