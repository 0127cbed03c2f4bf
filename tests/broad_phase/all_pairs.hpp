#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"

namespace ringfence::broad_phase::test {

/// A set of pairs in one form: a < b, ascending.
std::vector<geometry::CandidatePair> canonical(std::span<const geometry::CandidatePair> pairs);

/// The oracle: every pair of present boxes looked at, with geometry::touch alone.
std::vector<geometry::CandidatePair> all_pairs(std::span<const geometry::Bounds> bounds,
                                               std::span<const std::uint8_t> present);

/// Of those, the pairs whose layers collide.
std::vector<geometry::CandidatePair> filter_by_layers(std::span<const geometry::CandidatePair> pairs,
                                                      std::span<const std::uint8_t> layers,
                                                      std::span<const std::uint32_t> layer_masks);

/// Empty when the two lists hold the same pairs, each once; otherwise the first difference in words.
std::string difference(std::span<const geometry::CandidatePair> found,
                       std::span<const geometry::CandidatePair> expected);

}  // namespace ringfence::broad_phase::test
