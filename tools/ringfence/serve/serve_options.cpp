#include "serve/serve_options.hpp"

#include <limits>

#include "option_checks.hpp"
#include "option_groups.hpp"
#include "run_options.hpp"

namespace ringfence::tools {
namespace {

void add_served_world(CLI::App& command, ServeOptions& options) {
  command.option_defaults()->group(option_groups::world);
  CLI::Option* const objects =
      command.add_option("--objects", options.plaza.objects, "things on the square, without avatars");
  objects->check(between(0u, 1'000'000u))->capture_default_str()->type_name("N");
  CLI::Option* const seed = command.add_option("--seed", options.plaza.seed, "seed of all random numbers");
  seed->check(between(std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max()).description(""))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--scene", options.scene, "instead of the square: scene file, JSON")
      ->type_name("FILE")
      ->excludes(objects);
  command.add_option("--robots", options.robots, "avatars that the server moves")
      ->check(between(0u, 10'000u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--frames", options.frames, "frames in all; 0: until SIGINT or SIGTERM")
      ->check(between(0u, max_frames))
      ->capture_default_str()
      ->type_name("N");
}

void add_served_service(CLI::App& command, ServiceOptions& service) {
  command.option_defaults()->group(option_groups::service);
  add_choice(command, "--deployment", service.deployment,
             {Deployment::user, Deployment::user_server, Deployment::user_collision},
             "which nodes host objects other than avatars");
  command.add_option("--nodes", service.nodes, "number of CD nodes; 0: everything runs in one thread")
      ->check(between(0u, 1024u))
      ->default_str("usable cores less 1, at least 1")
      ->type_name("N");
  add_choice(command, "--broad-phase", service.placement, {Placement::server, Placement::region, Placement::automatic},
             "where the broad phase runs");
  command.add_option("--interest", service.interest, "metres around an avatar within which its player sees objects")
      ->check(between(0.0, 1e9))
      ->capture_default_str()
      ->type_name("M");
  add_deepest_contacts(command, service);
  command.option_defaults()->group(option_groups::faults);
  command
      .add_option("--node-deadline-ms", service.deadlines.node_ms,
                  "a CD node that is silent for this long is lost; 0: never")
      ->check(between(0.0, 1e6))
      ->capture_default_str()
      ->type_name("MS");
}

}  // namespace

void add_clients(CLI::App& command, ServeOptions& options) {
  command.option_defaults()->group(option_groups::clients);
  command.add_option("--listen", options.listen, "address and port for clients; port 0: any free one")
      ->capture_default_str()
      ->type_name("HOST:PORT");
  command.add_option("--tick", options.tick, "frames per second")
      ->check(between(0.1, 1000.0))
      ->capture_default_str()
      ->type_name("HZ");
  CLI::Option* const certificate = command.add_option("--cert", options.certificate, "certificate chain for TLS, PEM");
  CLI::Option* const key = command.add_option("--key", options.key, "private key of --cert, PEM");
  certificate->type_name("FILE")->needs(key);
  key->type_name("FILE")->needs(certificate);
  command.add_option("--token-key", options.token_key, "key of the tokens of clients; without it all are guests")
      ->type_name("FILE");
  // Of resume, the options of node processes have it already.
  if (command.get_option_no_throw("--world") == nullptr) {
    command.add_option("--world", options.world, "name of the world, which tokens have as aud")
        ->capture_default_str()
        ->type_name("NAME");
  }
  command.add_option("--max-clients", options.max_clients, "most clients at the same time")
      ->check(between(std::size_t{1}, std::size_t{65'536}))
      ->capture_default_str()
      ->type_name("N");
  command
      .add_option("--origin", options.origins,
                  "origin whose pages may connect, such as https://example.org; repeatable")
      ->type_name("ORIGIN");
  command.add_option("--grace", options.grace_s, "seconds for which the avatar of a lost connection stays")
      ->check(between(0.0, 1e6))
      ->capture_default_str()
      ->type_name("S");
  command.add_option("--page", options.page, "directory of the page; default: the one installed with the program")
      ->type_name("DIR");
  command
      .add_option("--network", options.network,
                  "a worse network, for tests: delay=150ms,jitter=50ms,loss=5%,share=50%,address=127.0.0.2")
      ->type_name("PARTS");
}

void add_serve(CLI::App& command, ServeOptions& options) {
  add_served_world(command, options);
  add_clients(command, options);
  add_served_service(command, options.service);
  add_journal_options(command, options.journal, true);
  command.option_defaults()->group(option_groups::output);
  command.add_option("--json", options.output.json, "write results as JSON at the end")->type_name("FILE");
  add_quiet(command, options.output);
}

}  // namespace ringfence::tools
