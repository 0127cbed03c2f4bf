#pragma once

namespace ringfence::tools {

/// Catches SIGINT and SIGTERM while it exists, so that a run can end after its frame, with its report and complete
/// files. The second signal ends the process at once, as it would without this class.
///
/// One instance at a time. The destructor restores the handlers that were set before.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// "SIGINT" or "SIGTERM" after the first signal; null before.
  const char* received() const noexcept;
};

}  // namespace ringfence::tools
