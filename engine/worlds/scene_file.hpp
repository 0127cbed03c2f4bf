#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "worlds/input_error.hpp"
#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// Reads the triangles of a mesh file; throws Error with the reason if it cannot. The caller supplies it, because this
/// module does not depend on a mesh library. The program `ringfence` passes tools::read_mesh.
using MeshLoader = std::function<TriangleMesh(const std::filesystem::path& file)>;

/// Reads a scene in the JSON format of docs/formats.md (`"format": "ringfence-scene", "version": 1`).
///
/// Throws InputError whose message begins with FILE:LINE and names the field. Reasons: the file cannot be read or is
/// not JSON; a field is missing or unknown; a number is not finite; a shape, layer or category is unknown; an object id
/// occurs twice; the length of a quaternion differs from 1 by more than 10^-3; a shape is invalid, for example a flat
/// hull; an avatar has no user. Without `loader` a scene with meshes is refused.
Scene read_scene(const std::filesystem::path& file, const MeshLoader& loader = {});

/// Parses a scene from memory. `name` is the file name in messages; mesh paths are relative to `folder`.
Scene parse_scene(std::string_view text, const std::string& name, const std::filesystem::path& folder = {},
                  const MeshLoader& loader = {});

/// Formats a scene in the same format, with one line for each shape and object. Every number reads back with the same
/// bits. Throws Error for a shape that is defined by a support function.
std::string format_scene(const Scene& scene);

/// Writes `format_scene(scene)` to a file. Throws Error that names the file.
void write_scene(const std::filesystem::path& file, const Scene& scene);

}  // namespace ringfence::worlds
