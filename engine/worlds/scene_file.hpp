#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "worlds/input_error.hpp"
#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// Turns a mesh file into triangles; throws Error with the reason. Supplied by whoever has a loader (the tools).
using MeshLoader = std::function<TriangleMesh(const std::filesystem::path& file)>;

/// Reads a scene in the JSON format of docs/replay.md (`"format": "ringfence-scene", "version": 1`).
///
/// Throws InputError for a file that cannot be read, is not JSON, lacks a field, has one that the format does not
/// know, or says what cannot be: NaN, an unknown shape, layer or category, a number that is taken, an orientation that
/// is zero or further than 10^-3 from unit length, a flat hull, an avatar without user. The message begins with
/// FILE:LINE and names the field. Without `loader` a scene with meshes is refused.
Scene read_scene(const std::filesystem::path& file, const MeshLoader& loader = {});

/// The same from memory; `name` stands for the file in messages, mesh paths are relative to `folder`.
Scene parse_scene(std::string_view text, const std::string& name, const std::filesystem::path& folder = {},
                  const MeshLoader& loader = {});

/// The scene in the same format, a line a shape and object; every number reads back with the same bits.
/// Throws Error for a shape that only a support function describes.
std::string format_scene(const Scene& scene);

/// Writes `format_scene` to a file. Throws Error naming the file.
void write_scene(const std::filesystem::path& file, const Scene& scene);

}  // namespace ringfence::worlds
