#include "robots/robots_options.hpp"

#include <cstdint>
#include <limits>

#include "option_checks.hpp"
#include "option_groups.hpp"
#include "run_options.hpp"

namespace ringfence::tools {

void add_robots(CLI::App& command, RobotsOptions& options) {
  command.option_defaults()->group(option_groups::clients);
  command.add_option("--url", options.url, "address of the gateway")->required()->type_name("URL");
  command.add_option("--clients", options.clients, "number of robots")
      ->check(between(1u, 60'000u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--seconds", options.seconds, "time for which they walk, after all are connected")
      ->check(between(0.1, 1e6))
      ->capture_default_str()
      ->type_name("S");
  command.add_option("--seed", options.seed, "seed of their ways")
      ->check(between(std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max()).description(""))
      ->capture_default_str()
      ->type_name("N");
  add_word(command, "--inputs", options.inputs, {"every", "change"}, "when they send inputs: every frame, or changes")
      ->default_str(options.inputs);
  command.add_flag("--predict", options.predicts, "predict their avatars, interpolate others, and report how well");
  command.add_option("--token-key", options.token_key, "key of serve --token-key; without it they are guests")
      ->type_name("FILE");
  command.add_option("--world", options.world, "name of the world")->capture_default_str()->type_name("NAME");
  command.add_option("--first-user", options.first_user, "user number of the first, with --token-key")
      ->check(between(0u, 65'535u))
      ->capture_default_str()
      ->type_name("N");
  command.add_option("--from", options.from, "address of this machine from which they connect: 127.0.0.2")
      ->type_name("IP");
  command.add_option("--authority", options.authority, "certificate that signed that of the gateway, PEM")
      ->type_name("FILE");
  command.option_defaults()->group(option_groups::output);
  command.add_option("--json", options.json, "write the results as JSON")->type_name("FILE");
}

}  // namespace ringfence::tools
