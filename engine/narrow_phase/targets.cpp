#include "narrow_phase/targets.hpp"

#include <algorithm>
#include <cctype>

#include <hwy/highway.h>

#include "ringfence/error.hpp"

namespace ringfence::narrow_phase {
namespace {

std::string name_of_target(std::int64_t target) {
  std::string name = hwy::TargetName(target);
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name;
}

}  // namespace

std::vector<std::string> targets() {
  std::vector<std::string> names;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) names.push_back(name_of_target(target));
  return names;
}

void force_target(std::string_view name) {
  hwy::SetSupportedTargetsForTest(0);
  std::string known;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    if (name_of_target(target) == name) {
      hwy::SetSupportedTargetsForTest(target);
      hwy::GetChosenTarget().Update(target);
      return;
    }
    known += ' ' + name_of_target(target);
  }
  hwy::GetChosenTarget().DeInit();
  if (!name.empty()) throw Error("no kernels for target '" + std::string(name) + "' here; there are:" + known);
}

}  // namespace ringfence::narrow_phase
