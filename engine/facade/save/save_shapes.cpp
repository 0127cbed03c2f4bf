#include "facade/save/save_shapes.hpp"

#include <algorithm>
#include <cstdint>
#include <string>
#include <variant>

#include "ringfence/error.hpp"

namespace ringfence::facade {

namespace {

void write(SaveWriter& to, const Sphere& sphere) { to.value(sphere.radius); }
void write(SaveWriter& to, const Box& box) { to.value(box.half_extents); }
void write(SaveWriter& to, const Capsule& capsule) {
  to.value(capsule.radius);
  to.value(capsule.half_height);
}
void write(SaveWriter& to, const ConvexHull& hull) { to.list(hull.points); }
void write(SaveWriter& to, const TriangleMesh& mesh) {
  to.list(mesh.vertices);
  to.list(mesh.indices);
}
void write(SaveWriter& to, const SupportShape& support) {
  to.text(support.function->name());
  to.value(std::uint64_t{support.function->version()});
}

SupportShape read_support(SaveReader& from, std::span<const std::shared_ptr<const SupportFunction>> functions) {
  const std::string name = from.text();
  const auto version = from.value<std::uint64_t>();
  const auto found = std::find_if(functions.begin(), functions.end(), [&](const auto& function) {
    return function != nullptr && function->name() == name && function->version() == version;
  });
  if (found == functions.end()) {
    throw Error("save: has a shape with the support function '" + name + "', version " + std::to_string(version) +
                ", which is not in WorldConfig::support_functions: add it");
  }
  return {*found};
}

}  // namespace

void write_shape(SaveWriter& to, const ShapeDescription& shape) {
  to.value(static_cast<std::uint8_t>(shape.index()));
  std::visit([&](const auto& one) { write(to, one); }, shape);
}

ShapeDescription read_shape(SaveReader& from, std::span<const std::shared_ptr<const SupportFunction>> functions) {
  const auto kind = from.value<std::uint8_t>();
  switch (static_cast<ShapeKind>(kind)) {
    case ShapeKind::sphere:
      return Sphere{from.value<float>()};
    case ShapeKind::box:
      return Box{from.value<Vec3f>()};
    case ShapeKind::capsule: {
      const auto radius = from.value<float>();
      return Capsule{radius, from.value<float>()};
    }
    case ShapeKind::hull:
      return ConvexHull{from.list<Vec3f>()};
    case ShapeKind::mesh: {
      std::vector<Vec3f> vertices = from.list<Vec3f>();
      return TriangleMesh{std::move(vertices), from.list<std::uint32_t>()};
    }
    case ShapeKind::support:
      return read_support(from, functions);
  }
  throw Error("save: has a shape of kind " + std::to_string(kind) + "; 0 to " + std::to_string(shape_kinds - 1) +
              ": it is damaged; use another one");
}

}  // namespace ringfence::facade
