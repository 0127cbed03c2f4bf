#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "ringfence/shape.hpp"

namespace ringfence::tools {

/// Maximum size of a mesh file, and of each buffer that it refers to.
inline constexpr std::uintmax_t max_mesh_bytes = std::uintmax_t{1} << 30;

/// The extension of a mesh file in lower case and with the dot, for example ".obj"; empty for an unsupported one.
std::string mesh_extension(const std::filesystem::path& name);

/// Error message for a mesh that a world cannot use: no triangles or more than a million, a vertex index out of range,
/// or a vertex that is not finite. Empty for a usable mesh.
std::string describe_mesh_error(const TriangleMesh& mesh);

}  // namespace ringfence::tools
