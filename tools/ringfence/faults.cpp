#include "faults.hpp"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "frozen_names.hpp"
#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

/// Reads a number that a colon follows and moves `at` behind the colon. False if there is none.
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
  std::uint32_t number = 0;
  std::string_view rest = item;
  bool has_numbers = read_number(rest, fault.frame);
  if (has_numbers && rest.starts_with('u')) {
    rest.remove_prefix(1);
    has_numbers = read_number(rest, number);
    fault.user = UserId(number);
  } else {
    has_numbers = has_numbers && read_number(rest, number);
    fault.node = NodeId(number);
  }
  if (has_numbers) {
    if (const std::optional<NodeStage> stage = find_stage(rest)) {
      fault.stage = *stage;
      return fault;
    }
  }
  throw Error(
      fmt::format("found {}; expected FRAME:NODE:STAGE, or FRAME:uUSER:model or publication, several separated by "
                  "commas; STAGE is one of {}",
                  item.empty() ? "nothing" : item, list_stage_words()));
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

void check_faults(const std::vector<Fault>& faults, std::uint32_t frames, std::uint32_t nodes,
                  const Deadlines& deadlines) {
  if (!faults.empty() && nodes == 0) {
    throw Error("--fail: there are no CD nodes with --nodes 0; expected 1 or more");
  }
  for (const Fault& fault : faults) {
    const bool user = fault.user != no_user;
    if ((user ? deadlines.user_ms : deadlines.node_ms) == 0) {
      throw Error(fmt::format("--fail: expected --{}-deadline-ms too; without it the frame waits forever",
                              user ? "user" : "node"));
    }
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
      const bool user = fault.user != no_user;
      throw Error(fmt::format("--fail: {} {} in frame {} was refused ({}); expected a {} that exists in that frame{}",
                              user ? "user node" : "node", user ? fault.user.number() : fault.node.number(), frame,
                              name_of(status), user ? "user node" : "node", user ? ", and model or publication" : ""));
    }
  }
}

}  // namespace ringfence::tools
