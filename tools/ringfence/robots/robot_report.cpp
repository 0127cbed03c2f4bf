#include "robots/robot_report.hpp"

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "output_file.hpp"

namespace ringfence::tools {
namespace {

struct Quantiles {
  double p50 = 0, p99 = 0, max = 0;
};

Quantiles quantiles_of(std::vector<double>& values) {
  if (values.empty()) return {};
  const auto at = [&](double share) {
    const auto index = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::ranges::nth_element(values, values.begin() + index);
    return values[static_cast<std::size_t>(index)];
  };
  return {at(0.5), at(0.99), at(1)};
}

/// Of a histogram; `width`: of a bin.
Quantiles quantiles_of(const std::vector<std::uint32_t>& counts, double width) {
  std::uint64_t total = 0;
  for (const std::uint32_t count : counts) total += count;
  const auto at = [&](double share) {
    std::uint64_t seen = 0;
    for (std::size_t bin = 0; bin < counts.size(); ++bin) {
      seen += counts[bin];
      if (total > 0 && static_cast<double>(seen) >= share * static_cast<double>(total)) {
        return static_cast<double>(bin) * width;
      }
    }
    return 0.0;
  };
  return {at(0.5), at(0.99), at(1)};
}

template <class Value = double>
nlohmann::json json_of(const Quantiles& values) {
  return {{"p50", static_cast<Value>(values.p50)}, {"p99", static_cast<Value>(values.p99)}};
}

/// The figures of a report.
struct Summary {
  Summary(const RobotInterval& interval, RobotFigures& figures)
      : clients(static_cast<double>(std::max<std::uint64_t>(1, figures.connected))),
        updates(static_cast<double>(std::max<std::uint64_t>(1, interval.updates))),
        updates_s(updates / clients / interval.seconds),
        kbit_s(static_cast<double>(interval.bytes) * 8e-3 / clients / interval.seconds),
        objects_near(static_cast<double>(interval.objects) / updates),
        cpu_us(interval.cpu_s * 1e6 / updates),
        effect_frames(quantiles_of(figures.effect_frames, 1)),
        effect_ms(quantiles_of(figures.effect_ms, 0.1)),
        trip_ms(quantiles_of(figures.round_trip_ms)),
        prediction_m(quantiles_of(figures.prediction_m)),
        display_ms(quantiles_of(figures.display_ms)) {}

  double clients, updates, updates_s, kbit_s, objects_near, cpu_us;
  Quantiles effect_frames, effect_ms, trip_ms, prediction_m, display_ms;
};

void write_json(const RobotsOptions& options, const RobotInterval& interval, const RobotFigures& figures,
                const RobotBoard& board, const RobotViolations& violations, const Summary& summary) {
  nlohmann::json found;
  for (std::uint8_t kind = 0; kind < RobotViolations::kind_count; ++kind) {
    const auto each = static_cast<RobotViolations::Kind>(kind);
    found[RobotViolations::name_of(each)] = violations.count(each);
  }
  nlohmann::json json{{"clients", options.clients},
                      {"connected", figures.connected},
                      {"seconds", interval.seconds},
                      {"updates", interval.updates},
                      {"updates_per_client_and_second", summary.updates_s},
                      {"kbit_s_per_client", summary.kbit_s},
                      {"objects_near", summary.objects_near},
                      {"complete_updates", figures.complete},
                      {"skipped_frames", figures.skipped},
                      {"ignored_updates", figures.ignored},
                      {"effect_frames", json_of<std::uint64_t>(summary.effect_frames)},
                      {"effect_ms", json_of(summary.effect_ms)},
                      {"round_trip_ms", json_of(summary.trip_ms)},
                      {"checked_pairs", board.checked_pairs()},
                      {"checked_contacts", board.checked_contacts()},
                      {"cpu_us_per_update", summary.cpu_us},
                      {"violations", found}};
  if (options.predicts) {
    json["prediction_m"] = json_of(summary.prediction_m);
    json["prediction_m"]["max"] = summary.prediction_m.max;
    json["display_ms"] = json_of(summary.display_ms);
    json["late_updates"] = figures.late;
  }
  OutputFile file(options.json);
  file.write(json.dump(2) + "\n");
  file.close();
}

}  // namespace

void report_robots(const RobotsOptions& options, const RobotInterval& interval, RobotFigures& figures,
                   const RobotBoard& board, const RobotViolations& violations) {
  const Summary summary(interval, figures);
  if (!options.json.empty()) write_json(options, interval, figures, board, violations, summary);
  fmt::print("{} of {} robots connected; {:.1f} s\n", figures.connected, options.clients, interval.seconds);
  fmt::print("each: {:.1f} updates/s, {:.1f} kbit/s, {:.1f} objects near; {:.1f} us of CPU an update\n",
             summary.updates_s, summary.kbit_s, summary.objects_near, summary.cpu_us);
  fmt::print("input to effect: p50 {:.0f}, p99 {:.0f} frames; received: p50 {:.1f}, p99 {:.1f} ms after the input\n",
             summary.effect_frames.p50, summary.effect_frames.p99, summary.effect_ms.p50, summary.effect_ms.p99);
  fmt::print("round trip: p50 {:.0f}, p99 {:.0f} ms\n", summary.trip_ms.p50, summary.trip_ms.p99);
  if (options.predicts) {
    fmt::print("prediction: p50 {:.3f}, p99 {:.3f}, largest {:.3f} m from the position of the server\n",
               summary.prediction_m.p50, summary.prediction_m.p99, summary.prediction_m.max);
    fmt::print("others displayed p50 {:.0f}, p99 {:.0f} ms after the fastest update; {} updates later than that\n",
               summary.display_ms.p50, summary.display_ms.p99, figures.late);
  }
  fmt::print("{} frames without an update, {} updates too late\n", figures.skipped, figures.ignored);
  fmt::print("checked {} pairs of avatars, {} near enough to touch\n", board.checked_pairs(), board.checked_contacts());
  for (std::uint8_t kind = 0; kind < RobotViolations::kind_count; ++kind) {
    const auto each = static_cast<RobotViolations::Kind>(kind);
    if (violations.count(each) == 0) continue;
    fmt::print("FAILED: {}: {}, the first: {}\n", RobotViolations::name_of(each), violations.count(each),
               violations.example(each));
  }
}

}  // namespace ringfence::tools
