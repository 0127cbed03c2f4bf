// Saves a world to a file, and restores it with other nodes: docs/saving.md shows the lines.
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <span>

#include <ringfence/digest.hpp>
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

class FileSink final : public Sink {
 public:
  explicit FileSink(const std::filesystem::path& path) : file_(path, std::ios::binary) {}
  bool write(std::span<const std::byte> bytes) override {
    file_.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return file_.good();
  }
  bool close() { return file_.close(), !file_.fail(); }

 private:
  std::ofstream file_;
};

class FileSource final : public Source {
 public:
  explicit FileSource(const std::filesystem::path& path) : file_(path, std::ios::binary) {}
  std::size_t read(std::span<std::byte> bytes) override {
    file_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return static_cast<std::size_t>(file_.gcount());
  }

 private:
  std::ifstream file_;
};

// A crash while it writes leaves the old save as it is.
bool save(World& world, const std::filesystem::path& path, const Digest& digest) {
  const std::filesystem::path unfinished = path.string() + ".unfinished";
  FileSink file(unfinished);
  const std::uint64_t own = digest.value();
  if (world.save(file, std::as_bytes(std::span(&own, 1))) != Status::ok || !file.close()) return false;
  std::filesystem::rename(unfinished, path);
  return true;
}

WorldConfig config_with(std::uint32_t nodes) {
  WorldConfig config;
  config.nodes = nodes;
  config.motion = std::make_shared<Falling>();
  return config;
}

void run_to(World& world, std::uint64_t frames, Digest& digest) {
  while (world.frames() < frames && world.advance() == Status::ok) digest.add_frame(world.contacts());
}

}  // namespace

int main() {
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "ringfence_saving_example";
  World world(config_with(1));
  const ShapeId ball = world.add_shape(Sphere{1}), ground = world.add_shape(Box{{50, 50, 1}});
  (void)world.spawn({.shape = ground, .category = Category::fixed, .pose = {{0, 0, -1}, {}}});
  for (int i = 0; i < 40; ++i) (void)world.spawn({.shape = ball, .pose = {{i % 7 * 1.5, i % 3 * 1.5, 2.0 + i}, {}}});

  Digest digest;
  run_to(world, 50, digest);
  if (!save(world, path, digest)) return 1;
  const std::uint64_t at_save = digest.value();
  run_to(world, 100, digest);

  FileSource file(path);
  World restored(config_with(3), file);
  Digest continued(at_save);
  run_to(restored, 100, continued);
  std::printf("%zu contacts in frame 99; after the restart %zu; %s digest\n", world.contacts().size(),
              restored.contacts().size(), continued.value() == digest.value() ? "the same" : "another");
  std::filesystem::remove(path);
}
