#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "ringfence/shape.hpp"

namespace ringfence::tools {

/// Of a mesh file, and of each buffer that it names.
inline constexpr std::uintmax_t max_mesh_bytes = std::uintmax_t{1} << 30;

/// The format of a mesh file, by its name's ending, in small letters and with the dot; empty for one that is not read.
std::string mesh_extension(const std::filesystem::path& name);

/// The triangles of the mesh file `name` that holds `bytes`, by assimp, which reads nothing else: it knows the importer
/// of that ending alone (glTF: version 2), and opens no file but the buffers that a glTF file names in `folder` or
/// below, of 1 GiB at most; none where `folder` is empty.
///
/// Runs assimp in this process: on bytes that are not what they claim to be it may crash, or not come back. See
/// read_mesh. Throws Error without the file's name.
TriangleMesh import_mesh(std::string_view bytes, const std::string& name, const std::filesystem::path& folder);

/// Why a mesh is none that a world can be given, or empty: no triangles or more than a million, a corner that is not
/// there or not finite.
std::string describe_mesh_error(const TriangleMesh& mesh);

}  // namespace ringfence::tools
