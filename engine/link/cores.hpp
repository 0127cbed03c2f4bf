#pragma once

#include <cstddef>
#include <memory>

namespace ringfence::link {

/// The cores that this process may use, in the order in which threads that talk much should take them.
///
/// Nearest first: the cores of one package and of one shared cache before those of the next, and one hardware thread of
/// each core before the second of any. So the first n of them are the best place for n threads in lock-step.
///
/// Made once, from any thread, before threads are pinned; reads the topology with hwloc. Immutable: any thread may use
/// it.
class Cores {
 public:
  /// Reads the machine. Where it cannot be read, there is one core and nothing is pinned.
  Cores();
  ~Cores();
  Cores(const Cores&) = delete;
  Cores& operator=(const Cores&) = delete;

  /// Hardware threads that the process may run on; at least 1.
  std::size_t count() const noexcept;

  /// Keeps the calling thread on the `index`-th of them, counted round. False where the system refuses.
  bool pin_this_thread(std::size_t index) const noexcept;

 private:
  struct Machine;
  std::unique_ptr<Machine> machine_;
};

}  // namespace ringfence::link
