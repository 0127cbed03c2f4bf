#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "messages/run.hpp"
#include "nodes/exchange/frame_control.hpp"
#include "nodes/tapped_channel.hpp"

namespace ringfence::nodes::test {

/// The messages that words of FrameControl and StepReport replace, as they would be between processes.

inline LoggedMessage logged_word(Endpoint from, Endpoint to, MessageType type, std::uint64_t frame,
                                 std::span<const std::byte> record = {}) {
  LoggedMessage word{from, to, {}, std::vector<std::byte>(sizeof(messages::Header) + record.size())};
  messages::write_header(word.bytes.data(), {type, from, to, frame, 0}, record.size(), record.empty() ? 0 : 1, true,
                         record.empty() ? 0 : 1);
  std::copy(record.begin(), record.end(), word.bytes.begin() + sizeof(messages::Header));
  std::memcpy(&word.header, word.bytes.data(), sizeof word.header);
  return word;
}

inline MessageType type_of(AnnouncedStep step) {
  return step == AnnouncedStep::frame_begin      ? MessageType::frame_begin
         : step == AnnouncedStep::positions_sent ? MessageType::position_update
                                                 : MessageType::frame_end;
}

/// What a node has reported since `before`.
inline void log_reports(std::vector<LoggedMessage>& log, Endpoint node, std::uint64_t frame, const StepReport& report,
                        FrameMark<ReportedStep> before, bool publishes) {
  const FrameMark<ReportedStep> reached = report.reached.load();
  const auto add = [&](ReportedStep step, MessageType type, std::span<const std::byte> record = {}) {
    const bool known = before.is_of(frame) && before.step() >= step;
    if (reached.is_of(frame) && reached.step() >= step && !known) {
      log.push_back(logged_word(node, Endpoint::server(), type, frame, record));
    }
  };
  add(ReportedStep::moved, MessageType::node_state);
  if (publishes) {
    add(ReportedStep::published, MessageType::published);
  }
  add(ReportedStep::tested, MessageType::narrow_done, std::as_bytes(std::span(&report.totals, 1)));
  add(ReportedStep::done, MessageType::frame_done, std::as_bytes(std::span(&report.stats, 1)));
}

}  // namespace ringfence::nodes::test
