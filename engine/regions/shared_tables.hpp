#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

namespace ringfence::regions {

/// What a RegionMap looks up.
struct MapTables {
  std::vector<std::uint32_t> owners;  ///< by cell, then the words of cuts
  /// One byte for each cell. Bit x + 2y + 4z, where x, y and z are 0 or 1, is set if no cell of a box is cut and one
  /// node owns them all. The box reaches from this cell to the cell that is x, y and z cells further on the three axes.
  std::vector<std::uint8_t> uniform_boxes;
  std::atomic<bool> shared{false};  ///< a copy has had them, maybe on another thread
};

/// Tables that copies share. Once they have been shared, no map writes them again.
///
/// Threads: each copy belongs to one thread at a time.
class SharedTables {
 public:
  SharedTables() = default;
  SharedTables(const SharedTables& other) noexcept : tables_(other.tables_) { mark_shared(); }
  SharedTables(SharedTables&&) noexcept = default;
  SharedTables& operator=(const SharedTables& other) noexcept {
    if (this != &other) {
      tables_ = other.tables_;
      mark_shared();
    }
    return *this;
  }
  SharedTables& operator=(SharedTables&&) noexcept = default;
  ~SharedTables() = default;

  /// Tables that no copy has: these, or new ones. May throw std::bad_alloc.
  MapTables& own() {
    if (tables_ == nullptr || tables_->shared.load(std::memory_order_relaxed)) {
      tables_ = std::make_shared<MapTables>();
    }
    return *tables_;
  }

 private:
  void mark_shared() const noexcept {
    if (tables_ != nullptr) {
      tables_->shared.store(true, std::memory_order_relaxed);
    }
  }

  std::shared_ptr<MapTables> tables_;
};

}  // namespace ringfence::regions
