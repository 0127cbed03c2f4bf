#pragma once

#include "ringfence/error.hpp"

namespace ringfence::worlds {

/// Thrown by the readers of this module for invalid input. The message names the file, the line or byte offset, the
/// field, what was found and what is expected. The reader returns nothing: a file is accepted completely or not at all.
class InputError : public Error {
 public:
  using Error::Error;
};

}  // namespace ringfence::worlds
