#include "link/cores.hpp"

#include <algorithm>
#include <vector>

#include <hwloc.h>
#include <unistd.h>

namespace ringfence::link {

struct Cores::Machine {
  hwloc_topology_t topology = nullptr;
  std::vector<hwloc_obj_t> units;  ///< hardware threads, nearest first

  Machine() = default;
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;
  ~Machine() {
    if (topology) hwloc_topology_destroy(topology);
  }
};

namespace {

/// Index of a hardware thread within its core: 0, 1, ...
unsigned rank_in_core(hwloc_topology_t topology, hwloc_obj_t unit) {
  hwloc_obj_t core = hwloc_get_ancestor_obj_by_type(topology, HWLOC_OBJ_CORE, unit);
  return core ? unit->logical_index -
                    hwloc_get_obj_inside_cpuset_by_type(topology, core->cpuset, HWLOC_OBJ_PU, 0)->logical_index
              : 0;
}

bool load(hwloc_topology_t& topology) {
  if (hwloc_topology_init(&topology) != 0) {
    topology = nullptr;
    return false;
  }
  return hwloc_topology_load(topology) == 0;
}

}  // namespace

Cores::Cores() : machine_(std::make_unique<Machine>()) {
  hwloc_topology_t& topology = machine_->topology;
  if (!load(topology)) return;
  hwloc_bitmap_t allowed = hwloc_bitmap_alloc();
  // The mask of the process, not of the thread: containers and taskset narrow it; pinning narrows only a thread's mask.
  if (hwloc_get_proc_cpubind(topology, getpid(), allowed, 0) != 0) hwloc_bitmap_fill(allowed);
  for (hwloc_obj_t unit = nullptr; (unit = hwloc_get_next_obj_by_type(topology, HWLOC_OBJ_PU, unit)) != nullptr;) {
    if (hwloc_bitmap_isset(allowed, unit->os_index)) machine_->units.push_back(unit);
  }
  hwloc_bitmap_free(allowed);
  // hwloc orders hardware threads by proximity. A stable sort keeps that order within each rank.
  std::stable_sort(machine_->units.begin(), machine_->units.end(),
                   [&](hwloc_obj_t p, hwloc_obj_t q) { return rank_in_core(topology, p) < rank_in_core(topology, q); });
}

Cores::~Cores() = default;

std::size_t Cores::count() const noexcept { return std::max<std::size_t>(1, machine_->units.size()); }

bool Cores::pin_this_thread(std::size_t index) const noexcept {
  if (machine_->units.empty()) return false;
  const hwloc_obj_t unit = machine_->units[index % machine_->units.size()];
  return hwloc_set_cpubind(machine_->topology, unit->cpuset, HWLOC_CPUBIND_THREAD) == 0;
}

}  // namespace ringfence::link
