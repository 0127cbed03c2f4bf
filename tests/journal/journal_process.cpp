// Runs a world with a journal until it is killed: creates the journal, or continues from it. Arguments: directory and
// seed of the requests. For each frame that was acknowledged it prints its number and the fingerprint of the world.
#define DOCTEST_CONFIG_IMPLEMENT
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include <doctest/doctest.h>

#include "facade/script.hpp"
#include "journal/directory.hpp"
#include "journal/journal_world.hpp"

int main(int argc, char** argv) {
  using namespace ringfence;
  using namespace ringfence::test;
  if (argc != 3) return 2;
  doctest::Context context;  // Script has assertions
  context.setAsDefaultForAssertsOutOfTestCases();
  context.setAssertHandler([](const doctest::AssertData& failed) {
    std::fprintf(stderr, "%s:%d: %s\n", failed.m_file, failed.m_line, failed.m_expr);
    std::abort();
  });
  JournalConfig journal;
  journal.directory = argv[1];
  journal.sync = JournalSync::always;
  journal.snapshot_every = 8;
  const auto seed = static_cast<std::uint32_t>(std::atoi(argv[2]));
  std::mt19937 random(seed);
  WorldConfig config = journal_world(static_cast<unsigned>(random() % 24));
  const bool continues = std::filesystem::exists(journal::database_of(journal.directory));
  MemorySink sink;
  if (continues) {
    const JournalReader reader(journal.directory);
    World world = reader.restore(journal_world(0), reader.frames());
    if (world.save(sink) != Status::ok) return 3;
    config.recorder = Journal::append(journal);
  } else {
    config.recorder = Journal::create(journal);
  }
  MemorySource source(sink.bytes());
  World world = continues ? World(config, source) : World(config);
  Script script(world, seed, journal_side);  // adds its own shapes, users and objects
  for (;;) {
    script.make_requests();
    if (world.advance() != Status::ok) return 4;
    std::printf("%llu %llu\n", static_cast<unsigned long long>(world.frames()),
                static_cast<unsigned long long>(fingerprint(world)));
    std::fflush(stdout);
  }
}
