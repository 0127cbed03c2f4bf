// Memory of large arrays: what is released, and what is kept.
#include "base/system_memory.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#ifdef __linux__
#include <sys/mman.h>
#endif

#include <doctest/doctest.h>

#include "base/flat_list.hpp"
#include "base/system_vector.hpp"

namespace ringfence::base {
namespace {

TEST_CASE("memory from the system is aligned to huge pages, zero and writable to its last byte") {
  for (const std::size_t bytes : {least_system_bytes, huge_page + 1, 3 * huge_page - 8}) {
    auto* const first = static_cast<std::byte*>(allocate_from_system(bytes));
    CHECK(reinterpret_cast<std::uintptr_t>(first) % huge_page == 0);
    CHECK(std::all_of(first, first + bytes, [](std::byte byte) { return byte == std::byte{0}; }));
    std::fill_n(first, bytes, std::byte{1});
    CHECK(first[bytes - 1] == std::byte{1});
    free_to_system(first, bytes);
  }
}

TEST_CASE("populated pages are resident, and their bytes keep their values") {
  constexpr std::size_t bytes = 2 * huge_page, begin = 3 * system_page + 100, size = 40 * system_page + 17;
  auto* const first = static_cast<std::byte*>(allocate_from_system(bytes));
  first[begin] = first[begin + size - 1] = std::byte{5};
  populate_pages(first + begin, size);
  populate_pages(first + begin, 0);
#ifdef __linux__
  std::vector<unsigned char> resident(bytes / system_page);
  REQUIRE(mincore(first, bytes, resident.data()) == 0);
  for (std::size_t page = begin / system_page; page <= (begin + size - 1) / system_page; ++page) {
    CHECK((resident[page] & 1) == 1);
  }
#endif
  CHECK(first[begin] == std::byte{5});
  CHECK(first[begin + size - 1] == std::byte{5});
  CHECK(std::count(first, first + bytes, std::byte{0}) == static_cast<std::ptrdiff_t>(bytes - 2));
  free_to_system(first, bytes);
}

TEST_CASE("released pages of a list leave the other elements as they are") {
  for (const std::size_t size : {std::size_t{1000}, std::size_t{100'000}, std::size_t{2'000'000}}) {
    FlatList<std::uint32_t> list;
    list.reserve_rarely_used(size);
    list.resize(size);
    list.request_huge_pages();
    std::iota(list.begin(), list.end(), 0u);
    const std::size_t first = size / 5, end = size - size / 7;
    list.release_pages(first, end);
    bool kept = true;
    for (std::size_t i = 0; i < size; ++i) {
      kept &= (i >= first && i < end) || list[i] == i;
    }
    CHECK(kept);
    std::fill(list.begin(), list.end(), 7u);
    CHECK(std::count(list.begin(), list.end(), 7u) == static_cast<std::ptrdiff_t>(size));
  }
}

TEST_CASE("a list keeps its elements when it grows from the heap to memory of the system") {
  SystemVector<std::uint64_t> vector;
  FlatList<std::uint64_t> list;
  for (std::uint64_t i = 0; i < 500'000; ++i) {
    vector.push_back(i);
    list.push_back(i);
  }
  list.release_unused_pages();
  CHECK(std::equal(vector.begin(), vector.end(), list.begin(), list.end()));
  for (std::uint64_t i = 0; i < vector.size(); i += 1000) {
    REQUIRE(vector[i] == i);
  }
}

}  // namespace
}  // namespace ringfence::base
