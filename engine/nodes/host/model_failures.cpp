#include "nodes/host/model_failures.hpp"

#include <algorithm>
#include <exception>
#include <string>

namespace ringfence::nodes {
namespace {

/// The text of the exception that is being handled, at most max_model_failure_text bytes.
std::string text_of_current() {
  try {
    throw;
  } catch (const std::exception& error) {
    return std::string(error.what()).substr(0, max_model_failure_text);
  } catch (...) {
    return "an exception that is no std::exception";
  }
}

}  // namespace

void ModelFailures::add_current(ObjectId object) noexcept {
  try {
    add({object, text_of_current()});
  } catch (...) {
    // The object is counted, but memory for the text ran out.
  }
}

void ModelFailures::add(const ModelFailure& failure) {
  const ObjectNumber number = failure.object.number();
  const auto at = std::lower_bound(failures_.begin(), failures_.end(), number,
                                   [](const ModelFailure& known, ObjectNumber n) { return known.object.number() < n; });
  if (at != failures_.end() && at->object.number() == number) {
    *at = failure;
    return;
  }
  failures_.insert(at, failure);
  if (failures_.size() > max_model_failures) {
    failures_.pop_back();
  }
}

}  // namespace ringfence::nodes
