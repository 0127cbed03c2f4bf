#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include <unistd.h>

#include "facade/bouncing_world.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/journal.hpp"

namespace ringfence::test {

/// A directory that is removed at the end.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    static std::atomic<int> count{0};
    path_ = std::filesystem::temp_directory_path() /
            ("ringfence_journal_" + std::to_string(getpid()) + "_" + std::to_string(count++));
    std::filesystem::remove_all(path_);
  }
  ~TemporaryDirectory() { std::filesystem::remove_all(path_); }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

inline constexpr double journal_side = 9;

/// The same world in one of 24 deployments.
inline WorldConfig journal_world(unsigned variant) {
  constexpr Deployment deployments[] = {Deployment::user_collision, Deployment::user, Deployment::user_server};
  WorldConfig config;
  config.nodes = variant % 4;
  config.deployment = deployments[variant / 4 % 3];
  config.placement = variant / 12 % 2 == 0 ? Placement::region : Placement::server;
  config.interest = 4;
  config.layers = {{"a", "b", "c"}, {{0, 0}, {0, 1}, {1, 1}, {2, 0}}};
  config.quotas.window = 7;
  config.motion = std::make_shared<BouncingModel>(journal_side);
  config.support_functions = {std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.7f, 0.9f})};
  return config;
}

}  // namespace ringfence::test
