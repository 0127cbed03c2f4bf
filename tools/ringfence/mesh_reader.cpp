// The program ringfence-mesh-reader: a mesh file as standard input, its name and the folder of its buffers as
// arguments. It is a program of its own, so that assimp reads untrusted files in a process that has nothing else.
#include <span>
#include <string>
#include <string_view>

#include "child_answer.hpp"
#include "mesh_answer.hpp"
#include "mesh_format.hpp"
#include "mesh_import.hpp"
#include "ringfence/error.hpp"

using namespace ringfence;

int main(int argc, char** argv) {
  tools::answer_parent(argc, argv, [](std::span<const char* const> arguments, std::string_view input) {
    if (arguments.size() != 2) throw Error("expected a name and a folder");
    try {
      const TriangleMesh mesh = tools::import_mesh(input, arguments[0], arguments[1]);
      // Checked before it is sent: a small file can make a large mesh.
      const std::string error_text = tools::describe_mesh_error(mesh);
      return error_text.empty() ? tools::mesh_answer(mesh) : tools::refusal_answer(error_text);
    } catch (const Error& error) {
      return tools::refusal_answer(error.what());
    }
  });
}
