#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "ringfence/fault.hpp"
#include "ringfence/profile.hpp"

/// Names that users have in scripts and files, and that differ from the names in the code. They never change: options
/// accept them, and JSON reports have them as keys. No other file of the program contains them.
namespace ringfence::tools {

/// Word for a stage in `--fail FRAME:NODE:STAGE`: the name of the enumerator with - for _.
std::string word_of(NodeStage stage);

/// The stage that `word` names: a word of word_of, or its frozen name. Empty if there is none.
std::optional<NodeStage> find_stage(std::string_view word);

/// All words that find_stage accepts, for messages; a frozen name follows its current word in parentheses.
std::string list_stage_words();

/// Key of a step of the critical path under `path_ms` in the JSON report: its frozen name, or its name in the code.
/// Returns a string literal.
const char* path_key(const PathReport::Step& step);

/// Keys of the JSON report and the status file.
namespace keys {
/// The placement as given to --broad-phase, which may be automatic.
inline constexpr const char* requested_broad_phase = "broad_phase_asked";
inline constexpr const char* received_parcels = "taken_parcels";
inline constexpr const char* received_bytes = "taken_bytes";
/// For a node that joined: time from its first announcement to its assignment.
inline constexpr const char* waiting_ms = "waited_ms";
/// For a node that joined: time from its assignment to its first parcel of a frame.
inline constexpr const char* first_parcel_ms = "spoke_ms";
/// For a node that left: time from its request to leave to the end of its last hand-over.
inline constexpr const char* leave_request_ms = "asked_ms";
}  // namespace keys

}  // namespace ringfence::tools
