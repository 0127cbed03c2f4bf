#include "worlds/query_file.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "worlds/csv_text.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::worlds {
namespace {

constexpr std::string_view query_header = "frame,query,kind,shape,x,y,z,qx,qy,qz,qw,dx,dy,dz,layers,except,at";
constexpr std::size_t query_fields = 17;
using Fields = std::array<std::string_view, query_fields>;

constexpr QueryKind all_kinds[] = {QueryKind::ray,       QueryKind::ray_any, QueryKind::ray_all, QueryKind::sweep,
                                   QueryKind::sweep_all, QueryKind::overlap, QueryKind::nearest};

bool has_shape(QueryKind kind) {
  return kind == QueryKind::sweep || kind == QueryKind::sweep_all || kind == QueryKind::overlap;
}

/// The names of a scene that queries refer to.
class SceneNames {
 public:
  explicit SceneNames(const Scene& scene) : scene_(scene) {
    for (std::uint32_t i = 0; i < scene.shapes.size(); ++i) shapes_.emplace(scene.shapes[i].name, i);
    for (const ObjectSpec& object : scene.objects) objects_.insert(object.number);
  }

  std::optional<std::uint32_t> find_shape(std::string_view name) const {
    const auto found = shapes_.find(name);
    return found == shapes_.end() ? std::nullopt : std::optional(found->second);
  }
  bool is_mesh(std::uint32_t shape) const {
    return std::holds_alternative<TriangleMesh>(scene_.shapes[shape].description);
  }
  /// The bit of a layer; 0 if there is no such layer.
  std::uint32_t layer_bit(std::string_view name) const {
    const auto& names = layer_names();
    const auto at = std::find(names.begin(), names.end(), name);
    return at == names.end() ? 0 : std::uint32_t{1} << (at - names.begin());
  }
  const std::vector<std::string>& layer_names() const { return scene_.layers.names; }
  bool has_object(ObjectNumber number) const { return objects_.contains(number); }

 private:
  const Scene& scene_;
  std::unordered_map<std::string_view, std::uint32_t> shapes_;
  std::unordered_set<ObjectNumber> objects_;
};

class QueryReader {
 public:
  QueryReader(std::string_view text, const std::string& name, const Scene& scene, std::uint32_t frames,
              std::uint32_t history)
      : text_(text, name), names_(scene), frames_(frames), history_(history) {}

  std::vector<QueryRow> read() {
    const std::optional<std::string_view> first = text_.next_line();
    if (first != query_header) {
      text_.fail(fmt::format("found \"{}\"; expected the header \"{}\"", first.value_or(""), query_header));
    }
    while (const std::optional<std::string_view> line = text_.next_line()) read_row(*line);
    std::sort(rows_.begin(), rows_.end(), [](const QueryRow& p, const QueryRow& q) {
      return std::tie(p.frame, p.query) < std::tie(q.frame, q.query);
    });
    return std::move(rows_);
  }

 private:
  void read_row(std::string_view line) {
    Fields parts;
    text_.split(line, parts, query_header);
    QueryRow row;
    read_ids(parts, row);
    row.kind = read_kind(parts[2]);
    if (has_shape(row.kind)) {
      row.shape = read_shape(parts[3]);
    } else if (!parts[3].empty()) {
      text_.fail_unexpected("shape", parts[3], fmt::format("nothing, as {} has no shape", name_of(row.kind)));
    }
    row.pose.position = {read_length(parts[4], "x"), read_length(parts[5], "y"), read_length(parts[6], "z")};
    read_orientation(parts, row);
    read_path(parts, row);
    if (!parts[14].empty()) row.layers = read_layers(parts[14]);
    if (!parts[15].empty()) row.except = read_except(parts[15]);
    row.at = read_frame_asked(parts[16], row.frame);
    rows_.push_back(row);
  }

  void read_ids(const Fields& parts, QueryRow& row) {
    row.frame = text_.number<std::uint32_t>(parts[0], "frame", "a whole number of 0 or more");
    row.query = text_.number<std::uint32_t>(parts[1], "query", "a whole number of 0 or more");
    if (row.frame >= frames_) {
      text_.fail(
          fmt::format("frame: found {}; expected less than {}, the number of counted frames", row.frame, frames_));
    }
    if (!rows_.empty() && row.frame < rows_.back().frame) {
      text_.fail(
          fmt::format("frame: found {} after {}; expected frames in ascending order", row.frame, rows_.back().frame));
    }
    if (!rows_.empty() && row.frame > rows_.back().frame) ids_.clear();
    if (!ids_.insert(row.query).second) {
      text_.fail(
          fmt::format("query: found {} twice in frame {}; expected distinct ids in each frame", row.query, row.frame));
    }
  }

  QueryKind read_kind(std::string_view text) const {
    std::string words;
    for (const QueryKind kind : all_kinds) {
      if (text == name_of(kind)) return kind;
      words += fmt::format("{}{}", words.empty() ? "" : ", ", name_of(kind));
    }
    text_.fail_unexpected("kind", text, "one of " + words);
  }

  std::uint32_t read_shape(std::string_view text) const {
    const std::optional<std::uint32_t> shape = names_.find_shape(text);
    if (!shape) text_.fail_unexpected("shape", text, "the name of a shape of the scene");
    if (names_.is_mesh(*shape)) {
      text_.fail(
          fmt::format("shape: \"{}\" is a mesh; expected a convex shape: a sphere, box, capsule or convex hull", text));
    }
    return *shape;
  }

  double read_length(std::string_view text, const char* field) const {
    const double value = text_.finite<double>(text, field);
    if (std::abs(value) > farthest_coordinate) text_.fail_unexpected(field, text, "at most 10^15 metres");
    return value;
  }

  void read_orientation(const Fields& parts, QueryRow& row) const {
    const auto orientation = std::span(parts).subspan<7, 4>();
    const bool given = std::any_of(orientation.begin(), orientation.end(), [](auto part) { return !part.empty(); });
    if (!given) return;
    const Quat found = text_.orientation(orientation);
    if (has_shape(row.kind)) row.pose.orientation = found;
  }

  void read_path(const Fields& parts, QueryRow& row) const {
    const bool has_path = row.kind != QueryKind::overlap && row.kind != QueryKind::nearest;
    if (has_path) {
      row.displacement = {read_length(parts[11], "dx"), read_length(parts[12], "dy"), read_length(parts[13], "dz")};
      return;
    }
    if (row.kind == QueryKind::nearest) {
      row.distance = read_length(parts[11], "dx");
      if (row.distance < 0) text_.fail_unexpected("dx", parts[11], "a distance of 0 or more");
    } else {
      expect_unused(parts[11], "dx", row.kind);
    }
    expect_unused(parts[12], "dy", row.kind);
    expect_unused(parts[13], "dz", row.kind);
  }

  void expect_unused(std::string_view text, const char* field, QueryKind kind) const {
    if (text.empty() || text_.finite<double>(text, field) == 0) return;
    text_.fail_unexpected(field, text, fmt::format("nothing or 0, as {} does not use it", name_of(kind)));
  }

  std::uint32_t read_layers(std::string_view text) const {
    std::uint32_t layers = 0;
    for (std::size_t at = 0; at <= text.size();) {
      const std::size_t end = std::min(text.find('+', at), text.size());
      const std::uint32_t bit = names_.layer_bit(text.substr(at, end - at));
      if (bit == 0) fail_layer(text.substr(at, end - at));
      layers |= bit;
      at = end + 1;
    }
    return layers;
  }

  [[noreturn]] void fail_layer(std::string_view name) const {
    if (names_.layer_names().empty()) text_.fail_unexpected("layers", name, "nothing, as the scene has no layers");
    text_.fail_unexpected("layers", name,
                          fmt::format("layers of the scene, joined by +: {}", fmt::join(names_.layer_names(), ", ")));
  }

  ObjectNumber read_except(std::string_view text) const {
    const auto number = text_.number<ObjectNumber>(text, "except", "the id of an object of the scene, or nothing");
    if (!names_.has_object(number)) {
      text_.fail_unexpected("except", text, "the id of an object of the scene, or nothing");
    }
    return number;
  }

  std::optional<double> read_frame_asked(std::string_view text, std::uint32_t frame) const {
    if (text.empty()) return std::nullopt;
    const std::uint32_t oldest = frame - std::min(frame, history_);
    const auto at = text_.finite<double>(text, "at");
    if (at == frame) return std::nullopt;
    if (at >= oldest && at < frame) return at;
    text_.fail_unexpected(
        "at", text,
        fmt::format("a frame from {} to {}, or nothing for this one; --history has {}", oldest, frame, history_));
  }

  CsvText text_;
  SceneNames names_;
  std::uint32_t frames_, history_;
  std::unordered_set<std::uint32_t> ids_;  ///< of the frame of the last row
  std::vector<QueryRow> rows_;
};

}  // namespace

std::vector<QueryRow> parse_queries(std::string_view text, const std::string& name, const Scene& scene,
                                    std::uint32_t frames, std::uint32_t history) {
  return QueryReader(text, name, scene, frames, history).read();
}

std::vector<QueryRow> read_queries(const std::filesystem::path& file, const Scene& scene, std::uint32_t frames,
                                   std::uint32_t history) {
  return parse_queries(read_text(file), file.string(), scene, frames, history);
}

}  // namespace ringfence::worlds
