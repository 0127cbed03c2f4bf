#include "ringfence/journal.hpp"

#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "facade/script.hpp"
#include "journal/database.hpp"
#include "journal/directory.hpp"
#include "journal/journal_world.hpp"

namespace ringfence::test {
namespace {

std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

JournalConfig config_in(const TemporaryDirectory& directory, JournalSync sync) {
  JournalConfig config;
  config.directory = directory.path();
  config.sync = sync;
  config.snapshot_every = 6;
  config.keep_snapshots = 100;
  return config;
}

TEST_CASE("every frame of a journal is reproduced, with its states and contacts, in any deployment") {
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937 random(seed);
  for (const JournalSync sync : {JournalSync::always, JournalSync::snapshot, JournalSync::never}) {
    CAPTURE(name_of(sync));
    const TemporaryDirectory directory;
    std::vector<std::uint64_t> expected;
    {
      WorldConfig config = journal_world(static_cast<unsigned>(random() % 24));
      config.recorder = Journal::create(config_in(directory, sync));
      World world(config);
      Script script(world, seed, journal_side);
      for (int frame = 0; frame < 40; ++frame) {
        script.make_requests();
        REQUIRE(world.begin_frame() == Status::ok);
        const bool early = frame % 3 == 0;  // requests for the next frame while this one is running
        if (early) script.make_requests();
        REQUIRE(world.finish_frame() == Status::ok);
        // The state of an object that these requests destroy is no longer shown.
        expected.push_back(early ? 0 : fingerprint(world));
      }
    }
    const JournalReader reader(directory.path());
    CHECK(reader.frames() == expected.size());
    const JournalContents contents = reader.contents();
    REQUIRE(contents.frames.size() == 1);
    CHECK(contents.frames[0].first == 0);
    CHECK(contents.frames[0].last == expected.size() - 1);
    CHECK(contents.snapshots.size() == 1 + expected.size() / 6);
    CHECK(contents.irreproducible.empty());
    for (int i = 0; i < 8; ++i) {
      const std::uint64_t frames = 1 + random() % expected.size();
      CAPTURE(frames);
      std::uint64_t at = 0;
      const World world =
          reader.restore(journal_world(static_cast<unsigned>(random() % 24)), frames, [&](const World& each) {
            at = each.frames();
            if (each.report().objects != 0 && expected[at - 1] != 0) CHECK(fingerprint(each) == expected[at - 1]);
          });
      CHECK(world.frames() == frames);
      CHECK((at == 0 || at == frames));
    }
    CHECK(!reader.verify(journal_world(static_cast<unsigned>(random() % 24))));
    CHECK(error_of([&] { (void)reader.restore(journal_world(0), expected.size() + 1); }).find("missing") !=
          std::string::npos);
  }
}

TEST_CASE("a world that continues from its journal again and again is the one that was never interrupted") {
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937 random(seed);
  const TemporaryDirectory directory;
  World reference(journal_world(0));
  WorldConfig config = journal_world(5);
  config.recorder = Journal::create(config_in(directory, JournalSync::snapshot));
  World world(config);
  config.recorder = nullptr;
  Script reference_script(reference, seed, journal_side), script(world, seed, journal_side);
  for (int frame = 0; frame < 50; ++frame) {
    reference_script.make_requests();
    script.make_requests();
    REQUIRE(reference.advance() == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(fingerprint(world) == fingerprint(reference));
    if (random() % 6 == 0) {
      MemorySink sink;
      {
        world = World(journal_world(0));  // frees the journal
        const JournalReader reader(directory.path());
        World restored = reader.restore(journal_world(0), reader.frames());
        REQUIRE(restored.save(sink) == Status::ok);
      }
      WorldConfig next = journal_world(static_cast<unsigned>(random() % 24));
      next.recorder = Journal::append(config_in(directory, JournalSync::snapshot));
      MemorySource source(sink.bytes());
      world = World(next, source);
    }
  }
  world = World(journal_world(0));
  const JournalReader reader(directory.path());
  CHECK(reader.frames() == 50);
  CHECK(reader.contents().frames.size() == 1);
  CHECK(!reader.verify(journal_world(2)));
}

TEST_CASE("old snapshots and the frames before them are removed") {
  const TemporaryDirectory directory;
  JournalConfig journal = config_in(directory, JournalSync::never);
  journal.keep_snapshots = 2;
  WorldConfig config = journal_world(1);
  config.recorder = Journal::create(journal);
  World world(config);
  Script script(world, 3, journal_side);
  for (int frame = 0; frame < 40; ++frame) {
    script.make_requests();
    REQUIRE(world.advance() == Status::ok);
  }
  const std::uint64_t expected = fingerprint(world);
  config.recorder.reset();
  world = World(journal_world(0));
  const JournalReader reader(directory.path());
  const JournalContents contents = reader.contents();
  REQUIRE(contents.snapshots.size() == 2);
  CHECK(contents.snapshots[0].frame == 30);
  CHECK(contents.frames.front().first == 30);
  CHECK(fingerprint(reader.restore(journal_world(0), 40)) == expected);
  CHECK(error_of([&] { (void)reader.restore(journal_world(0), 29); }).find("begins with frame 30") !=
        std::string::npos);
}

/// A terrain whose heights are random, so that it cannot be compressed by much.
TriangleMesh rough_terrain(std::uint32_t side) {
  std::mt19937 random(8);
  std::uniform_real_distribution<float> height(-1, 0);
  TriangleMesh mesh;
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::uint32_t x = 0; x < side; ++x) {
      mesh.vertices.push_back({static_cast<float>(x), static_cast<float>(y), height(random)});
      if (x > 0 && y > 0) {
        const std::uint32_t corner = y * side + x;
        for (const std::uint32_t index : {corner, corner - 1, corner - side}) mesh.indices.push_back(index);
      }
    }
  }
  return mesh;
}

std::uint64_t parts_in(const TemporaryDirectory& directory) {
  const journal::Database database(journal::database_of(directory.path()), journal::Database::Access::read);
  journal::Statement count(database, "SELECT count(*) FROM parts");
  REQUIRE(count.step());
  return count.number(0);
}

TEST_CASE("a shape that several snapshots have is stored once, until no snapshot has it") {
  const TemporaryDirectory directory;
  JournalConfig journal = config_in(directory, JournalSync::never);
  journal.keep_snapshots = 3;
  WorldConfig config = journal_world(1);
  config.recorder = Journal::create(journal);
  World world(config);
  const TriangleMesh terrain = rough_terrain(40);
  const std::size_t terrain_bytes = terrain.vertices.size() * sizeof(Vec3f);
  const ShapeId shape = world.add_shape(terrain);
  const ObjectId ground = world.spawn({.shape = shape, .category = Category::fixed}).id;
  const auto advance = [&](int frames) {
    for (; frames > 0; --frames) REQUIRE(world.advance() == Status::ok);
  };
  advance(13);
  {
    const JournalReader reader(directory.path());
    while (reader.contents().snapshots.size() < 3) std::this_thread::yield();
    const auto snapshots = reader.contents().snapshots;
    CHECK(parts_in(directory) == 2);  // vertices and triangles
    CHECK(snapshots[0].bytes > terrain_bytes / 2);
    for (const JournalSnapshot& snapshot : snapshots) CHECK(snapshot.memory > terrain_bytes);
    CHECK(snapshots[1].bytes < terrain_bytes / 10);
    CHECK(snapshots[2].bytes < terrain_bytes / 10);
  }
  advance(12);  // the snapshot that wrote the parts is removed
  REQUIRE(world.destroy(ground) == Status::ok);
  advance(1);
  const std::uint64_t expected = fingerprint(world);
  REQUIRE(world.remove_shape(shape) == Status::ok);
  advance(1);
  config.recorder.reset();
  world = World(journal_world(0));
  {
    const JournalReader reader(directory.path());
    CHECK(reader.contents().snapshots.front().frame == 12);
    CHECK(parts_in(directory) == 2);
    CHECK(fingerprint(reader.restore(journal_world(0), 26)) == expected);
    CHECK(!reader.verify(journal_world(3)));
  }
  MemorySink sink;
  REQUIRE(JournalReader(directory.path()).restore(journal_world(0), 27).save(sink) == Status::ok);
  MemorySource source(sink.bytes());
  config.recorder = Journal::append(journal);
  world = World(config, source);
  advance(13);  // three snapshots without the shape
  config.recorder.reset();
  world = World(journal_world(0));
  CHECK(JournalReader(directory.path()).contents().snapshots.size() == 3);
  CHECK(parts_in(directory) == 0);
}

TEST_CASE("a frame in which the model throws is known from the snapshot after it") {
  class Failing final : public BouncingModel {
   public:
    using BouncingModel::BouncingModel;
    void move(std::uint64_t frame, std::span<const MotionInput> inputs,
              std::span<MotionOutput> outputs) const override {
      if (frame == 9 && fails) throw Error("out of luck");
      BouncingModel::move(frame, inputs, outputs);
    }
    bool fails = true;
  };
  const TemporaryDirectory directory;
  const auto model = std::make_shared<Failing>(journal_side);
  WorldConfig config = journal_world(2);
  config.motion = model;
  config.recorder = Journal::create(config_in(directory, JournalSync::always));
  World world(config);
  Script script(world, 4, journal_side);
  std::vector<std::uint64_t> expected;
  for (int frame = 0; frame < 20; ++frame) {
    script.make_requests();
    REQUIRE(world.advance() == Status::ok);
    expected.push_back(fingerprint(world));
  }
  config.recorder.reset();
  world = World(journal_world(0));
  model->fails = false;  // it would not throw now
  WorldConfig other = journal_world(0);
  other.motion = model;
  const JournalReader reader(directory.path());
  CHECK(reader.contents().irreproducible == std::vector<std::uint64_t>{9});
  CHECK(reader.contents().frames.size() == 1);
  for (const std::uint64_t frames : {9u, 11u, 20u}) {
    CHECK(fingerprint(reader.restore(other, frames)) == expected[frames - 1]);
  }
  CHECK(reader.restore(other, 10).frames() == 10);
  CHECK(!reader.verify(other));
}

TEST_CASE("a directory has one journal, one writer and one release") {
  const TemporaryDirectory directory;
  const JournalConfig journal = config_in(directory, JournalSync::never);
  CHECK(error_of([&] { (void)Journal::append(journal); }).find("does not exist") != std::string::npos);
  CHECK(error_of([&] { const JournalReader reader(directory.path()); }).find("does not exist") != std::string::npos);
  {
    const auto first = Journal::create(journal);
    CHECK(error_of([&] { (void)Journal::create(journal); }).find("another process") != std::string::npos);
    CHECK(error_of([&] { (void)Journal::append(journal); }).find("another process") != std::string::npos);
    const JournalReader reader(directory.path());
    CHECK(error_of([&] { (void)reader.frames(); }).find("no snapshot") != std::string::npos);
  }
  CHECK(error_of([&] { (void)Journal::create(journal); }).find("exists") != std::string::npos);
  CHECK(error_of([&] { (void)Journal::append(journal); }).empty());
  const auto set_meta = [&](const char* sql) {
    journal::Database(journal::database_of(directory.path()), journal::Database::Access::write).execute(sql);
  };
  set_meta("UPDATE meta SET value = '0.0.9' WHERE name = 'release'");
  CHECK(error_of([&] { (void)Journal::append(journal); }).find("0.0.9") != std::string::npos);
  JournalConfig accepting = journal;
  accepting.accept_release = true;
  CHECK(error_of([&] { (void)Journal::append(accepting); }).empty());
  CHECK(error_of([&] { (void)Journal::append(journal); }).empty());
  set_meta("UPDATE meta SET value = '99' WHERE name = 'format'");
  CHECK(error_of([&] { (void)Journal::append(journal); }).find("format 99") != std::string::npos);
  CHECK(error_of([&] { const JournalReader reader(directory.path()); }).find("format 99") != std::string::npos);
  JournalConfig wrong = journal;
  wrong.snapshot_every = 0;
  CHECK(error_of([&] { (void)Journal::create(wrong); }).find("snapshot_every") != std::string::npos);
}

TEST_CASE("the caller's description and bytes come back") {
  const TemporaryDirectory directory;
  JournalConfig journal = config_in(directory, JournalSync::never);
  journal.description = "run --objects 7";
  journal.own = [] { return std::vector<std::byte>(3, std::byte{42}); };
  WorldConfig config = journal_world(0);
  config.recorder = Journal::create(journal);
  {
    World world(config);
    REQUIRE(world.advance() == Status::ok);
  }
  config.recorder.reset();
  const JournalReader reader(directory.path());
  CHECK(reader.contents().description == "run --objects 7");
  const World world = reader.restore(journal_world(0), 1);
  CHECK(world.saved_bytes().size() == 3);
  CHECK(world.saved_bytes()[0] == std::byte{42});
}

}  // namespace
}  // namespace ringfence::test
