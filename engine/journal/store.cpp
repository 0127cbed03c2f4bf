#include "journal/store.hpp"

#include <utility>

#include "journal/directory.hpp"
#include "journal/release.hpp"
#include "ringfence/error.hpp"

namespace ringfence::journal {

namespace {

constexpr const char* tables =
    "CREATE TABLE meta(name TEXT PRIMARY KEY, value TEXT) WITHOUT ROWID;"
    "CREATE TABLE snapshots(frame INTEGER PRIMARY KEY, memory INTEGER, size INTEGER, checksum INTEGER, bytes BLOB);"
    "CREATE TABLE parts(low INTEGER, high INTEGER, size INTEGER, checksum INTEGER, bytes BLOB, PRIMARY KEY(low, high));"
    "CREATE TABLE uses(frame INTEGER, low INTEGER, high INTEGER, PRIMARY KEY(frame, low, high)) WITHOUT ROWID;"
    "CREATE TABLE frames(frame INTEGER PRIMARY KEY, size INTEGER, checksum INTEGER, bytes BLOB);"
    "CREATE TABLE irreproducible(frame INTEGER PRIMARY KEY);";

constexpr const char* snapshot_text = "snapshot before frame";
constexpr const char* damaged =
    " is damaged; what is before it can be used: see `ringfence journal --help`, or use a backup";

// With a write-ahead log, FULL puts every transaction on the disk before it ends, and NORMAL every checkpoint.
void set_sync(Database& database, JournalSync sync) {
  database.execute("PRAGMA journal_mode=WAL");
  database.execute(sync == JournalSync::always     ? "PRAGMA synchronous=FULL"
                   : sync == JournalSync::snapshot ? "PRAGMA synchronous=NORMAL"
                                                   : "PRAGMA synchronous=OFF");
}

std::vector<std::uint64_t> numbers(const Database& database, const char* sql) {
  Statement select(database, sql);
  std::vector<std::uint64_t> all;
  while (select.step()) {
    all.push_back(select.number(0));
  }
  return all;
}

}  // namespace

Store Store::create(const std::filesystem::path& directory, JournalSync sync, const std::string& description) {
  const std::filesystem::path file = database_of(directory);
  if (std::filesystem::exists(file)) {
    throw Error("journal: " + file.string() + " exists: continue it with resume, or use another directory");
  }
  Store store(std::make_unique<Database>(file, Database::Access::create));
  set_sync(*store.database_, sync);
  store.begin();
  store.database_->execute(tables);
  store.set_meta("format", std::to_string(format_version));
  store.set_meta("release", release());
  store.set_meta("description", description);
  store.commit();
  return store;
}

Store Store::open(const std::filesystem::path& directory, Database::Access access, JournalSync sync) {
  const std::filesystem::path file = database_of(directory);
  if (!std::filesystem::exists(file)) {
    throw Error("journal: " + file.string() + " does not exist: give the directory that a run with --journal wrote");
  }
  Store store(std::make_unique<Database>(file, access));
  if (const std::string format = store.meta("format"); format != std::to_string(format_version)) {
    throw Error("journal: " + file.string() + " has format " + format + "; this release reads format " +
                std::to_string(format_version) + ": use the release that wrote it, " + store.meta("release"));
  }
  if (access != Database::Access::read) {
    set_sync(*store.database_, sync);
  }
  return store;
}

void Store::add_snapshot(std::uint64_t frame, const SaveInParts& save) {
  const Recipe recipe = recipe_of(save);
  const Packed packed = pack(frame, write_recipe(recipe));
  Statement insert(*database_, "INSERT OR REPLACE INTO snapshots VALUES(?,?,?,?,?)");
  insert.bind(1, frame).bind(2, save.bytes.size()).bind(3, packed.size).bind(4, packed.checksum);
  insert.bind(5, std::span(packed.bytes)).run();
  Statement(*database_, "DELETE FROM uses WHERE frame = ?").bind(1, frame).run();
  std::span<const std::byte> rest(save.bytes);
  for (const Piece& piece : recipe.pieces) {
    if (piece.is_part != 0) {
      add_part(frame, piece.part, rest.first(piece.size));
    }
    rest = rest.subspan(piece.size);
  }
}

void Store::add_part(std::uint64_t frame, const PartName& name, std::span<const std::byte> part) {
  Statement(*database_, "INSERT OR IGNORE INTO uses VALUES(?,?,?)")
      .bind(1, frame)
      .bind(2, name.low)
      .bind(3, name.high)
      .run();
  Statement known(*database_, "SELECT 1 FROM parts WHERE low = ? AND high = ?");
  if (known.bind(1, name.low).bind(2, name.high).step()) {
    return;
  }
  const Packed packed = pack(name.low, part);
  Statement insert(*database_, "INSERT INTO parts VALUES(?,?,?,?,?)");
  insert.bind(1, name.low).bind(2, name.high).bind(3, packed.size).bind(4, packed.checksum);
  insert.bind(5, std::span(packed.bytes)).run();
}

void Store::remove_unused_parts() {
  database_->execute("DELETE FROM parts WHERE (low, high) NOT IN (SELECT low, high FROM uses)");
}

void Store::add_frame(std::uint64_t frame, const Packed& packed) {
  Statement insert(*database_, "INSERT INTO frames VALUES(?,?,?,?)");
  insert.bind(1, frame).bind(2, packed.size).bind(3, packed.checksum).bind(4, std::span(packed.bytes)).run();
}

void Store::add_irreproducible(std::uint64_t frame) {
  Statement(*database_, "INSERT OR REPLACE INTO irreproducible VALUES(?)").bind(1, frame).run();
}

void Store::remove_old(std::uint32_t keep) {
  const auto kept = numbers(*database_, "SELECT frame FROM snapshots ORDER BY frame DESC");
  if (kept.size() <= keep) {
    return;
  }
  const std::uint64_t oldest = kept[keep - 1];
  for (const char* const sql : {"DELETE FROM snapshots WHERE frame < ?", "DELETE FROM uses WHERE frame < ?",
                                "DELETE FROM frames WHERE frame < ?", "DELETE FROM irreproducible WHERE frame < ?"}) {
    Statement(*database_, sql).bind(1, oldest).run();
  }
  remove_unused_parts();
}

void Store::remove_from(std::uint64_t frames) {
  for (const char* const sql : {"DELETE FROM snapshots WHERE frame > ?", "DELETE FROM uses WHERE frame > ?"}) {
    Statement(*database_, sql).bind(1, frames).run();
  }
  remove_unused_parts();
  for (const char* const sql : {"DELETE FROM frames WHERE frame >= ?", "DELETE FROM irreproducible WHERE frame >= ?"}) {
    Statement(*database_, sql).bind(1, frames).run();
  }
}

void Store::checkpoint() { database_->execute("PRAGMA wal_checkpoint(PASSIVE)"); }

std::string Store::meta(const char* name) const {
  const std::string key = name;
  Statement select(*database_, "SELECT value FROM meta WHERE name = ?");
  return select.bind(1, key).step() ? select.text(0) : std::string();
}

void Store::set_meta(const char* name, const std::string& value) {
  const std::string key = name;
  Statement(*database_, "INSERT OR REPLACE INTO meta VALUES(?,?)").bind(1, key).bind(2, value).run();
}

std::vector<JournalSnapshot> Store::snapshots() const {
  // A part counts for the first snapshot that has it.
  Statement parts(
      *database_,
      "SELECT sum(length(bytes)) FROM parts JOIN (SELECT min(frame) AS first, low, high FROM uses GROUP BY low, "
      "high) USING (low, high) WHERE first = ?");
  Statement select(*database_, "SELECT frame, length(bytes), memory FROM snapshots ORDER BY frame");
  std::vector<JournalSnapshot> all;
  while (select.step()) {
    const std::uint64_t frame = select.number(0);
    const std::uint64_t in_parts = parts.bind(1, frame).step() ? parts.number(0) : 0;
    parts.reset();
    all.push_back({frame, select.number(1) + in_parts, select.number(2)});
  }
  return all;
}

std::vector<JournalFrames> Store::frames() const {
  Statement select(*database_, "SELECT frame, length(bytes), size FROM frames ORDER BY frame");
  std::vector<JournalFrames> all;
  while (select.step()) {
    const std::uint64_t frame = select.number(0);
    if (all.empty() || all.back().last + 1 != frame) {
      all.push_back({frame, frame, 0, 0});
    }
    all.back().last = frame;
    all.back().bytes += select.number(1);
    all.back().inputs += select.number(2);
  }
  return all;
}

std::vector<std::uint64_t> Store::irreproducible() const {
  return numbers(*database_, "SELECT frame FROM irreproducible ORDER BY frame");
}

std::optional<std::uint64_t> Store::snapshot_before(std::uint64_t frame) const {
  Statement select(*database_, "SELECT frame FROM snapshots WHERE frame <= ? ORDER BY frame DESC LIMIT 1");
  return select.bind(1, frame).step() ? std::optional(select.number(0)) : std::nullopt;
}

bool Store::is_irreproducible(std::uint64_t frame) const {
  Statement select(*database_, "SELECT frame FROM irreproducible WHERE frame = ?");
  return select.bind(1, frame).step();
}

std::uint64_t Store::frame_bytes(std::uint64_t frame) const {
  Statement select(*database_, "SELECT length(bytes) FROM frames WHERE frame = ?");
  return select.bind(1, frame).step() ? select.number(0) : 0;
}

std::vector<std::byte> Store::read(const char* sql, const char* what, std::uint64_t frame) const {
  Statement select(*database_, sql);
  if (!select.bind(1, frame).step()) {
    fail(what, frame, " is missing: ask for another frame, or use a backup");
  }
  std::vector<std::byte> bytes;
  if (!unpack(frame, select.number(0), select.number(1), select.bytes(2), bytes)) {
    fail(what, frame, damaged);
  }
  return bytes;
}

void Store::fail(const char* what, std::uint64_t frame, const char* how) const {
  throw Error("journal: " + database_->file().string() + ": the " + what + " " + std::to_string(frame) + how);
}

std::vector<std::byte> Store::snapshot(std::uint64_t frame) const {
  Recipe recipe;
  if (!read_recipe(read("SELECT size, checksum, bytes FROM snapshots WHERE frame = ?", snapshot_text, frame), recipe)) {
    fail(snapshot_text, frame, damaged);
  }
  std::vector<std::byte> save;
  std::span<const std::byte> rest(recipe.bytes);
  for (const Piece& piece : recipe.pieces) {
    if (piece.is_part != 0) {
      append_part(frame, piece, save);
    } else {
      save.insert(save.end(), rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(piece.size));
      rest = rest.subspan(piece.size);
    }
  }
  return save;
}

void Store::append_part(std::uint64_t frame, const Piece& piece, std::vector<std::byte>& save) const {
  Statement select(*database_, "SELECT size, checksum, bytes FROM parts WHERE low = ? AND high = ?");
  std::vector<std::byte> part;
  const bool is_right = select.bind(1, piece.part.low).bind(2, piece.part.high).step() &&
                        unpack(piece.part.low, select.number(0), select.number(1), select.bytes(2), part) &&
                        part.size() == piece.size && name_of_part(part) == piece.part;
  if (!is_right) {
    fail(snapshot_text, frame, damaged);
  }
  save.insert(save.end(), part.begin(), part.end());
}

std::vector<std::byte> Store::frame(std::uint64_t frame) const {
  return read("SELECT size, checksum, bytes FROM frames WHERE frame = ?", "record of frame", frame);
}

}  // namespace ringfence::journal
