#pragma once

#include <string>

#include "worlds/input_error.hpp"

namespace ringfence::test {

/// The message of the InputError that `read` throws; empty if it throws none.
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
