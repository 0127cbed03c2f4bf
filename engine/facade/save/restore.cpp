#include "facade/save/restore.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "facade/automatic_bounds.hpp"
#include "facade/save/request_records.hpp"
#include "nodes/server/server_role.hpp"
#include "ringfence/error.hpp"

namespace ringfence::facade {

namespace {

void check_model(const MotionModel* model, const SavedWorld& saved) {
  const std::string_view name = model == nullptr ? std::string_view() : model->name();
  const std::uint64_t version = model == nullptr ? 0 : model->version();
  const std::size_t bytes = model == nullptr ? 0 : model->state_bytes();
  if (name != saved.model_name || version != saved.model_version || bytes != saved.state_bytes) {
    const auto text = [](std::string_view of, std::uint64_t at, std::size_t each) {
      return "'" + std::string(of) + "', version " + std::to_string(at) + ", " + std::to_string(each) +
             " bytes for each object";
    };
    throw Error("save: was written with the motion model " +
                text(saved.model_name, saved.model_version, saved.state_bytes) + "; WorldConfig::motion is " +
                text(name, version, bytes) + ": restore it with the same model");
  }
}

bool same(const LayerMatrix& p, const LayerMatrix& q) {
  bool same = p.names == q.names;
  for (std::uint8_t layer = 0; layer < 32; ++layer) {
    same &= p.mask(layer) == q.mask(layer);
  }
  return same;
}

}  // namespace

WorldConfig config_for(WorldConfig config, const SavedWorld& saved) {
  check_model(config.motion.get(), saved);
  if (config.layers.names.empty()) {
    config.layers = saved.layers;
  } else if (!same(config.layers, saved.layers)) {
    throw Error("save: WorldConfig::layers differs from the saved layers: leave it empty to use those of the save");
  }
  if (saved.objects.size() > config.limits.objects) {
    throw Error("save: has " + std::to_string(saved.objects.size()) + " objects; WorldConfig::limits.objects is " +
                std::to_string(config.limits.objects) + ": raise it");
  }
  if (!saved.users.empty() && saved.users.back().number >= config.limits.users) {
    throw Error("save: has the user number " + std::to_string(saved.users.back().number) +
                "; WorldConfig::limits.users is " + std::to_string(config.limits.users) + ": raise it");
  }
  config.capacities.objects = std::max(config.capacities.objects, saved.objects.size());
  WorldBounds bounds;
  std::vector<Vec3d> positions;
  if (has_automatic_bounds(config)) {
    positions.reserve(saved.objects.size());
    for (const SavedObject& object : saved.objects) {
      positions.push_back(object.pose.position);
    }
    if (choose_bounds(positions, bounds)) {
      config.bounds_min = bounds.min;
      config.bounds_max = bounds.max;
    }
  }
  return config;
}

void restore_requests(const SavedWorld& saved, Requests& requests) {
  requests.restore_window(saved.frames);
  for (const SavedUser& user : saved.users) {
    requests.restore_user(user.number, user.connected != 0, {user.spawns, user.moves});
  }
  for (const SavedObject& object : saved.objects) {
    requests.restore_object(ObjectId::of(object.number, object.generation), static_cast<Category>(object.category),
                            object.user, object.shape);
  }
  restore_calls(saved, Requests::Counting::not_in_quotas, requests);
  requests.restore_ids(saved.last_number, saved.generation);
}

void restore_objects(const SavedWorld& saved, nodes::ServerRole& server) {
  std::vector<nodes::RestoredObject> objects(saved.objects.size());
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const SavedObject& object = saved.objects[i];
    objects[i].id = ObjectId::of(object.number, object.generation);
    objects[i].spec = {object.number,       ShapeId(object.shape), static_cast<Category>(object.category),
                       object.layer,        object.group,          object.enabled != 0,
                       UserId(object.user), object.user_data,      object.pose};
    objects[i].state = saved.states.data() + i * saved.state_bytes;
  }
  std::vector<Contact> contacts(saved.contacts.size());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const SavedContact& contact = saved.contacts[i];
    contacts[i].a = contact.a;
    contacts[i].b = contact.b;
    contacts[i].phase = static_cast<Phase>(contact.phase);
    contacts[i].depth = contact.depth;
    contacts[i].normal = contact.normal;
    contacts[i].toi = contact.toi;
    contacts[i].point = contact.point;
  }
  server.restore(objects, saved.state_bytes, contacts);
}

}  // namespace ringfence::facade
