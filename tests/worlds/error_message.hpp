#pragma once

#include <string>

#include "worlds/input_error.hpp"

namespace ringfence::test {

/// What a reader says when it refuses; empty if it does not.
template <class Read>
std::string error_message_of(Read read) {
  try {
    read();
  } catch (const worlds::InputError& error) {
    return error.what();
  }
  return {};
}

}  // namespace ringfence::test
