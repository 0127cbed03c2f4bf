#include "journal/writer.hpp"

#include <exception>
#include <utility>

namespace ringfence::journal {

Writer::Writer(Store store, std::size_t backlog, std::uint32_t keep_snapshots)
    : store_(std::move(store)), backlog_(backlog), keep_snapshots_(keep_snapshots), thread_([this] { run(); }) {}

Writer::~Writer() {
  {
    const std::scoped_lock lock(mutex_);
    ending_ = true;
  }
  added_.notify_one();
  thread_.join();
}

bool Writer::add(Entry entry) {
  std::unique_lock lock(mutex_);
  written_.wait(lock, [&] { return bytes_ <= backlog_ || !failure_.empty(); });
  if (!failure_.empty()) {
    return false;
  }
  bytes_ += entry.size();
  ++open_;
  waiting_.push_back(std::move(entry));
  lock.unlock();
  added_.notify_one();
  return true;
}

bool Writer::wait() {
  std::unique_lock lock(mutex_);
  written_.wait(lock, [&] { return open_ == 0 || !failure_.empty(); });
  return failure_.empty();
}

std::string Writer::failure() const {
  const std::scoped_lock lock(mutex_);
  return failure_;
}

void Writer::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    added_.wait(lock, [&] { return !waiting_.empty() || ending_; });
    if (waiting_.empty()) {
      return;
    }
    std::deque<Entry> entries = std::exchange(waiting_, {});
    lock.unlock();
    std::size_t bytes = 0;
    for (const Entry& entry : entries) {
      bytes += entry.size();
    }
    std::string failure;
    try {
      write(entries);
    } catch (const std::exception& error) {
      failure = error.what();
    }
    lock.lock();
    if (!failure.empty()) {
      failure_ = failure;
      written_.notify_all();
      return;
    }
    bytes_ -= bytes;
    open_ -= entries.size();
    written_.notify_all();
  }
}

void Writer::write(std::deque<Entry>& entries) {
  bool has_snapshot = false;
  store_.begin();
  for (const Entry& entry : entries) {
    switch (entry.kind) {
      case Entry::Kind::start:
        store_.remove_from(entry.frame);
        break;
      case Entry::Kind::frame:
        store_.add_frame(entry.frame, pack(entry.frame, entry.bytes));
        break;
      case Entry::Kind::snapshot:
        store_.add_snapshot(entry.frame, entry.save);
        has_snapshot = true;
        break;
      case Entry::Kind::irreproducible:
        store_.add_irreproducible(entry.frame);
        break;
    }
  }
  if (has_snapshot) {
    store_.remove_old(keep_snapshots_);
  }
  store_.commit();
  if (has_snapshot) {
    store_.checkpoint();
  }
}

}  // namespace ringfence::journal
