#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"

namespace ringfence::broad_phase::test {

/// A set of pairs in canonical form: a < b, ascending.
std::vector<geometry::CandidatePair> canonical(std::span<const geometry::CandidatePair> pairs);

/// The oracle: tests every pair of present boxes with geometry::touch alone.
std::vector<geometry::CandidatePair> all_pairs(std::span<const geometry::Bounds> bounds,
                                               std::span<const std::uint8_t> present);

/// Those of `pairs` whose layers collide.
std::vector<geometry::CandidatePair> filter_by_layers(std::span<const geometry::CandidatePair> pairs,
                                                      std::span<const std::uint8_t> layers,
                                                      std::span<const std::uint32_t> layer_masks);

/// Empty if the two lists hold the same pairs, each once; otherwise describes the first difference.
std::string difference(std::span<const geometry::CandidatePair> found,
                       std::span<const geometry::CandidatePair> expected);

}  // namespace ringfence::broad_phase::test
