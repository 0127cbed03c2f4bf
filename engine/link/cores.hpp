#pragma once

#include <cstddef>
#include <memory>

namespace ringfence::link {

/// The hardware threads that this process may use, in the order in which threads that communicate should be pinned to
/// them.
///
/// The order is by proximity: the hardware threads of one package (socket) and one shared cache precede those of the
/// next, but the first hardware threads of all cores precede the second ones. So the first n are the best placement for
/// n threads that work in lock-step.
///
/// The constructor reads the topology with hwloc: construct the object once, before threads are pinned. Immutable: any
/// thread may use it.
class Cores {
 public:
  /// Reads the topology. If that fails, count() is 1, and pin_this_thread() does nothing and returns false.
  Cores();
  ~Cores();
  Cores(const Cores&) = delete;
  Cores& operator=(const Cores&) = delete;

  /// Number of hardware threads that the process may run on; at least 1.
  std::size_t count() const noexcept;

  /// Pins the calling thread to hardware thread `index` modulo count(). Returns false if the system refuses.
  bool pin_this_thread(std::size_t index) const noexcept;

 private:
  struct Machine;
  std::unique_ptr<Machine> machine_;
};

}  // namespace ringfence::link
