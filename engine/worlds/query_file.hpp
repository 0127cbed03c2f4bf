#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "worlds/input_error.hpp"
#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// The kinds of queries of a query file; docs/formats.md says what each of them answers.
enum class QueryKind : std::uint8_t { ray, ray_any, ray_all, sweep, sweep_all, overlap, nearest };
/// Name of a kind in query files.
constexpr const char* name_of(QueryKind kind) noexcept {
  constexpr const char* names[] = {"ray", "ray_any", "ray_all", "sweep", "sweep_all", "overlap", "nearest"};
  return names[static_cast<std::size_t>(kind)];
}

/// One query of a frame. Metres, world axes.
struct QueryRow {
  std::uint32_t frame = 0;  ///< counted frame, from 0
  std::uint32_t query = 0;  ///< its id, distinct within the frame
  QueryKind kind = QueryKind::ray;
  std::uint32_t shape = 0;  ///< sweeps and overlaps: index in Scene::shapes, no mesh
  Pose pose;                ///< start of a ray or sweep, place of the shape, or point; only shapes are turned
  Vec3d displacement{};     ///< rays and sweeps
  double distance = 0;      ///< nearest: the largest distance, >= 0
  std::uint32_t layers = 0xffffffffu;  ///< bit i: objects of layer i
  ObjectNumber except = 0;             ///< leaves out this object; 0: none
  std::optional<double> at{};          ///< the frame asked about, below `frame`; empty: `frame`
  bool operator==(const QueryRow&) const noexcept = default;
};

/// Reads queries about a replay of `scene` from a CSV file. `frames` is the number of counted frames, `history` that of
/// the frames before each that can be asked about. The result is in order of (frame, query).
///
/// Throws InputError that names file, line and field for:
/// - a wrong header or field count; frames in descending order or beyond `frames`; an id that is used twice in a frame;
/// - an unknown kind, shape, layer or object; a mesh as shape; a field that the kind of query needs and that is empty,
///   or the other way around;
/// - a number that is not finite or beyond 10^15 m; a quaternion whose length differs from 1 by more than 10^-3; a
///   negative distance;
/// - `at` a frame after that of the row, before the first, or more than `history` before it.
std::vector<QueryRow> read_queries(const std::filesystem::path& file, const Scene& scene, std::uint32_t frames,
                                   std::uint32_t history = 0);

/// Parses queries from memory. `name` is the file name in messages.
std::vector<QueryRow> parse_queries(std::string_view text, const std::string& name, const Scene& scene,
                                    std::uint32_t frames, std::uint32_t history = 0);

}  // namespace ringfence::worlds
