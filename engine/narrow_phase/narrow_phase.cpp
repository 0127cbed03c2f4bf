#include "narrow_phase/narrow_phase.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "narrow_phase/kernel.hpp"

namespace ringfence::narrow_phase {
namespace {

constexpr std::size_t index_of(ShapeKind kind) noexcept { return static_cast<std::size_t>(kind); }

/// Pairs sorted at a time: what the sort touches is still in the cache when the kernels gather it.
constexpr std::size_t chunk_pairs = 4096;

/// What the sort needs to know of a shape, in four bytes: its kind and between which powers of two its sizes lie.
struct ShapeTag {
  std::uint8_t kind;
  std::int8_t large;  ///< of the bounding radius
  std::int8_t small;  ///< of the least size
  std::int8_t reserved;
};

/// Beyond a ratio of sizes of 2^5, some 10^-7 of the larger is no longer far below 10^-4 of the smaller.
constexpr int float_octaves = 5;

std::int8_t power_of_two(float size) noexcept {
  int power = 0;
  std::frexp(size, &power);
  return static_cast<std::int8_t>(power);
}

float least_size(const geometry::ShapeRow& row) noexcept {
  switch (row.kind) {
    case ShapeKind::sphere:
    case ShapeKind::capsule:
      return row.size[0];
    case ShapeKind::box:
      return std::min({row.size[0], row.size[1], row.size[2]});
    default:
      return row.bounding_radius;
  }
}

ShapeTag tag_of(const geometry::ShapeRow& row) noexcept {
  return {static_cast<std::uint8_t>(row.kind), power_of_two(row.bounding_radius), power_of_two(least_size(row)), 0};
}

/// Kinds of a pair and whether it is computed in double: the key that pairs are sorted by.
constexpr std::size_t keys = shape_kinds * shape_kinds * 2;

/// Memory that grows to what is asked and is never initialised.
template <class T>
class Buffer {
 public:
  T* of(std::size_t size) {
    if (size > capacity_) {
      capacity_ = size + size / 2;
      memory_ = std::make_unique_for_overwrite<T[]>(capacity_);
    }
    return memory_.get();
  }

 private:
  std::unique_ptr<T[]> memory_;
  std::size_t capacity_ = 0;
};

}  // namespace

Kernel kernel_of(ShapeKind first, ShapeKind second) noexcept {
  static constexpr Kernel none = nullptr;
  static constexpr Kernel table[shape_kinds][shape_kinds] = {
      // sphere, box, capsule, hull, mesh, support
      {test_sphere_sphere, test_sphere_box, test_sphere_capsule, none, none, none},
      {none, test_box_box, test_box_capsule, none, none, none},
      {none, none, test_capsule_capsule, none, none, none},
      {none, none, none, none, none, none},
      {none, none, none, none, none, none},
      {none, none, none, none, none, none},
  };
  return table[index_of(first)][index_of(second)];
}

bool can_test(ShapeKind p, ShapeKind q) noexcept { return kernel_of(std::min(p, q), std::max(p, q)) != nullptr; }

struct NarrowPhase::Implementation {
  explicit Implementation(const geometry::ShapeTable& table) : shapes(table) {}

  const geometry::ShapeTable& shapes;
  std::vector<ShapeTag> tags;
  Buffer<PairContact> contacts;
  std::unique_ptr<KernelPair[]> sorted = std::make_unique<KernelPair[]>(chunk_pairs);
  std::unique_ptr<std::uint8_t[]> pair_keys = std::make_unique<std::uint8_t[]>(chunk_pairs);
  std::size_t untested = 0;
  KindCounters counters[shape_kinds][shape_kinds];

  void learn_shapes();
  void count(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs, std::uint32_t* sizes);
  void sort(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs, std::size_t begin,
            const std::uint32_t* sizes);
  PairContact* test_chunk(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs,
                          std::size_t begin, PairContact* out);
};

void NarrowPhase::Implementation::learn_shapes() {
  for (std::size_t shape = tags.size(); shape < shapes.size(); ++shape) {
    tags.push_back(tag_of(shapes.row(static_cast<ShapeNumber>(shape))));
  }
}

void NarrowPhase::Implementation::count(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs,
                                        std::uint32_t* sizes) {
  const ShapeTag* tag = tags.data();
  std::uint8_t* key = pair_keys.get();
  for (const geometry::CandidatePair& pair : pairs) {
    const ShapeTag a = tag[bodies[pair.a].shape], b = tag[bodies[pair.b].shape];
    const unsigned first = std::min(a.kind, b.kind), second = std::max(a.kind, b.kind);
    const bool in_double = std::max(a.large, b.large) - std::min(a.small, b.small) > float_octaves;
    const unsigned k = (first * static_cast<unsigned>(shape_kinds) + second) * 2 + in_double;
    *key++ = static_cast<std::uint8_t>(k);
    ++sizes[k];
  }
}

void NarrowPhase::Implementation::sort(std::span<const Body> bodies, std::span<const geometry::CandidatePair> pairs,
                                       std::size_t begin, const std::uint32_t* sizes) {
  std::uint32_t next[keys];
  std::uint32_t sum = 0;
  for (std::size_t k = 0; k < keys; ++k) {
    next[k] = sum;
    sum += sizes[k];
  }
  const ShapeTag* tag = tags.data();
  KernelPair* to = sorted.get();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const geometry::CandidatePair pair = pairs[i];
    const bool flipped = tag[bodies[pair.a].shape].kind > tag[bodies[pair.b].shape].kind;
    to[next[pair_keys[i]]++] = {flipped ? pair.b : pair.a, flipped ? pair.a : pair.b,
                                static_cast<std::uint32_t>(begin + i), flipped ? flip_bit : 0};
  }
}

PairContact* NarrowPhase::Implementation::test_chunk(std::span<const Body> bodies,
                                                     std::span<const geometry::CandidatePair> pairs, std::size_t begin,
                                                     PairContact* out) {
  std::uint32_t sizes[keys] = {};
  count(bodies, pairs, sizes);
  sort(bodies, pairs, begin, sizes);
  const KernelPair* next = sorted.get();
  for (std::size_t k = 0; k < keys; ++k) {
    if (sizes[k] == 0) continue;
    const std::size_t first = k / 2 / shape_kinds, second = k / 2 % shape_kinds;
    const std::span<const KernelPair> run(next, sizes[k]);
    next += sizes[k];
    KindCounters& counter = counters[first][second];
    counter.candidates += run.size();
    const Kernel kernel = kernel_of(static_cast<ShapeKind>(first), static_cast<ShapeKind>(second));
    if (kernel == nullptr) {
      untested += run.size();
      continue;
    }
    PairContact* const end = kernel({bodies, shapes, run, k % 2 != 0}, out, counter);
    counter.hits += static_cast<std::uint64_t>(end - out);
    out = end;
  }
  return out;
}

NarrowPhase::NarrowPhase(const geometry::ShapeTable& shapes)
    : implementation_(std::make_unique<Implementation>(shapes)) {}
NarrowPhase::~NarrowPhase() = default;
NarrowPhase::NarrowPhase(NarrowPhase&&) noexcept = default;
NarrowPhase& NarrowPhase::operator=(NarrowPhase&&) noexcept = default;

std::span<const PairContact> NarrowPhase::test(std::span<const Body> bodies,
                                               std::span<const geometry::CandidatePair> pairs) {
  Implementation& self = *implementation_;
  self.learn_shapes();
  self.untested = 0;
  PairContact* const begin = self.contacts.of(pairs.size() + contact_slack);
  PairContact* out = begin;
  for (std::size_t i = 0; i < pairs.size(); i += chunk_pairs) {
    out = self.test_chunk(bodies, pairs.subspan(i, std::min(chunk_pairs, pairs.size() - i)), i, out);
  }
  assert(self.untested == 0);
  return {begin, out};
}

std::size_t NarrowPhase::untested() const noexcept { return implementation_->untested; }

const KindCounters& NarrowPhase::counters(ShapeKind p, ShapeKind q) const noexcept {
  return implementation_->counters[index_of(std::min(p, q))][index_of(std::max(p, q))];
}

void NarrowPhase::reset_counters() noexcept {
  for (auto& row : implementation_->counters) std::fill(std::begin(row), std::end(row), KindCounters{});
}

}  // namespace ringfence::narrow_phase
