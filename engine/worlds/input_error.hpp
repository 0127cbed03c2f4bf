#pragma once

#include "ringfence/error.hpp"

namespace ringfence::worlds {

/// What readers throw: the message names the file, the line or byte, the field, what was found and what was expected.
/// Nothing of the file has been used when it is thrown.
class InputError : public Error {
 public:
  using Error::Error;
};

}  // namespace ringfence::worlds
