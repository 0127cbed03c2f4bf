#include "faults.hpp"

#include <algorithm>
#include <charconv>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

std::string option_name_of(NodeStage stage) {
  std::string word = name_of(stage);
  std::replace(word.begin(), word.end(), '_', '-');
  return word;
}

/// A number that ends at a colon; moves `at` behind it. Whether there was one.
template <class Number>
bool read_number(std::string_view& at, Number& number) {
  const auto [end, error] = std::from_chars(at.data(), at.data() + at.size(), number);
  const auto length = static_cast<std::size_t>(end - at.data());
  if (error != std::errc() || length == at.size() || at[length] != ':') return false;
  at.remove_prefix(length + 1);
  return true;
}

Fault parse_fault(std::string_view item) {
  Fault fault;
  std::string stages;
  std::string_view rest = item;
  const bool numbers = read_number(rest, fault.frame) && read_number(rest, fault.node);
  for (std::size_t i = 0; i < node_stage_count; ++i) {
    fault.stage = static_cast<NodeStage>(i);
    if (numbers && rest == option_name_of(fault.stage)) return fault;
    stages += (i == 0 ? "" : ", ") + option_name_of(fault.stage);
  }
  throw Error(fmt::format("found {}; expected FRAME:NODE:STAGE, several with commas between; STAGE is one of {}",
                          item.empty() ? "nothing" : item, stages));
}

}  // namespace

std::vector<Fault> parse_faults(std::string_view text) {
  std::vector<Fault> faults;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    faults.push_back(parse_fault(text.substr(begin, comma - begin)));
    begin = comma + 1;
  }
  return faults;
}

void check_faults(const std::vector<Fault>& faults, std::uint32_t frames, std::uint32_t nodes, double deadline_ms) {
  if (faults.empty()) return;
  if (nodes == 0 || deadline_ms == 0) {
    throw Error(nodes == 0 ? "--fail: nothing can fail with --nodes 0; expected 1 or more"
                           : "--fail: expected --node-deadline-ms too, or the frame waits for ever");
  }
  for (const Fault& fault : faults) {
    if (fault.frame >= frames) {
      throw Error(fmt::format("--fail: found frame {}; expected 0 to {}, the counted frames", fault.frame, frames - 1));
    }
  }
}

void inject_faults(const std::vector<Fault>& faults, std::uint32_t frame, std::uint64_t in_world, World& world) {
  for (Fault fault : faults) {
    if (fault.frame != frame) continue;
    fault.frame = in_world;
    if (const Status status = world.inject(fault); status != Status::ok) {
      throw Error(fmt::format("--fail: node {} in frame {} was refused ({}); expected a node that is there by then",
                              fault.node, frame, name_of(status)));
    }
  }
}

}  // namespace ringfence::tools
