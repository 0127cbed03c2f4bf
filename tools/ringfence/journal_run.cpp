#include "journal_run.hpp"

#include <cstring>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "exit_code.hpp"
#include "worlds/load.hpp"

namespace ringfence::tools {

DigestSoFar DigestSoFar::of(const World& world) noexcept {
  DigestSoFar digest;
  const std::span<const std::byte> own = world.saved_bytes();
  if (own.size() == sizeof digest) std::memcpy(&digest, own.data(), sizeof digest);
  return digest;
}

JournalRun::JournalRun(const Job& job, Figures& figures, FrameObserver observe)
    : job_(job), figures_(figures), observe_(std::move(observe)) {}

std::vector<std::byte> JournalRun::own_bytes() const {
  const DigestSoFar digest{figures_.digest(), digested_ + figures_.frames()};
  std::vector<std::byte> bytes(sizeof digest);
  std::memcpy(bytes.data(), &digest, sizeof digest);
  return bytes;
}

JournalConfig JournalRun::journal_config(const LogHook& log) {
  JournalConfig config;
  config.directory = job_.journal.directory;
  config.sync = job_.journal.sync;
  config.snapshot_every = job_.journal.snapshot_every;
  config.keep_snapshots = job_.journal.keep_snapshots;
  config.description = job_.journal.description;
  config.accept_release = job_.journal.accept_release;
  config.own = [this] { return own_bytes(); };
  config.log = log;
  return config;
}

World JournalRun::make_world(WorldConfig config) {
  if (job_.journal.resumes) return continue_world(std::move(config));
  if (!job_.journal.directory.empty()) {
    journal_ = Journal::create(journal_config(config.log));
    config.recorder = journal_;
  }
  World world(std::move(config));
  worlds::load_into(world, job_.scene, job_.service.users);
  return world;
}

// The frames since the last snapshot are run in one thread of this process, then the world goes on in its deployment.
World JournalRun::continue_world(WorldConfig config) {
  MemorySink sink;
  {
    const JournalReader reader(job_.journal.directory);
    WorldConfig local = config;
    local.remote_nodes = nullptr;
    local.nodes = 0;
    local.log = nullptr;
    bool is_snapshot = true;
    World world = reader.restore(std::move(local), reader.frames(),
                                 [&](const World& each) { add_frame(each, std::exchange(is_snapshot, false)); });
    if (world.save(sink) != Status::ok) throw Error("the world of the journal cannot be saved; see World::save");
    const std::uint64_t total = std::uint64_t{job_.frames.warmup} + job_.frames.frames;
    if (world.frames() > total) {
      throw Error(fmt::format("--frames: found {}; expected at least {}, the counted frames of the journal",
                              job_.frames.frames, world.frames() - job_.frames.warmup));
    }
  }
  journal_ = Journal::append(journal_config(config.log));
  config.recorder = journal_;
  MemorySource source(sink.bytes());
  World world(std::move(config), source);
  if (!job_.output.quiet) {
    fmt::print(stderr, "ringfence: continues after {} frames of {}\n", world.frames(), job_.journal.directory);
  }
  return world;
}

// A snapshot is made before its last frame is added to the digest, unless it is the first of a process.
void JournalRun::add_frame(const World& world, bool is_snapshot) {
  const std::uint64_t counted = world.frames() - std::min<std::uint64_t>(world.frames(), job_.frames.warmup);
  if (is_snapshot) {
    const DigestSoFar before = DigestSoFar::of(world);
    figures_.continue_digest(before.value);
    digested_ = before.frames;
  }
  if (digested_ < counted) {
    figures_.add_to_digest(world.contacts());
    ++digested_;
  }
  if (observe_) observe_(world.frames(), figures_.digest());
}

void JournalRun::count_frame(const World& world) {
  figures_.add_to_digest(world.contacts());
  ++digested_;
  if (observe_) observe_(world.frames(), figures_.digest());
}

void JournalRun::finish() {
  if (journal_ != nullptr && !journal_->flush()) {
    throw IncompleteError(
        fmt::format("the journal in {} is not complete: {}", job_.journal.directory, journal_->failure()));
  }
}

}  // namespace ringfence::tools
