#include "frame_checker.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/parallel.hpp"
#include "reference/answer_check.hpp"

namespace ringfence::tools {
namespace {

constexpr std::uint64_t max_printed = 50;
constexpr std::uint64_t ball_tests_per_frame = 20'000'000;

reference::Question question_of(const worlds::QueryRow& row, const reference::Shapes& shapes) {
  using worlds::QueryKind;
  using Kind = reference::Question::Kind;
  const auto ask = [&](Kind kind, bool has_shape) {
    const reference::PreparedShape& shape = has_shape ? shapes[row.shape] : reference::point_shape();
    return reference::Question{kind, reference::Motion{shape, row.pose, row.displacement}, row.distance, row.layers,
                               row.except};
  };
  switch (row.kind) {
    case QueryKind::ray:
      return ask(Kind::first_hit, false);
    case QueryKind::ray_any:
      return ask(Kind::any_hit, false);
    case QueryKind::ray_all:
      return ask(Kind::all_hits, false);
    case QueryKind::sweep:
      return ask(Kind::first_hit, true);
    case QueryKind::sweep_all:
      return ask(Kind::all_hits, true);
    case QueryKind::overlap:
      return ask(Kind::overlap, true);
    case QueryKind::nearest:
      break;
  }
  return ask(Kind::nearest, false);
}

}  // namespace

FrameChecker::FrameChecker(const World& world, bool brute_force)
    : world_(world), brute_force_(brute_force), before_(world.contacts().begin(), world.contacts().end()) {
  if (!brute_force_) return;
  const LayerMatrix& layers = world.config().layers;
  for (std::size_t layer = 0; layer < layers.names.size(); ++layer) {
    layer_masks_.push_back(layers.mask(static_cast<std::uint8_t>(layer)));
  }
}

void FrameChecker::check_counters() {
  const FrameReport& report = world_.report();
  if (report.candidates == report.tested + report.carried && report.candidates == report.accepted) return;
  if (miscounted_++ < max_printed) {
    fmt::print(
        stderr,
        "ringfence: frame {}: {} candidates, {} tested, {} carried over, {} accepted; expected each exactly once\n",
        report.frame, report.candidates, report.tested, report.carried, report.accepted);
  }
}

void FrameChecker::skip_frame() {
  check_counters();
  if (brute_force_) before_.assign(world_.contacts().begin(), world_.contacts().end());
}

void FrameChecker::print_difference(const std::string& text) {
  if (differences_++ < max_printed) fmt::print(stderr, "ringfence: {}\n", text);
}

void FrameChecker::print_differences(const std::vector<reference::Difference>& differences) {
  for (const reference::Difference& difference : differences) print_difference(difference.text);
}

void FrameChecker::check_frame(std::uint64_t frame) {
  check_counters();
  if (!brute_force_) return;
  for (std::size_t shape = shapes_.size(); shape < world_.shape_count(); ++shape) {
    const ShapeId id(static_cast<std::uint32_t>(shape));
    shapes_.add(world_.has_shape(id) ? world_.shape(id) : ShapeDescription(Sphere{1}));  // no object has a removed one
  }
  const std::uint32_t history = world_.config().history;
  if (history != 0 && frames_ != 0) history_[frame - 1] = std::move(objects_);
  if (history_.size() > history) history_.erase(history_.begin());
  objects_.clear();
  for (const ObjectView& view : world_.objects()) {
    const ObjectSpec& spec = view.spec;
    objects_.push_back({spec.number, spec.shape.number(), spec.layer, spec.enabled, spec.pose,
                        spec.category == Category::fixed, spec.group, view.id.generation(), spec.user_data,
                        spec.user.number()});
  }
  reference::mark_excess(objects_, world_.config().quotas.colliding_avatars);
  print_differences(reference::check_frame(frame, shapes_, objects_, layer_masks_, world_.contacts(),
                                           world_.config().deepest_contacts));
  print_differences(reference::check_phases(frame, before_, world_.contacts(), world_.ended()));
  before_.assign(world_.contacts().begin(), world_.contacts().end());
  ++frames_;
}

void FrameChecker::check_answers(std::uint64_t frame, std::span<const worlds::QueryRow> rows,
                                 const FrameAnswers& answers) {
  if (!brute_force_ || rows.empty()) return;
  const std::uint64_t step = std::max<std::uint64_t>(1, rows.size() * objects_.size() / ball_tests_per_frame);
  if (frame % step != 0) return;
  std::map<const std::vector<reference::FrameObject>*, reference::AnswerCheck> checks;
  for (const worlds::QueryRow& row : rows) {
    if (const auto* objects = objects_asked(frame, row)) checks.try_emplace(objects, shapes_, *objects);
  }
  std::vector<std::string> errors(rows.size());
  base::parallel_for(rows.size(), 1, [&](std::size_t i) {
    const auto check = checks.find(objects_asked(frame, rows[i]));
    if (check == checks.end()) return;
    errors[i] = check->second.describe_error(question_of(rows[i], shapes_), answers.hits(i));
  });
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!errors[i].empty()) print_difference(fmt::format("frame {}: query {}: {}", frame, rows[i].query, errors[i]));
    answers_ += objects_asked(frame, rows[i]) != nullptr ? 1 : 0;
  }
  ++answered_frames_;
}

/// The objects of the frame that a query asks about; null between two frames, and for frames of the warm-up.
const std::vector<reference::FrameObject>* FrameChecker::objects_asked(std::uint64_t frame,
                                                                       const worlds::QueryRow& row) const {
  const double at = row.at.value_or(static_cast<double>(frame));
  if (at == static_cast<double>(frame)) return &objects_;
  const auto found = at == std::floor(at) ? history_.find(static_cast<std::uint64_t>(at)) : history_.end();
  return found == history_.end() ? nullptr : &found->second;
}

}  // namespace ringfence::tools
