#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace ringfence::base {

/// Copies elements that are whole cache lines, past the caches where the processor can: for what is written each frame
/// and rarely read. Then the lines need not be loaded before they are overwritten, and do not displace others.
/// Before another thread may read them, call finish_streams().
template <class Line>
void stream_lines(std::span<const Line> from, Line* to) noexcept {
  static_assert(alignof(Line) >= 64 && std::is_trivially_copyable_v<Line>);
#if defined(__SSE2__)
  const auto* const source = reinterpret_cast<const __m128i*>(from.data());
  auto* const target = reinterpret_cast<__m128i*>(to);
  for (std::size_t i = 0; i < from.size_bytes() / sizeof(__m128i); ++i) {
    _mm_stream_si128(target + i, _mm_load_si128(source + i));
  }
#else
  for (std::size_t i = 0; i < from.size(); ++i) to[i] = from[i];
#endif
}

/// Copies bytes: whole cache lines of `to` past the caches where the processor can, what is left at both ends through
/// them. Before another thread may read them, call finish_streams().
inline void stream_bytes(std::byte* to, const std::byte* from, std::size_t bytes) noexcept {
#if defined(__SSE2__)
  constexpr std::size_t line = 64;
  const std::size_t in_line = reinterpret_cast<std::uintptr_t>(to) % line;
  const std::size_t before = in_line == 0 ? 0 : line - in_line;
  if (bytes >= before + line) {
    std::memcpy(to, from, before);
    const std::size_t end = bytes - (bytes - before) % line;
    for (std::size_t at = before; at < end; at += sizeof(__m128i)) {
      _mm_stream_si128(reinterpret_cast<__m128i*>(to + at),
                       _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + at)));
    }
    to += end, from += end, bytes -= end;
  }
#endif
  std::memcpy(to, from, bytes);
}

/// Orders the copies before later stores of this thread: release stores do not.
inline void finish_streams() noexcept {
#if defined(__SSE2__)
  _mm_sfence();
#endif
}

}  // namespace ringfence::base
