#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "base/buffer.hpp"

namespace ringfence::base {

/// Makes objects of one type side by side, for objects that one thread reads one after the other: a thousand objects in
/// as many places of the heap cost it a TLB miss each. Blocks of at least 1 MiB request huge pages.
///
/// The memory of an object is used again after its end; that of a block is freed when the pool and all its objects are
/// gone. Threads: one at a time uses the pool and ends its objects.
template <class T>
class BlockPool {
 public:
  /// Makes an object. `expected`: how many there will be at the same time; more may be made, in further blocks. Throws
  /// std::bad_alloc, and what the constructor throws.
  template <class... Arguments>
  std::shared_ptr<T> make(std::size_t expected, Arguments&&... arguments) {
    std::shared_ptr<Block> block = block_with_room(expected);
    T* const object = ::new (block->free.back()) T(std::forward<Arguments>(arguments)...);
    block->free.pop_back();
    return std::shared_ptr<T>(object, [block](T* ended) {
      ended->~T();
      block->free.push_back(ended);  // reserved by the block
    });
  }

 private:
  struct Block {
    explicit Block(std::size_t objects) {
      memory.grow(objects * sizeof(T) + alignof(T), 0);
      free.reserve(objects);
      const auto begin = reinterpret_cast<std::uintptr_t>(memory.data());
      std::byte* const first = memory.data() + (alignof(T) - begin % alignof(T)) % alignof(T);
      for (std::size_t i = objects; i-- > 0;) {
        free.push_back(first + i * sizeof(T));
      }
    }
    Buffer<std::byte> memory;
    std::vector<void*> free;  ///< places without an object; those that are used next are last
  };

  const std::shared_ptr<Block>& block_with_room(std::size_t expected) {
    std::size_t places = 0;
    for (const std::shared_ptr<Block>& block : blocks_) {
      if (!block->free.empty()) {
        return block;
      }
      places += block->free.capacity();
    }
    const std::size_t missing = expected > places ? expected - places : 1;
    return blocks_.emplace_back(std::make_shared<Block>(missing));
  }

  std::vector<std::shared_ptr<Block>> blocks_;
};

}  // namespace ringfence::base
