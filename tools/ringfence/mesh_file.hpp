#pragma once

#include <filesystem>

#include "ringfence/shape.hpp"

namespace ringfence::tools {

/// The triangles of a mesh file: OBJ, STL, PLY, glTF (also binary) or 3DS, by its name's ending. All parts of the file
/// in one surface, placed by its nodes; polygons are cut into triangles, points and lines left out. Coordinates are
/// taken as metres. Triangles keep the order of the file, so the same file gives the same digest.
///
/// Throws Error naming the file and why: another ending, no such file, not readable as what it claims to be, nothing
/// but points and lines. On assimp.
TriangleMesh read_mesh(const std::filesystem::path& file);

/// Writes a mesh as binary PLY, which keeps every bit. Throws Error naming the file and the system's reason.
void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh);

}  // namespace ringfence::tools
