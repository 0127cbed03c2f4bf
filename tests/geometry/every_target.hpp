#pragma once

#include <cstdint>

#include <doctest/doctest.h>
#include <hwy/highway.h>

namespace ringfence::test {

/// Runs `body` once for each instruction set that this build contains and this machine supports.
template <class Body>
void on_every_target(Body&& body) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(target);
    CAPTURE(hwy::TargetName(target));
    body();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace ringfence::test
