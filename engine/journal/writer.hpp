#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "journal/store.hpp"

namespace ringfence::journal {

/// What is written.
struct Entry {
  enum class Kind : std::uint8_t {
    start,           ///< what was written about this frame and later ones is removed
    snapshot,        ///< the world before the frame
    frame,           ///< its inputs
    irreproducible,  ///< the frame depended on something else
  };
  Kind kind = Kind::frame;
  std::uint64_t frame = 0;
  SaveInParts save;              ///< of a snapshot
  std::vector<std::byte> bytes;  ///< the inputs of a frame
  std::size_t size() const noexcept { return save.bytes.size() + bytes.size(); }
};

/// Writes entries on a thread of its own, in the order in which they were added: all that wait in one transaction.
///
/// Threads: one thread adds and waits. A lock protects the queue; the thread that adds never waits for the disk, unless
/// it says so or the backlog is full.
class Writer {
 public:
  Writer(Store store, std::size_t backlog, std::uint32_t keep_snapshots);
  /// Writes what was added, and ends the thread.
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  /// Waits while more than the backlog is not written. Returns false if writing has failed, now or before.
  bool add(Entry entry);
  /// Waits until all entries are written. The same result.
  bool wait();
  std::string failure() const;

 private:
  void run();
  void write(std::deque<Entry>& entries);

  Store store_;
  const std::size_t backlog_;
  const std::uint32_t keep_snapshots_;
  mutable std::mutex mutex_;
  std::condition_variable added_, written_;
  std::deque<Entry> waiting_;
  std::size_t bytes_ = 0;  ///< of the entries that are not written
  std::size_t open_ = 0;   ///< number of them
  bool ending_ = false;
  std::string failure_;
  std::thread thread_;
};

}  // namespace ringfence::journal
