#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "trace.hpp"
#include "worlds/json_document.hpp"

namespace ringfence::tools {
namespace {

using std::numbers::pi;

constexpr double nautical_mile = 1852;        // metres
constexpr double foot = 0.3048;               // metres
constexpr double earth_radius = 6'371'008.8;  // metres, mean
constexpr std::uint64_t trace_frame_ms = 10'000;
constexpr std::uint64_t day_ms = 86'400'000;
constexpr double altitude_step = 25;  // feet; transponders report multiples of it
constexpr int prism_sides = 16;

struct Row {
  std::uint64_t time_ms;
  std::string aircraft;
  double latitude, longitude;  // radians
  double altitude;             // metres
};

/// Lambert conformal conic projection of the sphere. The standard parallels lie one sixth of the latitude range inside
/// its edges. Angles are exact; lengths are correct to 0.1 % over a few hundred kilometres. Method: Snyder, Map
/// Projections, 1987, section 15.
class Projection {
 public:
  Projection(double south, double north, double middle_longitude) : longitude_(middle_longitude) {
    const double inset = std::max((north - south) / 6, 1e-4);
    const double p = south + inset, q = std::max(north - inset, p + 1e-4);
    n_ = std::log(std::cos(p) / std::cos(q)) / std::log(tangent(q) / tangent(p));
    f_ = earth_radius * std::cos(p) * std::pow(tangent(p), n_) / n_;
    rho_middle_ = rho((south + north) / 2);
  }
  Vec3d operator()(const Row& row) const {
    const double r = rho(row.latitude), angle = n_ * (row.longitude - longitude_);
    return {r * std::sin(angle), rho_middle_ - r * std::cos(angle), row.altitude};
  }

 private:
  static double tangent(double latitude) { return std::tan(pi / 4 + latitude / 2); }
  double rho(double latitude) const { return f_ / std::pow(tangent(latitude), n_); }

  double longitude_, n_ = 1, f_ = 1, rho_middle_ = 0;
};

/// The prism around an aircraft: two prisms touch if the aircraft are closer than the required separation of 5 nautical
/// miles horizontally and 1000 ft vertically. The height is 1000 ft less half an altitude step, so that the prisms of
/// aircraft exactly 1000 ft apart do not touch.
worlds::NamedShape separation_prism() {
  const double radius = 2.5 * nautical_mile / std::cos(pi / prism_sides);
  const double half_height = (1000 - altitude_step / 2) / 2 * foot;
  ConvexHull prism;
  for (const double z : {-half_height, half_height}) {
    for (int side = 0; side < prism_sides; ++side) {
      const double angle = 2 * pi * side / prism_sides;
      prism.points.push_back({static_cast<float>(radius * std::cos(angle)),
                              static_cast<float>(radius * std::sin(angle)), static_cast<float>(z)});
    }
  }
  return {"separation", prism, {}};
}

Row read_row(const worlds::JsonValue& row) {
  row.expect_any_object();
  const double latitude = row.field("latitude").number(), longitude = row.field("longitude").number();
  if (!(latitude > -85 && latitude < 85)) row.field("latitude").fail_unexpected("degrees between -85 and 85");
  if (!(longitude >= -180 && longitude <= 180)) row.field("longitude").fail_unexpected("degrees from -180 to 180");
  return {row.field("timestamp").unsigned_integer(0, 100'000'000'000'000), row.field("icao24").text(),
          latitude * pi / 180, longitude * pi / 180, row.field("altitude").number() * foot};
}

std::uint64_t time_of_day_ms(const std::string& text) {
  unsigned hour = 0, minute = 0;
  char rest = 0;
  if (text.size() != 5 || std::sscanf(text.c_str(), "%2u:%2u%c", &hour, &minute, &rest) != 2 || hour > 23 ||
      minute > 59) {
    throw Error(fmt::format("--from: found {}; expected a time of day from 00:00 to 23:59", text));
  }
  return (hour * 60u + minute) * 60'000u;
}

}  // namespace

Trace read_air(std::string_view text, const std::string& name, const std::string& from, std::uint32_t minutes) {
  const worlds::JsonDocument document(text, name);
  const worlds::JsonValue root(document);
  root.expect_array();
  std::vector<Row> rows;
  for (std::size_t i = 0; i < root.size(); ++i) rows.push_back(read_row(root.item(i)));
  if (rows.empty()) root.fail_unexpected("at least one row");

  std::uint64_t begin = std::min_element(rows.begin(), rows.end(), [](const Row& p, const Row& q) {
                          return p.time_ms < q.time_ms;
                        })->time_ms;
  if (!from.empty()) begin = begin / day_ms * day_ms + time_of_day_ms(from);
  const std::uint64_t end = minutes == 0 ? ~std::uint64_t{0} : begin + minutes * std::uint64_t{60'000};
  std::erase_if(rows, [&](const Row& row) { return row.time_ms < begin || row.time_ms >= end; });
  if (rows.empty()) throw Error(fmt::format("{}: found no aircraft in the requested time", name));

  double south = pi, north = -pi, west = pi, east = -pi;
  for (const Row& row : rows) {
    south = std::min(south, row.latitude);
    north = std::max(north, row.latitude);
    west = std::min(west, row.longitude);
    east = std::max(east, row.longitude);
  }
  const Projection project(south, north, (west + east) / 2);
  std::stable_sort(rows.begin(), rows.end(), [](const Row& p, const Row& q) { return p.time_ms < q.time_ms; });

  Trace trace;
  trace.shape = separation_prism();
  trace.contact_label = "loss of separation";
  trace.longest_gap = 6;
  trace.step = 0.1;
  trace.margin = 10'000;
  for (const Row& row : rows) {
    std::vector<Sample>& track = trace.tracks[row.aircraft];
    const auto frame = static_cast<std::uint32_t>((row.time_ms - begin) / trace_frame_ms);
    if (!track.empty() && track.back().frame == frame) continue;  // keep the first sample of each frame
    track.push_back({frame, project(row)});
  }
  return trace;
}

}  // namespace ringfence::tools
