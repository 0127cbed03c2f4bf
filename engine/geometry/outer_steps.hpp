#pragma once

namespace ringfence::geometry {

/// The steps of FixedSpace with Outside::has_octaves: 64 octaves of 2^octave_log2 steps on each side of the bounds.
inline constexpr int octave_log2 = 19;
inline constexpr double all_steps = 4294967296.0;
inline constexpr double outer_steps = 64.0 * (1 << octave_log2);
inline constexpr double inner_steps = all_steps - 2 * outer_steps;

}  // namespace ringfence::geometry
