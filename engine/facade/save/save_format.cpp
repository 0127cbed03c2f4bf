#include "facade/save/save_format.hpp"

#include <array>
#include <cstdint>
#include <string>

#include "facade/save/save_check.hpp"
#include "facade/save/save_shapes.hpp"
#include "facade/save/save_stream.hpp"
#include "ringfence/error.hpp"

namespace ringfence::facade {

namespace {

constexpr std::array<char, 8> magic = {'R', 'F', 'S', 'A', 'V', 'E', '\r', '\n'};

void write_layers(SaveWriter& to, const LayerMatrix& layers) {
  to.value(std::uint64_t{layers.names.size()});
  for (const std::string& name : layers.names) {
    to.text(name);
  }
  to.value(std::uint64_t{layers.collide.size()});
  for (const auto& [p, q] : layers.collide) {
    to.value(p);
    to.value(q);
  }
}

LayerMatrix read_layers(SaveReader& from) {
  LayerMatrix layers;
  for (auto names = from.value<std::uint64_t>(); names > 0; --names) {
    layers.names.push_back(from.text());
  }
  for (auto pairs = from.value<std::uint64_t>(); pairs > 0; --pairs) {
    const auto p = from.value<std::uint8_t>();
    layers.collide.emplace_back(p, from.value<std::uint8_t>());
  }
  return layers;
}

void write_shapes(SaveWriter& to, const std::vector<const ShapeDescription*>& shapes) {
  to.value(std::uint64_t{shapes.size()});
  for (const ShapeDescription* shape : shapes) {
    to.value(static_cast<std::uint8_t>(shape != nullptr ? 1 : 0));
    if (shape != nullptr) {
      write_shape(to, *shape);
    }
  }
}

void read_shapes(SaveReader& from, std::span<const std::shared_ptr<const SupportFunction>> functions,
                 SavedWorld& saved) {
  for (auto shapes = from.value<std::uint64_t>(); shapes > 0; --shapes) {
    const bool exists = from.value<std::uint8_t>() != 0;
    if (exists) {
      saved.read_shapes.push_back(read_shape(from, functions));
    }
    saved.shapes.push_back(exists ? &saved.read_shapes.back() : nullptr);
  }
}

void read_head(SaveReader& from) {
  if (from.left() < magic.size() || from.value<std::array<char, 8>>() != magic) {
    throw Error("save: the first bytes are not those of a save; expected what World::save wrote");
  }
  if (const auto version = from.value<std::uint32_t>(); version != save_version) {
    throw Error("save: has format " + std::to_string(version) + "; this release reads format " +
                std::to_string(save_version) + ": restore it with the release that wrote it");
  }
}

}  // namespace

bool write_save(const SavedWorld& saved, Sink& sink) {
  SaveWriter to(sink);
  to.value(magic);
  to.value(save_version);
  to.value(saved.frames);
  to.value(saved.last_number);
  to.value(saved.generation);
  to.text(saved.model_name);
  to.value(saved.model_version);
  to.value(saved.state_bytes);
  write_layers(to, saved.layers);
  write_shapes(to, saved.shapes);
  to.list(saved.objects);
  to.list(saved.states);
  to.list(saved.contacts);
  to.list(saved.users);
  to.list(saved.requests);
  to.list(saved.request_states);
  to.list(saved.moves);
  to.list(saved.inputs);
  to.list(saved.own);
  return to.finish();
}

SavedWorld read_save(Source& source, std::span<const std::shared_ptr<const SupportFunction>> functions) {
  SaveReader from(source);
  read_head(from);
  SavedWorld saved;
  saved.frames = from.value<std::uint64_t>();
  saved.last_number = from.value<std::uint32_t>();
  saved.generation = from.value<std::uint32_t>();
  saved.model_name = from.text();
  saved.model_version = from.value<std::uint64_t>();
  saved.state_bytes = from.value<std::uint32_t>();
  saved.layers = read_layers(from);
  read_shapes(from, functions, saved);
  saved.objects = from.list<SavedObject>();
  saved.states = from.list<std::byte>();
  saved.contacts = from.list<SavedContact>();
  saved.users = from.list<SavedUser>();
  saved.requests = from.list<SavedRequest>();
  saved.request_states = from.list<std::byte>();
  saved.moves = from.list<SavedMove>();
  saved.inputs = from.list<SavedInput>();
  saved.own = from.list<std::byte>();
  if (from.left() != 0) {
    throw Error("save: has " + std::to_string(from.left()) + " bytes too many: it is damaged; use another one");
  }
  check(saved);
  return saved;
}

}  // namespace ringfence::facade
