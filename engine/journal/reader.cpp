#include <algorithm>
#include <cstring>
#include <span>
#include <system_error>

#include "journal/directory.hpp"
#include "journal/store.hpp"
#include "ringfence/error.hpp"
#include "ringfence/journal.hpp"

namespace ringfence {

struct JournalReader::Implementation {
  explicit Implementation(const std::filesystem::path& given)
      : directory(given), store(journal::Store::open(given, journal::Database::Access::read, JournalSync::never)) {}

  std::filesystem::path directory;
  journal::Store store;
};

namespace {

World restore_snapshot(const journal::Store& store, WorldConfig config, std::uint64_t frame) {
  const std::vector<std::byte> bytes = store.snapshot(frame);
  MemorySource source(bytes);
  return World(std::move(config), source);
}

/// Runs the frame that the journal has for the world.
void run_frame(const journal::Store& store, World& world) {
  const std::uint64_t frame = world.frames();
  Status status = world.apply(store.frame(frame));
  status = status == Status::ok ? world.advance() : status;
  if (status != Status::ok) {
    throw Error("journal: frame " + std::to_string(frame) + " cannot be run again (" + name_of(status) +
                "): use the same motion model and the same limits as the run that wrote it");
  }
}

/// Whether two worlds have the same objects, states and contacts. A snapshot may have a request that destroys an
/// object: then its state is not shown.
bool are_same(const World& p, const World& q) {
  const std::span<const Contact> a = p.contacts(), b = q.contacts();
  if (a.size() != b.size() || (!a.empty() && std::memcmp(a.data(), b.data(), a.size_bytes()) != 0)) {
    return false;
  }
  const std::vector<ObjectView> views = p.objects(), others = q.objects();
  return std::equal(
      views.begin(), views.end(), others.begin(), others.end(), [&](const ObjectView& one, const ObjectView& other) {
        const auto state = p.state(one.id), same = q.state(other.id);
        return one.id == other.id && one.spec.shape == other.spec.shape && one.spec.layer == other.spec.layer &&
               one.spec.group == other.spec.group && one.spec.enabled == other.spec.enabled &&
               one.spec.pose == other.spec.pose &&
               (state.empty() || same.empty() || std::equal(state.begin(), state.end(), same.begin(), same.end()));
      });
}

}  // namespace

JournalReader::JournalReader(const std::filesystem::path& directory)
    : implementation_(std::make_unique<Implementation>(directory)) {}
JournalReader::~JournalReader() = default;

JournalContents JournalReader::contents() const {
  const journal::Store& store = implementation_->store;
  JournalContents contents;
  contents.description = store.meta("description");
  contents.release = store.meta("release");
  contents.snapshots = store.snapshots();
  contents.frames = store.frames();
  contents.irreproducible = store.irreproducible();
  for (const auto& file : std::filesystem::directory_iterator(implementation_->directory)) {
    std::error_code error;
    const std::uintmax_t size = file.is_regular_file(error) ? file.file_size(error) : 0;
    contents.file_bytes += error ? 0 : size;
  }
  return contents;
}

std::uint64_t JournalReader::frame_bytes(std::uint64_t frame) const {
  return implementation_->store.frame_bytes(frame);
}

// The last frame may be irreproducible without the snapshot after it: then it was not acknowledged.
std::uint64_t JournalReader::frames() const {
  const journal::Store& store = implementation_->store;
  const std::vector<JournalSnapshot> snapshots = store.snapshots();
  if (snapshots.empty()) {
    throw Error("journal: " + implementation_->directory.string() +
                " has no snapshot: the run ended before its first frame; start it again in another directory");
  }
  std::uint64_t frames = snapshots.back().frame;
  for (const JournalFrames& run : store.frames()) {
    if (run.first <= frames && run.last >= frames) {
      frames = run.last + 1;
    }
  }
  for (const std::uint64_t frame : store.irreproducible()) {
    frames = frame >= snapshots.back().frame ? std::min(frames, frame) : frames;
  }
  return frames;
}

World JournalReader::restore(WorldConfig config, std::uint64_t frames,
                             const std::function<void(const World&)>& each) const {
  const journal::Store& store = implementation_->store;
  const std::optional<std::uint64_t> snapshot = store.snapshot_before(frames);
  if (!snapshot) {
    const std::vector<JournalSnapshot> all = store.snapshots();
    throw Error("journal: " + implementation_->directory.string() + " begins with frame " +
                std::to_string(all.empty() ? 0 : all.front().frame) + "; asked for " + std::to_string(frames) +
                ": ask for a later one");
  }
  World world = restore_snapshot(store, std::move(config), *snapshot);
  if (each) {
    each(world);
  }
  while (world.frames() < frames) {
    if (store.is_irreproducible(world.frames())) {
      throw Error("journal: frame " + std::to_string(world.frames()) +
                  " depended on a late user node or on an exception, and the snapshot after it is missing: ask for an "
                  "earlier frame");
    }
    run_frame(store, world);
    if (each) {
      each(world);
    }
  }
  return world;
}

std::optional<std::uint64_t> JournalReader::verify(const WorldConfig& config) const {
  const journal::Store& store = implementation_->store;
  const std::vector<JournalSnapshot> snapshots = store.snapshots();
  for (std::size_t i = 0; i + 1 < snapshots.size(); ++i) {
    World world = restore_snapshot(store, config, snapshots[i].frame);
    while (world.frames() < snapshots[i + 1].frame && !store.is_irreproducible(world.frames())) {
      run_frame(store, world);
    }
    if (world.frames() == snapshots[i + 1].frame && !are_same(world, restore_snapshot(store, config, world.frames()))) {
      return world.frames();
    }
  }
  return {};
}

}  // namespace ringfence
