#include "mesh_answer.hpp"

#include <cstdint>
#include <cstring>
#include <vector>

#include "mesh_format.hpp"
#include "ringfence/error.hpp"

namespace ringfence::tools {
namespace {

// First byte of an answer.
constexpr char mesh_tag = 'm', refusal_tag = 'r';

template <class T>
void put_all(std::string& to, const std::vector<T>& values) {
  const std::uint64_t count = values.size();
  to.append(reinterpret_cast<const char*>(&count), sizeof count);
  to.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// Reads what put_all wrote and removes it from `from`. False if `from` is too short.
template <class T>
bool take_all(std::string_view& from, std::vector<T>& values) {
  std::uint64_t count = 0;
  if (from.size() < sizeof count) return false;
  std::memcpy(&count, from.data(), sizeof count);
  from.remove_prefix(sizeof count);
  if (count > from.size() / sizeof(T)) return false;
  values.resize(count);
  if (count != 0) std::memcpy(values.data(), from.data(), count * sizeof(T));
  from.remove_prefix(count * sizeof(T));
  return true;
}

}  // namespace

std::string mesh_answer(const TriangleMesh& mesh) {
  std::string answer(1, mesh_tag);
  put_all(answer, mesh.vertices);
  put_all(answer, mesh.indices);
  return answer;
}

std::string refusal_answer(std::string_view why) { return refusal_tag + std::string(why); }

TriangleMesh mesh_in(std::string_view answer) {
  if (answer.starts_with(refusal_tag)) throw Error(std::string(answer.substr(1)));
  TriangleMesh mesh;
  if (!answer.starts_with(mesh_tag)) throw Error("its reader, assimp, returned nothing");
  answer.remove_prefix(1);
  if (!take_all(answer, mesh.vertices) || !take_all(answer, mesh.indices) || !answer.empty())
    throw Error("its reader, assimp, returned an incomplete mesh");
  const std::string error_text = describe_mesh_error(mesh);
  if (!error_text.empty()) throw Error(error_text);
  return mesh;
}

}  // namespace ringfence::tools
