#include "broad_phase/all_pairs.hpp"

#include <algorithm>

namespace ringfence::broad_phase::test {
namespace {
bool before(const geometry::CandidatePair& p, const geometry::CandidatePair& q) {
  return p.a != q.a ? p.a < q.a : p.b < q.b;
}
std::string words(const geometry::CandidatePair& p) { return std::to_string(p.a) + ", " + std::to_string(p.b); }
}  // namespace

std::vector<geometry::CandidatePair> canonical(std::span<const geometry::CandidatePair> pairs) {
  std::vector<geometry::CandidatePair> sorted(pairs.begin(), pairs.end());
  for (auto& p : sorted)
    if (p.b < p.a) std::swap(p.a, p.b);
  std::sort(sorted.begin(), sorted.end(), before);
  return sorted;
}

std::vector<geometry::CandidatePair> all_pairs(std::span<const geometry::Bounds> bounds,
                                               std::span<const std::uint8_t> present) {
  std::vector<geometry::CandidatePair> pairs;
  for (std::uint32_t a = 0; a < bounds.size(); ++a) {
    if (present[a] == 0) continue;
    for (std::uint32_t b = a + 1; b < bounds.size(); ++b)
      if (present[b] != 0 && geometry::touch(bounds[a], bounds[b])) pairs.push_back({a, b});
  }
  return pairs;
}

std::vector<geometry::CandidatePair> filter_by_layers(std::span<const geometry::CandidatePair> pairs,
                                                      std::span<const std::uint8_t> layers,
                                                      std::span<const std::uint32_t> layer_masks) {
  std::vector<geometry::CandidatePair> allowed;
  for (const auto& pair : pairs)
    if ((layer_masks[layers[pair.a]] >> layers[pair.b] & 1u) != 0) allowed.push_back(pair);
  return allowed;
}

std::string difference(std::span<const geometry::CandidatePair> found,
                       std::span<const geometry::CandidatePair> expected) {
  const auto sorted = canonical(found);
  for (std::size_t k = 0; k < std::max(sorted.size(), expected.size()); ++k) {
    if (k == sorted.size()) return "missing " + words(expected[k]);
    if (k > 0 && sorted[k] == sorted[k - 1]) return "twice " + words(sorted[k]);
    if (k == expected.size()) return "too many " + words(sorted[k]);
    if (sorted[k] == expected[k]) continue;
    return before(sorted[k], expected[k]) ? "too many " + words(sorted[k]) : "missing " + words(expected[k]);
  }
  return {};
}

}  // namespace ringfence::broad_phase::test
