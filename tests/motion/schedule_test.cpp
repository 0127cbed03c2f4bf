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
      SchedulePeriod period = schedule.at(subject, 0);
      for (int period_index = 0; period_index < 50; ++period_index) {
        const SchedulePeriod next = schedule.at(subject, period.end);
        REQUIRE(next.number == period.number + 1);
        REQUIRE(next.end - period.end >= interval.min);
        REQUIRE(next.end - period.end <= interval.max);
        period = next;
      }
    }
  }
}

TEST_CASE("a period is the same from each of its frames") {
  const Schedule schedule({3, 17}, 9, 1);
  SchedulePeriod current = schedule.at(4, 0);
  for (std::uint64_t frame = 0; frame < 2000; ++frame) {
    const SchedulePeriod period = schedule.at(4, frame);
    if (frame < current.end) {
      REQUIRE(period.number == current.number);
      REQUIRE(period.end == current.end);
    } else {
      REQUIRE(frame == current.end);
      REQUIRE(period.end > frame);
      current = period;
    }
  }
}

TEST_CASE("the events of different subjects are spread over time") {
  const Schedule schedule({200, 800}, 1, 1);
  int early = 0;
  for (std::uint32_t subject = 0; subject < 1000; ++subject) early += schedule.at(subject, 0).end < 250;
  CHECK(early > 300);
  CHECK(early < 700);
}

TEST_CASE("an interval that is empty, zero or too long is refused, and the message states it") {
  CHECK_THROWS_WITH_AS(Schedule({0, 5}, 1, 1), "interval 0:5: expected A:B frames with 1 <= A <= B <= 1000000000",
                       Error);
  CHECK_THROWS_AS(Schedule({6, 5}, 1, 1), Error);
  CHECK_THROWS_AS(Schedule({1, 1'000'000'001}, 1, 1), Error);
}

}  // namespace ringfence::motion
