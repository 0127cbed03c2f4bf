#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "child_process.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::tools {

/// Reads the triangles of a mesh file. The extension of its name selects the format: OBJ, STL, PLY, glTF 2 (text or
/// binary) or 3DS. All meshes of the file become one surface, transformed by the nodes of the file. Polygons are
/// triangulated; points and lines are dropped. Coordinates are metres. Triangles keep the order of the file, so that
/// one file always gives one digest.
///
/// The assimp library reads the file in a process of another program, ringfence-mesh-reader, so that a file on which it
/// crashes, hangs or exhausts memory is refused like any other invalid file. Opens only the file itself and, for glTF,
/// the buffers that it names in its folder or below.
///
/// Throws Error with the file name and the reason: unknown extension, no such file, more than 1 GiB, invalid content,
/// no triangles, more than a million triangles, vertices that are not finite, or no such program.
TriangleMesh read_mesh(const std::filesystem::path& file);

/// Reads a mesh from memory. The extension of `name` selects the format. glTF buffers are read from `folder`; if it is
/// empty, external buffers are refused. Throws like read_mesh.
TriangleMesh parse_mesh(std::string_view bytes, const std::string& name, const std::filesystem::path& folder = {},
                        const ChildLimits& limits = {});

/// Writes a mesh as binary PLY, which keeps every bit. Throws Error with the file name and the system's error message.
void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh);

}  // namespace ringfence::tools
