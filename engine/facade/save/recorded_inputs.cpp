#include "facade/save/recorded_inputs.hpp"

#include <algorithm>

#include "facade/save/request_records.hpp"
#include "facade/save/save_check.hpp"
#include "facade/save/save_shapes.hpp"
#include "facade/save/save_stream.hpp"
#include "ringfence/error.hpp"

namespace ringfence::facade {

namespace {

bool is_recorded(const nodes::Request& request) noexcept { return request.kind <= nodes::Request::Kind::set_state; }

}  // namespace

std::vector<std::byte> record_inputs(const WorldState& state, const Requests& requests, const ShapeChanges& shapes) {
  SavedWorld calls;
  collect_calls(requests, calls);
  if (shapes.empty() && calls.requests.empty() && calls.moves.empty() && calls.inputs.empty()) {
    return {};
  }
  MemorySink sink;
  SaveWriter to(sink);
  to.value(std::uint64_t{shapes.added.size()});
  for (const ShapeNumber shape : shapes.added) {
    to.value(shape);
    write_shape(to, state.shapes.description(shape));
  }
  to.list(shapes.removed);
  to.value(requests.objects().last_number());
  to.value(requests.objects().generation());
  to.list(calls.requests);
  to.list(calls.request_states);
  to.list(calls.moves);
  to.list(calls.inputs);
  return sink.take();
}

RecordedInputs read_inputs(std::span<const std::byte> bytes,
                           std::span<const std::shared_ptr<const SupportFunction>> functions) {
  RecordedInputs inputs;
  if (bytes.empty()) {
    return inputs;
  }
  SaveReader from(bytes);
  for (auto added = from.value<std::uint64_t>(); added > 0; --added) {
    const auto shape = from.value<ShapeNumber>();
    inputs.added.emplace_back(shape, read_shape(from, functions));
  }
  inputs.removed = from.list<ShapeNumber>();
  inputs.last_number = from.value<std::uint32_t>();
  inputs.generation = from.value<std::uint32_t>();
  inputs.requests = from.list<SavedRequest>();
  inputs.states = from.list<std::byte>();
  inputs.moves = from.list<SavedMove>();
  inputs.inputs = from.list<SavedInput>();
  return inputs;
}

void apply_inputs(const RecordedInputs& inputs, const WorldState& state, Requests& requests) {
  SavedWorld calls;
  const MotionModel* const model = state.config.motion.get();
  calls.state_bytes = model == nullptr ? 0 : static_cast<std::uint32_t>(model->state_bytes());
  calls.layers = state.config.layers;
  for (ShapeNumber shape = 0; shape < state.shapes.size(); ++shape) {
    calls.shapes.push_back(state.shapes.has(shape) ? &state.shapes.description(shape) : nullptr);
  }
  calls.requests = inputs.requests;
  calls.request_states = inputs.states;
  calls.moves = inputs.moves;
  calls.inputs = inputs.inputs;
  check_calls(calls);
  const auto pending = requests.pending();
  const auto known = static_cast<std::size_t>(std::count_if(pending.begin(), pending.end(), is_recorded));
  UserOrders& orders = requests.user_orders();
  const std::size_t moves = orders.moves.size(), given = orders.inputs.size();
  if (known > calls.requests.size() || moves > calls.moves.size() || given > calls.inputs.size()) {
    throw Error("apply: the world has more requests than the frame: restore it from a snapshot of this journal");
  }
  for (std::size_t i = 0; i < moves; ++i) {
    orders.moves[i].number = calls.moves[i].number;  // a later call may have disabled the object
  }
  calls.requests.erase(calls.requests.begin(), calls.requests.begin() + static_cast<std::ptrdiff_t>(known));
  calls.moves.erase(calls.moves.begin(), calls.moves.begin() + static_cast<std::ptrdiff_t>(moves));
  calls.inputs.erase(calls.inputs.begin(), calls.inputs.begin() + static_cast<std::ptrdiff_t>(given));
  restore_calls(calls, Requests::Counting::in_quotas, requests);
  if (inputs.generation != 0) {
    requests.restore_ids(inputs.last_number, inputs.generation);
  }
}

}  // namespace ringfence::facade
