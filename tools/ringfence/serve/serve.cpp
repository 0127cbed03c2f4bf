#include "serve/serve.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "exit_code.hpp"
#include "heap_limits.hpp"
#include "journal_run.hpp"
#include "listen_address.hpp"
#include "mesh_file.hpp"
#include "motion/walk.hpp"
#include "output_file.hpp"
#include "ringfence/gateway.hpp"
#include "run_options.hpp"
#include "serve/frame_clock.hpp"
#include "serve/page_directory.hpp"
#include "serve/server_robots.hpp"
#include "serve/spawn_places.hpp"
#include "serve/token_command.hpp"
#include "stop_signals.hpp"
#include "worlds/plaza.hpp"
#include "worlds/scene_file.hpp"

namespace ringfence::tools {
namespace {

constexpr const char* avatar_shape = "avatar";
constexpr double avatar_height = 0.9;  // metres: a capsule of radius 0.35 that stands on the ground

worlds::Scene read_served_scene(const ServeOptions& options) {
  if (options.scene.empty()) return worlds::make_plaza(options.plaza);
  worlds::Scene scene = worlds::read_scene(options.scene, read_mesh);
  const auto is_avatar = [](const worlds::NamedShape& shape) { return shape.name == avatar_shape; };
  if (std::ranges::none_of(scene.shapes, is_avatar)) scene.shapes.push_back({avatar_shape, Capsule{0.35f, 0.55f}, {}});
  return scene;
}

ShapeId shape_of_avatars(const worlds::Scene& scene) {
  const auto found = std::ranges::find(scene.shapes, avatar_shape, &worlds::NamedShape::name);
  return ShapeId(static_cast<std::uint32_t>(found - scene.shapes.begin()));
}

GatewayConfig gateway_config(const ServeOptions& options, const std::string& contact_label, const motion::Walk& walk) {
  GatewayConfig config;
  const ListenAddress address = read_listen_address(options.listen, "--listen");
  config.host = address.host;
  config.port = address.port;
  config.world = options.world;
  config.certificate_file = options.certificate;
  config.key_file = options.key;
  if (!options.token_key.empty()) config.token_key = read_token_key(options.token_key);
  config.origins = options.origins;
  config.page_directory = page_directory(options.page);
  config.max_clients = options.max_clients;
  config.rate = options.tick;
  config.grace_s = options.grace_s;
  config.contact_label = contact_label;
  config.network = options.network;
  const auto parameters = walk.parameters();
  config.model_parameters.assign(parameters.begin(), parameters.end());
  return config;
}

/// Memory for the avatars of all players and robots, so that none of them makes a frame allocate.
void reserve_for_avatars(WorldConfig& config, const ServeOptions& options) {
  const std::size_t avatars = options.max_clients + options.robots;
  Capacities& capacities = config.capacities;
  capacities.objects = std::min(capacities.objects + avatars, config.limits.objects);
  capacities.pairs += 4 * avatars;
  capacities.contacts += 2 * avatars;
  capacities.users = std::min(std::max(capacities.users, options.max_clients), config.limits.users);
}

/// What the end of a served world prints.
struct ServedFrames {
  std::uint64_t frames = 0, late = 0;
  double frame_ms = 0;  ///< sum
  double longest_ms = 0;
};

void write_report(OutputFile& file, const World& world, const ServedFrames& served, const GatewayReport& report,
                  std::uint64_t digest) {
  const double updates = static_cast<double>(std::max<std::uint64_t>(1, report.updates));
  const nlohmann::json json{
      {"frames", world.frames()},
      {"served_frames", served.frames},
      {"late_frames", served.late},
      {"frame_ms",
       {{"mean", served.frame_ms / static_cast<double>(std::max<std::uint64_t>(1, served.frames))},
        {"max", served.longest_ms}}},
      {"digest", fmt::format("{:016x}", digest)},
      {"updates", report.updates},
      {"replaced_updates", report.replaced_updates},
      {"received_messages", report.received_messages},
      {"received_bytes", report.received_bytes},
      {"sent_bytes", report.sent_bytes},
      {"refused", report.refused},
      {"frame_cpu_s", report.frame_cpu_s},
      {"network_cpu_s", report.network_cpu_s},
      {"cpu_us_per_update", (report.frame_cpu_s + report.network_cpu_s) * 1e6 / updates}};
  file.write(json.dump(2) + "\n");
  file.close();
}

void print_report(const World& world, const ServedFrames& served, const GatewayReport& report, std::uint64_t digest) {
  fmt::print("served {} frames, {} of them late; frame {:.2f} ms on average, {:.2f} ms at most\n", served.frames,
             served.late, served.frame_ms / static_cast<double>(std::max<std::uint64_t>(1, served.frames)),
             served.longest_ms);
  fmt::print("sent {} updates, {:.1f} MB; received {} messages; refused {}\n", report.updates,
             static_cast<double>(report.sent_bytes) / 1e6, report.received_messages, report.refused);
  if (report.updates > 0) {
    fmt::print("gateway {:.1f} us of CPU for each update\n",
               (report.frame_cpu_s + report.network_cpu_s) * 1e6 / static_cast<double>(report.updates));
  }
  fmt::print("digest {:016x} of {} frames\n", digest, world.frames());
}

}  // namespace

Job make_job(const ServeOptions& options) {
  Job job;
  job.scene = read_served_scene(options);
  for (ObjectSpec& object : job.scene.objects) {
    object.user_data = object.category == Category::non_active ? motion::gives_way : 0;
  }
  job.title = options.scene.empty() ? fmt::format("{} objects, seed {}", options.plaza.objects, options.plaza.seed)
                                    : fmt::format("{} objects of {}", job.scene.objects.size(), options.scene);
  motion::WalkConfig walk;
  walk.bounds_min = job.scene.bounds_min;
  walk.bounds_max = job.scene.bounds_max;
  walk.seed = options.plaza.seed;
  walk.step = static_cast<float>(1 / options.tick);
  job.model = std::make_shared<motion::Walk>(walk);
  job.frames.frames = options.frames == 0 ? max_frames : options.frames;
  job.service = options.service;
  job.service.users = worlds::users_of(job.scene);
  job.output = options.output;
  job.journal = options.journal;
  return job;
}

int serve(const ServeOptions& options) {
  const StopSignals stop;
  const Job job = make_job(options);
  std::optional<OutputFile> json;
  if (!options.output.json.empty()) json.emplace(options.output.json);
  Figures figures;
  JournalRun journal(job, figures);
  WorldConfig config = world_config(job);
  config.quotas = {};
  reserve_for_avatars(config, options);
  World world = journal.make_world(std::move(config));
  SpawnPlaces places(world, shape_of_avatars(job.scene), avatar_height);
  ServerRobots robots(world, places);
  ServedFrames served;
  FrameClock clock(options.tick);
  const auto run_frame = [&] {
    advance(world, world.frames());
    journal.count_frame(world);
    ++served.frames;
    served.frame_ms += world.report().frame_ms;
    served.longest_ms = std::max(served.longest_ms, world.report().frame_ms);
  };
  // The first frame brings the objects of the scene into the world, so that avatars find free places.
  if (world.frames() == 0) run_frame();
  static_cast<void>(robots.resize(options.robots));

  GatewayConfig gateway_options =
      gateway_config(options, job.scene.contact_label, dynamic_cast<const motion::Walk&>(*job.model));
  gateway_options.hooks.spawn = [&](UserId user) { return places.spawn(user); };
  gateway_options.hooks.robots = [&](std::uint32_t count) { return robots.resize(count); };
  gateway_options.hooks.digest = [&] { return figures.digest(); };
  Gateway gateway(world, std::move(gateway_options));
  fmt::print("{}\n", gateway.url());
  std::fflush(stdout);
  keep_freed_arrays();
  while (world.frames() < job.frames.frames && !stop.received()) {
    gateway.before_frame();
    robots.before_frame();
    run_frame();
    gateway.after_frame();
    clock.wait();
  }
  gateway.close();
  served.late = clock.late();
  journal.finish();
  const GatewayReport report = gateway.report();
  if (json) write_report(*json, world, served, report, figures.digest());
  if (!options.output.quiet) print_report(world, served, report, figures.digest());
  return done;
}

}  // namespace ringfence::tools
