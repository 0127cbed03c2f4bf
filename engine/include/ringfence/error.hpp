#pragma once

#include <stdexcept>

namespace ringfence {

/// Thrown by construction, configuration and registration. The message names the value, what was expected and what to
/// change. Nothing throws inside a frame.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace ringfence
