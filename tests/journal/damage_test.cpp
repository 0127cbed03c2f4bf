// Journals whose files were damaged: what is read is right, or refused.
#include <cstdint>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/script.hpp"
#include "journal/directory.hpp"
#include "journal/journal_world.hpp"

namespace ringfence::test {
namespace {

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

void write_file(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

TEST_CASE("what is read of a damaged journal is right or refused, and what is before the damage can be read") {
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  const TemporaryDirectory directory;
  std::vector<std::uint64_t> expected;
  {
    JournalConfig journal;
    journal.directory = directory.path();
    journal.snapshot_every = 5;
    WorldConfig config = journal_world(0);
    config.recorder = Journal::create(journal);
    World world(config);
    Script script(world, seed, journal_side);
    for (int frame = 0; frame < 14; ++frame) {
      script.make_requests();
      REQUIRE(world.advance() == Status::ok);
      expected.push_back(fingerprint(world));
    }
  }
  const std::filesystem::path file = journal::database_of(directory.path());
  const std::string good = read_file(file);
  REQUIRE(good.size() > 8192);
  int refused = 0, right = 0;
  for (int i = 0; i < 150; ++i) {
    std::string bad = good;
    if (i % 5 == 0) {
      bad.resize(random() % bad.size());  // cut off
    } else {
      for (std::uint64_t n = 1 + random() % 4; n > 0; --n) {
        bad[random() % bad.size()] = static_cast<char>(random());
      }
    }
    write_file(file, bad);
    const std::uint64_t frames = 1 + random() % expected.size();
    CAPTURE(i);
    CAPTURE(frames);
    try {
      const JournalReader reader(directory.path());
      (void)reader.contents();
      const World world = reader.restore(journal_world(0), frames);
      CHECK(world.frames() == frames);
      CHECK(world.objects().size() > 0);
      std::uint64_t ended = fingerprint(world);
      // A world that is restored from a snapshot has no list of ended contacts.
      if (world.report().objects != 0) CHECK(ended == expected[frames - 1]);
      ++right;
    } catch (const Error& error) {
      CHECK(std::string(error.what()).find("journal") != std::string::npos);
      ++refused;
    }
  }
  CHECK(refused > 0);
  CHECK(right > 0);
}

}  // namespace
}  // namespace ringfence::test
