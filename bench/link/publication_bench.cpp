// publication/<write or read>/<states>: the cost of publishing, by state, and of reading, by range of five cells.
#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "link/benches.hpp"
#include "link/publication.hpp"

namespace ringfence::bench {
namespace {

constexpr std::size_t cells = 100000;

std::vector<std::uint32_t> random_cells(std::size_t states, bool ascending) {
  std::mt19937 random(5);
  std::vector<std::uint32_t> cells_of_states(states);
  for (std::uint32_t& cell : cells_of_states) cell = static_cast<std::uint32_t>(random() % cells);
  if (ascending) std::sort(cells_of_states.begin(), cells_of_states.end());
  return cells_of_states;
}

void write_frame(link::Publication& publication, std::uint64_t frame,
                 const std::vector<std::uint32_t>& cells_of_states) {
  publication.begin(frame);
  for (std::uint32_t i = 0; i < cells_of_states.size(); ++i) publication.add(cells_of_states[i], {i + 1, 0, {}});
  publication.publish();
}

void write(benchmark::State& state, std::size_t states, bool ascending) {
  const auto cells_of_states = random_cells(states, ascending);
  link::Publication publication(cells, states);
  std::uint64_t frame = 0;
  for (auto _ : state) write_frame(publication, ++frame, cells_of_states);
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(states));
}

void read(benchmark::State& state, std::size_t states) {
  const auto cells_of_states = random_cells(states, false);
  link::Publication publication(cells, states);
  write_frame(publication, 1, cells_of_states);
  std::uint32_t cell = 0;
  std::uint64_t sum = 0;
  for (auto _ : state) {
    cell = (cell + 7919) % (cells - 5);
    for (const link::PublishedState& published : publication.read(1, cell, cell + 4)) sum += published.number;
  }
  benchmark::DoNotOptimize(sum);
  state.SetItemsProcessed(state.iterations());
}

}  // namespace

void register_publications() {
  for (const std::size_t states : {std::size_t{40}, std::size_t{4000}, std::size_t{64000}}) {
    const std::string count = std::to_string(states);
    benchmark::RegisterBenchmark(("publication/write/" + count).c_str(),
                                 [states](benchmark::State& state) { write(state, states, false); });
    benchmark::RegisterBenchmark(("publication/write_ascending/" + count).c_str(),
                                 [states](benchmark::State& state) { write(state, states, true); });
    benchmark::RegisterBenchmark(("publication/read/" + count).c_str(),
                                 [states](benchmark::State& state) { read(state, states); });
  }
}

}  // namespace ringfence::bench
