#include "serve/job_view.hpp"

#include <filesystem>

#include <fmt/format.h>

#include "listen_address.hpp"
#include "serve/page_directory.hpp"

namespace ringfence::tools {
namespace {

GatewayConfig gateway_config(const Job& job, const Figures& figures) {
  GatewayConfig config;
  const ListenAddress address = read_listen_address(job.view.address, "--view");
  config.host = address.host;
  config.port = address.port;
  config.world = job.view.world;
  config.rate = job.view.tick;
  config.page_directory = page_directory(job.view.page);
  config.contact_label = job.scene.contact_label;
  config.hooks.digest = [&figures] { return figures.digest(); };
  return config;
}

}  // namespace

JobView::JobView(World& world, const Job& job, const Figures& figures, const StopSignals& stop)
    : world_(world), stop_(stop), gateway_(world, gateway_config(job, figures)), clock_(job.view.tick) {
  fmt::print(stderr, "ringfence: {}/?watch shows the run; it goes on with the first visitor\n", gateway_.url());
}

void JobView::before_frame() {
  clock_.wait();
  gateway_.before_frame();
}

void JobView::after_frame() {
  gateway_.after_frame();
  // The first visitor sees the run from its first frame.
  while (!has_visitor_ && !stop_.received()) {
    repeat_frame();
    has_visitor_ = gateway_.report().spectators > 0;
  }
}

void JobView::hold() {
  while (world_.frames() > 0 && gateway_.report().spectators > 0 && !stop_.received()) repeat_frame();
}

// Spectators ignore an update of a frame that they have; those who come now receive the whole state.
void JobView::repeat_frame() {
  clock_.wait();
  gateway_.before_frame();
  gateway_.after_frame();
}

}  // namespace ringfence::tools
