// A world with a journal: it runs, is dropped as if the process had been killed, and continues. docs/journal.md shows
// the lines.
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>

#include <ringfence/digest.hpp>
#include <ringfence/journal.hpp>
#include <ringfence/world.hpp>

using namespace ringfence;

namespace {

// Objects fall to the ground, a tenth of a metre a frame.
class Falling final : public MotionModel {
 public:
  std::string_view name() const noexcept override { return "falling"; }
  std::uint64_t version() const noexcept override { return 1; }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i)
      if (inputs[i].contacts.empty()) outputs[i].pose.position.z -= 0.1;
  }
};

WorldConfig config_with(std::uint32_t nodes) {
  WorldConfig config;
  config.nodes = nodes;
  config.motion = std::make_shared<Falling>();
  return config;
}

// In every third frame a ball appears: a request, which the journal has.
void run_to(World& world, std::uint64_t frames, ShapeId ball) {
  while (world.frames() < frames) {
    const double x = static_cast<double>(world.frames() % 7);
    if (world.frames() % 3 == 0) (void)world.spawn({.shape = ball, .pose = {{x, 0, 4}, {}}});
    if (world.advance() != Status::ok) return;
  }
}

std::uint64_t digest_of(const World& world) {
  Digest digest;
  digest.add_frame(world.contacts());
  return digest.value();
}

void populate(World& world) {
  const ShapeId ball = world.add_shape(Sphere{0.5f}), ground = world.add_shape(Box{{50, 50, 1}});
  (void)ball;
  (void)world.spawn({.shape = ground, .category = Category::fixed, .pose = {{0, 0, -1}, {}}});
}

void run_until_it_is_killed(const std::filesystem::path& directory) {
  WorldConfig config = config_with(1);
  JournalConfig journal;
  journal.directory = directory;
  journal.sync = JournalSync::always;
  config.recorder = Journal::create(journal);
  World world(config);
  populate(world);
  run_to(world, 70, ShapeId(0));
}

int continue_to_100(const std::filesystem::path& directory, std::uint64_t expected) {
  WorldConfig config = config_with(2);
  JournalConfig journal;
  journal.directory = directory;
  const JournalReader reader(directory);
  MemorySink saved;
  if (reader.restore(config, reader.frames()).save(saved) != Status::ok) return 1;
  MemorySource source(saved.bytes());
  config.recorder = Journal::append(journal);
  World continued(config, source);
  run_to(continued, 100, ShapeId(0));
  std::printf("frame 99 has %zu contacts, %s\n", continued.contacts().size(),
              digest_of(continued) == expected ? "the same as without the interruption" : "other ones");
  return 0;
}

}  // namespace

int main() {
  const std::filesystem::path directory = std::filesystem::temp_directory_path() / "ringfence_journal_example";
  std::filesystem::remove_all(directory);
  World uninterrupted(config_with(0));
  populate(uninterrupted);
  run_to(uninterrupted, 100, ShapeId(0));

  run_until_it_is_killed(directory);
  const int result = continue_to_100(directory, digest_of(uninterrupted));
  std::filesystem::remove_all(directory);
  return result;
}
