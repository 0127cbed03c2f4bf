#pragma once

#include "figures.hpp"
#include "job.hpp"
#include "ringfence/gateway.hpp"
#include "ringfence/world.hpp"
#include "serve/frame_clock.hpp"
#include "stop_signals.hpp"

namespace ringfence::tools {

/// Shows a run on the page while it runs (--view): spectators connect over the network, and frames take real time.
///
/// Threads: that of the run; the Gateway has one of its own.
class JobView {
 public:
  /// Listens, and prints the address. Throws Error for an address that is not one of this machine. All arguments
  /// outlive the view.
  JobView(World& world, const Job& job, const Figures& figures, const StopSignals& stop);

  /// Waits until the frame is due, or a signal arrives.
  void before_frame();
  /// Shows the frame. After the first one it waits for the first visitor, or a signal.
  void after_frame();
  /// Shows the last frame until the last visitor has left, or a signal arrives.
  void hold();

 private:
  void repeat_frame();

  const World& world_;
  const StopSignals& stop_;
  Gateway gateway_;
  FrameClock clock_;
  bool has_visitor_ = false;
};

}  // namespace ringfence::tools
