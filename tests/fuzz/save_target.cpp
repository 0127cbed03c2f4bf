// Property: any bytes as a save, with the right checksum as an attacker writes it, are either refused with an Error, or
// give a World that runs; saved and restored again before it runs, it is the same to the byte.
#include <memory>
#include <span>
#include <vector>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "fuzz/target.hpp"
#include "ringfence/error.hpp"
#include "ringfence/world.hpp"

namespace ringfence::fuzz {
namespace {

using Bytes = std::vector<std::byte>;

/// Moves each object a little, and counts its frames in its state.
class Drift : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 8; }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      outputs[i].pose.position.x += 0.25;
    }
  }
};

WorldConfig config() {
  static const auto model = std::make_shared<Drift>();
  WorldConfig config;
  config.nodes = 0;
  config.bounds_min = {-10, -10, -10};
  config.bounds_max = {10, 10, 10};
  config.layers = {{"a", "b"}, {{0, 0}, {0, 1}}};
  config.motion = model;
  config.limits = {.objects = 4096, .users = 64};
  config.capacities.users = 64;
  return config;
}

Bytes save_of(World& world) {
  MemorySink sink;
  require(world.save(sink) == Status::ok);
  return sink.bytes();
}

void check(std::span<const std::byte> save) {
  MemorySource source(save);
  World world(config(), source);
  const Bytes once = save_of(world);
  MemorySource again(once);
  World same(config(), again);
  require(save_of(same) == once);
  for (int frame = 0; frame < 2; ++frame) {
    require(world.advance() == Status::ok && same.advance() == Status::ok);
  }
  require(world.contacts().size() == same.contacts().size());
}

}  // namespace
}  // namespace ringfence::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  using namespace ringfence;
  const auto* const first = reinterpret_cast<const std::byte*>(input);
  fuzz::Bytes save(first, first + size);
  const std::uint64_t checksum = XXH3_64bits(save.data(), save.size());
  const auto end = std::as_bytes(std::span(&checksum, 1));
  save.insert(save.end(), end.begin(), end.end());
  try {
    fuzz::check(save);
  } catch (const Error&) {
    return 0;  // refused
  }
  return 0;
}
