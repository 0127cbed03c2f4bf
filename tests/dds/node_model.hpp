#pragma once

#include <cstdint>
#include <memory>

#include "facade/bouncing_world.hpp"
#include "facade/queries/sensing_model.hpp"

namespace ringfence::test {

/// The motion model of NodeWorld, as the World sends it to its node processes: the bytes of dds::ClusterConfig::setup.
struct NodeModel {
  enum class Kind : std::uint8_t { bouncing, throwing, sensing };
  static constexpr double sense = 3;  ///< metres

  double side = 0;
  Kind kind = Kind::bouncing;

  std::shared_ptr<const MotionModel> make() const {
    if (kind == Kind::throwing) return std::make_shared<ThrowingModel>(side);
    if (kind == Kind::sensing) return std::make_shared<SensingModel>(side, sense, false);
    return std::make_shared<BouncingModel>(side);
  }
};

}  // namespace ringfence::test
