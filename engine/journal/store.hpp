#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "journal/database.hpp"
#include "journal/packed.hpp"
#include "journal/save_parts.hpp"
#include "ringfence/journal.hpp"

namespace ringfence::journal {

/// Version of the tables.
inline constexpr std::uint64_t format_version = 2;

/// The tables of a journal:
///   meta(name, value)                                format, release, description
///   snapshots(frame, memory, size, checksum, bytes)  the save before that frame: its size, and its recipe
///   parts(low, high, size, checksum, bytes)          parts of saves, by their names
///   uses(frame, low, high)                           the parts that the snapshot before that frame has
///   frames(frame, size, checksum, bytes)             the inputs of that frame
///   irreproducible(frame)                            frames that depended on something else
///
/// Threads: belongs to one thread at a time. Failure: throws Error that names the file.
class Store {
 public:
  /// A new journal. Throws Error if the directory holds one.
  static Store create(const std::filesystem::path& directory, JournalSync sync, const std::string& description);
  /// Throws Error if there is none, or if it has another format.
  static Store open(const std::filesystem::path& directory, Database::Access access, JournalSync sync);

  void begin() { database_->execute("BEGIN IMMEDIATE"); }
  void commit() { database_->execute("COMMIT"); }
  /// Adds the recipe of a save, and those of its parts that no snapshot has yet.
  void add_snapshot(std::uint64_t frame, const SaveInParts& save);
  void add_frame(std::uint64_t frame, const Packed& packed);
  void add_irreproducible(std::uint64_t frame);
  /// Removes all but the newest `keep` snapshots, and the frames before them.
  void remove_old(std::uint32_t keep);
  /// Removes what was written after the first `frames` frames.
  void remove_from(std::uint64_t frames);
  /// Moves what is in the log of the database to its file, and the file to the disk.
  void checkpoint();

  std::string meta(const char* name) const;
  void set_meta(const char* name, const std::string& value);
  std::vector<JournalSnapshot> snapshots() const;
  std::vector<JournalFrames> frames() const;
  std::vector<std::uint64_t> irreproducible() const;
  /// The last snapshot at or before the frame; empty if there is none.
  std::optional<std::uint64_t> snapshot_before(std::uint64_t frame) const;
  bool is_irreproducible(std::uint64_t frame) const;
  /// Size as it is stored; 0 if it is missing.
  std::uint64_t frame_bytes(std::uint64_t frame) const;
  /// Throw Error if the frame is missing or damaged.
  std::vector<std::byte> snapshot(std::uint64_t frame) const;
  std::vector<std::byte> frame(std::uint64_t frame) const;

 private:
  explicit Store(std::unique_ptr<Database> database) : database_(std::move(database)) {}
  void add_part(std::uint64_t frame, const PartName& name, std::span<const std::byte> part);
  void append_part(std::uint64_t frame, const Piece& piece, std::vector<std::byte>& save) const;
  void remove_unused_parts();
  std::vector<std::byte> read(const char* sql, const char* what, std::uint64_t frame) const;
  [[noreturn]] void fail(const char* what, std::uint64_t frame, const char* how) const;

  std::unique_ptr<Database> database_;
};

}  // namespace ringfence::journal
