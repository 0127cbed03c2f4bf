#include "scale_options.hpp"

#include "cluster_costs.hpp"
#include "option_checks.hpp"
#include "option_groups.hpp"

namespace ringfence::tools {
namespace {

void add_counts(CLI::App& command, const char* option, std::vector<std::uint32_t>& list, std::uint32_t low,
                std::uint32_t high, const char* help) {
  command.add_option(option, list, help)
      ->delimiter(',')
      ->check(between(low, high))
      ->capture_default_str()
      ->type_name("N,...");
}

}  // namespace

void add_scale_world(CLI::App& command, ScaleOptions& options) {
  command.option_defaults()->group(option_groups::world);
  add_counts(command, "--objects", options.objects, 1, 10'000'000, "number of objects, avatars included");
  command.add_option("--repeats", options.repeats, "runs of each combination, for medians and ranges")
      ->check(between(1u, 1000u))
      ->capture_default_str()
      ->type_name("N");
}

void add_scale_service(CLI::App& command, ScaleOptions& options) {
  command.option_defaults()->group(option_groups::service);
  add_choice_list(command, "--deployment", options.deployments,
                  {Deployment::user, Deployment::user_server, Deployment::user_collision},
                  "which nodes host objects other than avatars");
  add_choice_list(command, "--broad-phase", options.placements,
                  {Placement::server, Placement::region, Placement::automatic}, "where the broad phase runs");
  add_counts(command, "--nodes", options.nodes, 0, 1024, "number of CD nodes; 0: everything runs in one thread");
}

void add_scale_output(CLI::App& command, ScaleOptions& options) {
  command.option_defaults()->group(option_groups::output);
  command.add_option("--model", options.models, "also model frames of a cluster from the measured counts: 2004, today")
      ->delimiter(',')
      ->check([](const std::string& name) {
        return find_cluster(name) ? std::string() : fmt::format("found {}; expected 2004 or today", name);
      })
      ->type_name("WORD,...");
  command.add_option("--cost", options.costs, "override a cost of the models, for example pair_us=700")
      ->delimiter(',')
      ->check(check_cost)
      ->type_name("NAME=VALUE,...");
  command.add_option("--json", options.json, "write all results of all runs as JSON")->type_name("FILE");
  command.add_option("--csv", options.csv, "write one row per combination as CSV")->type_name("FILE");
  command.add_option("--plots", options.plots, "draw PREFIX-*.svg and PREFIX-*.png with gnuplot")->type_name("PREFIX");
}

}  // namespace ringfence::tools
