// A CD node process with the model of the tests' worlds. Arguments: domain, name, interface, and how many times it
// computes each move.
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>

#include "base/caller_environment.hpp"
#include "dds/node_model.hpp"
#include "facade/bouncing_world.hpp"
#include "geometry/gapped_ellipsoid.hpp"
#include "ringfence/cluster.hpp"

namespace {

ringfence::dds::NodeService* draining_service = nullptr;

void drain(int) { draining_service->drain(); }

/// The same model, but it computes each move `times` times. So the node acts like a node on a slow machine.
class SlowModel : public ringfence::test::BouncingModel {
 public:
  SlowModel(double side, int times) : BouncingModel(side), times_(times) {}
  void move(std::uint64_t frame, std::span<const ringfence::MotionInput> inputs,
            std::span<ringfence::MotionOutput> outputs) const override {
    for (int i = 0; i < times_; ++i) {
      BouncingModel::move(frame, inputs, outputs);
    }
  }

 private:
  int times_;
};

}  // namespace

int main(int argc, char** argv) {
  using namespace ringfence;
  if (argc != 5) return 2;
  dds::NodeServiceConfig config;
  config.network.domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  config.network.interface = argv[3];
  config.name = argv[2];
  config.once = true;  // so that the process also ends when its World is silent for too long
  const int times = std::atoi(argv[4]);
  config.model = [times](std::span<const std::byte> setup) -> std::shared_ptr<const MotionModel> {
    test::NodeModel model;
    std::memcpy(&model, setup.data(), sizeof model);
    if (times > 1) return std::make_shared<SlowModel>(model.side, times);
    return model.make();
  };
  config.support = [](ShapeId) { return test::gapped_ellipsoid(); };
  // The results of the service must not depend on the floating-point environment.
  const test::CallerEnvironment environment(test::Caller::rounding_up);
  dds::NodeService service(std::move(config));
  draining_service = &service;
  std::signal(SIGTERM, drain);
  return static_cast<int>(service.run());
}
