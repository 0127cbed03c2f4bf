#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "child_process.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::tools {

/// The triangles of a mesh file: OBJ, STL, PLY, glTF 2 (also binary) or 3DS, by its name's ending. All parts of the
/// file in one surface, placed by its nodes; polygons are cut into triangles, points and lines left out. Coordinates
/// are taken as metres. Triangles keep the order of the file, so the same file gives the same digest.
///
/// assimp reads it, in a child process: a file that makes it crash, hang or want all memory is refused like any other
/// that is wrong. Opens nothing but the file and, for glTF, the buffers that it names in its folder or below.
///
/// Throws Error naming the file and why: another ending, no such file, more than 1 GiB, not readable as what it claims
/// to be, nothing but points and lines, more than a million triangles, corners that are not finite.
TriangleMesh read_mesh(const std::filesystem::path& file);

/// The same for a file called `name` that holds `bytes`; its parts lie in `folder`, or nowhere where that is empty.
TriangleMesh parse_mesh(std::string_view bytes, const std::string& name, const std::filesystem::path& folder = {},
                        const ChildLimits& limits = {});

/// Writes a mesh as binary PLY, which keeps every bit. Throws Error naming the file and the system's reason.
void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh);

}  // namespace ringfence::tools
