#include "ringfence/journal.hpp"

#include <optional>
#include <system_error>
#include <utility>

#include "journal/directory.hpp"
#include "journal/release.hpp"
#include "journal/save_parts.hpp"
#include "journal/store.hpp"
#include "journal/writer.hpp"
#include "ringfence/error.hpp"

namespace ringfence {

using journal::Entry;

struct Journal::Implementation {
  Implementation(JournalConfig given, std::unique_ptr<journal::WriteLock> write_lock, journal::Store store)
      : config(std::move(given)),
        lock(std::move(write_lock)),
        writer(std::in_place, std::move(store), config.backlog, config.keep_snapshots) {}

  /// Adds a snapshot of the world; ends the journal if it cannot be saved or written.
  void add_snapshot(World& world) {
    journal::PartsSink sink;
    const std::vector<std::byte> own = config.own ? config.own() : std::vector<std::byte>();
    if (const Status status = world.save(sink, own); status != Status::ok) {
      return end(std::string("the world cannot be saved (") + name_of(status) + "); see World::save");
    }
    last_snapshot = world.frames();
    add({Entry::Kind::snapshot, world.frames(), sink.take(), {}});
  }

  bool add(Entry entry) { return writer && (writer->add(std::move(entry)) || fail()); }

  /// Whether the frame may run, or counts as done: with `always` only if the journal goes on.
  bool may_go_on() const noexcept { return writer.has_value() || config.sync != JournalSync::always; }

  bool fail() {
    end(writer->failure());
    return false;
  }
  void end(std::string reason) {
    failure = std::move(reason);
    writer.reset();
    if (config.log) {
      const bool stops = config.sync == JournalSync::always;
      config.log(LogLevel::error, "the journal in " + config.directory.string() + " has ended" +
                                      (stops ? ", and no further frame runs: " : "; the world goes on without it: ") +
                                      failure);
    }
  }

  JournalConfig config;
  std::unique_ptr<journal::WriteLock> lock;
  std::optional<journal::Writer> writer;  ///< none after a failure
  std::string failure;
  std::optional<std::uint64_t> last_snapshot;
};

namespace {

void check(const JournalConfig& config) {
  if (config.snapshot_every == 0 || config.keep_snapshots == 0) {
    throw Error("JournalConfig: snapshot_every is " + std::to_string(config.snapshot_every) +
                " and keep_snapshots is " + std::to_string(config.keep_snapshots) + "; both must be 1 or more");
  }
}

}  // namespace

Journal::Journal(std::unique_ptr<Implementation> implementation) : implementation_(std::move(implementation)) {}
Journal::~Journal() = default;

std::shared_ptr<Journal> Journal::create(JournalConfig config) {
  check(config);
  std::error_code error;
  std::filesystem::create_directories(config.directory, error);
  if (error) {
    throw Error("journal: " + config.directory.string() + " cannot be created (" + error.message() +
                "): check the path and its permissions");
  }
  auto lock = std::make_unique<journal::WriteLock>(config.directory);
  journal::Store store = journal::Store::create(config.directory, config.sync, config.description);
  return std::make_shared<Journal>(
      std::make_unique<Implementation>(std::move(config), std::move(lock), std::move(store)));
}

std::shared_ptr<Journal> Journal::append(JournalConfig config) {
  check(config);
  if (!std::filesystem::exists(journal::database_of(config.directory))) {
    throw Error("journal: " + journal::database_of(config.directory).string() +
                " does not exist: give the directory that a run with --journal wrote");
  }
  auto lock = std::make_unique<journal::WriteLock>(config.directory);
  journal::Store store = journal::Store::open(config.directory, journal::Database::Access::write, config.sync);
  if (const std::string other = store.meta("release"); other != journal::release()) {
    if (!config.accept_release) {
      throw Error("journal: " + config.directory.string() + " was written by release " + other + "; this is " +
                  journal::release() + ": use that release, or --accept-release to start a new digest");
    }
    store.set_meta("release", journal::release());
  }
  return std::make_shared<Journal>(
      std::make_unique<Implementation>(std::move(config), std::move(lock), std::move(store)));
}

// The first frame after a start needs a snapshot: a new journal has none, and the releases may differ.
bool Journal::begin_frame(World& world, std::span<const std::byte> inputs) {
  Implementation& j = *implementation_;
  if (!j.last_snapshot) {
    if (j.add({Entry::Kind::start, world.frames(), {}, {}})) {
      j.add_snapshot(world);
    }
  }
  j.add({Entry::Kind::frame, world.frames(), {}, {inputs.begin(), inputs.end()}});
  return j.may_go_on();
}

bool Journal::finish_frame(World& world, bool reproducible) {
  Implementation& j = *implementation_;
  if (!reproducible) {
    j.add({Entry::Kind::irreproducible, world.frames() - 1, {}, {}});
  }
  if (j.writer && (!reproducible || world.frames() >= *j.last_snapshot + j.config.snapshot_every)) {
    j.add_snapshot(world);
  }
  if (j.writer && j.config.sync == JournalSync::always && !j.writer->wait()) {
    j.fail();
  }
  return j.may_go_on();
}

bool Journal::flush() {
  Implementation& j = *implementation_;
  return j.writer && (j.writer->wait() || j.fail());
}

std::string Journal::failure() const { return implementation_->failure; }

}  // namespace ringfence
