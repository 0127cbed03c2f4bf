#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "ringfence/shape.hpp"

namespace ringfence::tools {

/// Reads a mesh from memory with assimp. Only the importer of the extension of `name` is enabled (glTF: version 2). It
/// opens no file except the buffers of a glTF file, in `folder` or below and of at most 1 GiB; none if `folder` is
/// empty.
///
/// assimp runs in this process and may crash or hang on invalid bytes; parse_mesh protects against that. Throws Error
/// whose message does not contain the file name.
TriangleMesh import_mesh(std::string_view bytes, const std::string& name, const std::filesystem::path& folder);

}  // namespace ringfence::tools
