#pragma once

#include <string>
#include <string_view>

#include "ringfence/shape.hpp"

namespace ringfence::tools {

/// What the program that reads mesh files answers: a mesh, or the reason why the file is refused.
std::string mesh_answer(const TriangleMesh& mesh);
std::string refusal_answer(std::string_view why);

/// The mesh in an answer. The reader may have been damaged by invalid input, so its answer is checked. Throws Error
/// with the reason if the file was refused, or the answer has no mesh that describe_mesh_error accepts.
TriangleMesh mesh_in(std::string_view answer);

}  // namespace ringfence::tools
