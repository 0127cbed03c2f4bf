#pragma once

#include <cstddef>

namespace ringfence::base {

/// Lists with more memory than this are freed when they are emptied by clear_and_release().
inline constexpr std::size_t released_list_bytes = std::size_t{1} << 16;

/// Empties a list that is long in rare frames only, such as that of the objects that are spawned when a world is
/// loaded, and frees its memory if that is more than 64 KiB: it would be unused from then on.
template <class List>
void clear_and_release(List& list) noexcept {
  list.clear();
  if (list.capacity() > released_list_bytes / sizeof(*list.data())) {
    list = List();
  }
}

}  // namespace ringfence::base
