#include "frozen_names.hpp"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

struct FrozenStage {
  NodeStage stage;
  std::string_view name;
};
constexpr FrozenStage frozen_stages[] = {{NodeStage::reporting, "telling"}};

struct FrozenStep {
  double PathReport::*step;
  const char* key;
};
constexpr FrozenStep frozen_steps[] = {
    {&PathReport::start_nodes_ms, "open"},      {&PathReport::start_users_ms, "invite"},
    {&PathReport::user_read_ms, "user_look"},   {&PathReport::plan_map_ms, "draw"},
    {&PathReport::receive_contacts_ms, "hear"}, {&PathReport::notify_users_ms, "inform"},
    {&PathReport::receive_user_acks_ms, "heed"}};

}  // namespace

std::string word_of(NodeStage stage) {
  std::string word = name_of(stage);
  std::replace(word.begin(), word.end(), '_', '-');
  return word;
}

std::optional<NodeStage> find_stage(std::string_view word) {
  for (std::size_t i = 0; i < node_stage_count; ++i) {
    if (word == word_of(static_cast<NodeStage>(i))) return static_cast<NodeStage>(i);
  }
  const auto* const frozen = std::ranges::find(frozen_stages, word, &FrozenStage::name);
  if (frozen == std::end(frozen_stages)) return std::nullopt;
  return frozen->stage;
}

std::string list_stage_words() {
  std::string words;
  for (std::size_t i = 0; i < node_stage_count; ++i) {
    const auto stage = static_cast<NodeStage>(i);
    words += (i == 0 ? "" : ", ") + word_of(stage);
    const auto* const frozen = std::ranges::find(frozen_stages, stage, &FrozenStage::stage);
    if (frozen != std::end(frozen_stages)) words += fmt::format(" ({})", frozen->name);
  }
  return words;
}

const char* path_key(const PathReport::Step& step) {
  const auto* const frozen = std::ranges::find(frozen_steps, step.second, &FrozenStep::step);
  return frozen == std::end(frozen_steps) ? step.first : frozen->key;
}

}  // namespace ringfence::tools
