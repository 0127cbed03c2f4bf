#include "reference/frame_check.hpp"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "base/floating_point.hpp"
#include "base/parallel.hpp"
#include "reference/depth_ranks.hpp"
#include "reference/exact_contact.hpp"

namespace ringfence::reference {
namespace {

std::pair<ObjectNumber, ObjectNumber> key(const Contact& c) { return {c.a, c.b}; }

/// Indices of two objects; the one with the lower number is first.
struct ObjectPair {
  std::uint32_t a, b;
};

class FrameCheck {
 public:
  FrameCheck(std::uint64_t frame, const Shapes& shapes, std::span<const FrameObject> objects,
             std::span<const std::uint32_t> layer_masks, std::span<const Contact> contacts,
             std::size_t deepest_contacts, const Tolerance& tolerance)
      : frame_(frame),
        shapes_(shapes),
        objects_(objects),
        layer_masks_(layer_masks),
        contacts_(contacts),
        deepest_contacts_(deepest_contacts),
        tolerance_(tolerance) {
    for (std::uint32_t i = 0; i < objects.size(); ++i) index_of_.emplace(objects[i].number, i);
  }

  std::vector<Difference> run() {
    check_records();
    check_pairs();
    std::stable_sort(differences_.begin(), differences_.end(), [](const auto& p, const auto& q) {
      return std::pair{p.a, p.b} < std::pair{q.a, q.b};
    });
    return std::move(differences_);
  }

 private:
  void report(ObjectNumber a, ObjectNumber b, const std::string& what) {
    differences_.push_back(
        {a, b,
         "frame " + std::to_string(frame_) + ": pair " + std::to_string(a) + "-" + std::to_string(b) + " " + what});
  }

  const PreparedShape& shape_of(std::uint32_t object) const { return shapes_[objects_[object].shape]; }

  std::string kinds(const ObjectPair& pair) const {
    return std::string("(") + name_of(shape_of(pair.a).kind) + ", " + name_of(shape_of(pair.b).kind) + ") ";
  }

  /// Why two present objects are never in contact; null if they may be.
  const char* exclusion_of(const FrameObject& p, const FrameObject& q) const {
    if (!layer_masks_.empty() && (layer_masks_[p.layer] >> q.layer & 1u) == 0) return "their layers do not collide";
    if (p.fixed && q.fixed) return "both are static";
    if (p.group != 0 && p.group == q.group) return "they are of one group";
    if (p.user != no_user_number && p.user == q.user && (p.excess || q.excess)) {
      return "they are avatars of one user, and not both among those that "
             "collide with each other";
    }
    return nullptr;
  }

  /// What is wrong in the fields of a contact that follow from its point and from the two objects; null if nothing is.
  static const char* wrong_record(const Contact& c, const FrameObject& p, const FrameObject& q) {
    if (c.object_a() != ObjectId::of(p.number, p.generation) || c.object_b() != ObjectId::of(q.number, q.generation)) {
      return "the wrong ids";
    }
    if (c.user_data_a != p.user_data || c.user_data_b != q.user_data) return "the wrong user data";
    if (c.layer_a != p.layer || c.layer_b != q.layer) return "the wrong layers";
    if (!(c.arm_a == arm(c.point, p.pose) && c.arm_b == arm(c.point, q.pose))) return "the wrong arms";
    if (c.toi != 1 || c.child_a != 0 || c.child_b != 0 || c.flags != 0) return "reserved fields that are set";
    return nullptr;
  }

  /// Checks everything in the contacts except the geometry. A contact that does not name a valid pair is not checked
  /// further.
  void check_records() {
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      const Contact& c = contacts_[i];
      if (i > 0 && key(c) < key(contacts_[i - 1])) report(c.a, c.b, "out of order");
      if (c.phase == Phase::end) report(c.a, c.b, "has phase end among the current contacts");
      if (c.a >= c.b) {
        report(c.a, c.b, "has a > b");
        continue;
      }
      const auto a = index_of_.find(c.a), b = index_of_.find(c.b);
      if (a == index_of_.end() || b == index_of_.end()) {
        report(c.a, c.b, "names an unknown object");
        continue;
      }
      const FrameObject &p = objects_[a->second], &q = objects_[b->second];
      const ObjectPair pair{a->second, b->second};
      if (!p.present || !q.present) {
        report(c.a, c.b, kinds(pair) + "extra: one of the two is absent");
      } else if (const char* const exclusion = exclusion_of(p, q)) {
        report(c.a, c.b, kinds(pair) + "extra: " + exclusion);
      } else {
        if (const char* const wrong = wrong_record(c, p, q)) report(c.a, c.b, kinds(pair) + "has " + wrong);
        claimed_.push_back(&c);
      }
    }
    std::stable_sort(claimed_.begin(), claimed_.end(), [](const auto* p, const auto* q) { return key(*p) < key(*q); });
    const auto twice = [](const auto* p, const auto* q) { return key(*p) == key(*q); };
    for (auto i = claimed_.begin(); (i = std::adjacent_find(i, claimed_.end(), twice)) != claimed_.end(); ++i) {
      report((*i)->a, (*i)->b, "is listed twice");
    }
    claimed_.erase(std::unique(claimed_.begin(), claimed_.end(), twice), claimed_.end());
  }

  /// Checks the geometry: runs the exact test for all candidate pairs and for all pairs of the contacts.
  void check_pairs() {
    std::vector<ObjectPair> pairs = candidate_pairs();
    for (const Contact* c : claimed_) pairs.push_back({index_of_.at(c->a), index_of_.at(c->b)});
    const auto numbers = [&](const ObjectPair& p) { return std::pair{objects_[p.a].number, objects_[p.b].number}; };
    std::sort(pairs.begin(), pairs.end(), [&](const auto& p, const auto& q) { return numbers(p) < numbers(q); });
    pairs.erase(
        std::unique(pairs.begin(), pairs.end(), [&](const auto& p, const auto& q) { return numbers(p) == numbers(q); }),
        pairs.end());

    std::vector<const Contact*> claims(pairs.size());
    std::vector<std::string> wrong(pairs.size());
    const auto check = [&](std::size_t i) {
      const auto& [a, b] = pairs[i];
      const auto found = std::lower_bound(claimed_.begin(), claimed_.end(), numbers(pairs[i]),
                                          [](const Contact* c, const auto& n) { return key(*c) < n; });
      claims[i] = found != claimed_.end() && key(**found) == numbers(pairs[i]) ? *found : nullptr;
      wrong[i] = describe_error(shape_of(a), objects_[a].pose, shape_of(b), objects_[b].pose, claims[i], tolerance_);
    };
    base::parallel_for(pairs.size(), 1, check);
    if (deepest_contacts_ != 0) check_ranks(pairs, claims, wrong);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto [a, b] = numbers(pairs[i]);
      if (!wrong[i].empty()) report(a, b, kinds(pairs[i]) + wrong[i]);
    }
  }

  /// Corrects what check_pairs() found, for a list that is limited.
  void check_ranks(const std::vector<ObjectPair>& pairs, const std::vector<const Contact*>& claims,
                   std::vector<std::string>& wrong) const {
    std::vector<DepthBounds> bounds(pairs.size());
    base::parallel_for(pairs.size(), 1, [&](std::size_t i) {
      const FrameObject &p = objects_[pairs[i].a], &q = objects_[pairs[i].b];
      const auto [least, most] =
          claims[i] != nullptr && wrong[i].empty()
              ? std::pair<double, double>(claims[i]->depth, claims[i]->depth)
              : depth_bounds(shape_of(pairs[i].a), p.pose, shape_of(pairs[i].b), q.pose, tolerance_);
      bounds[i] = {p.number, q.number, least, most};
    });
    const std::string which = "among the " + std::to_string(deepest_contacts_) + " deepest of ";
    std::vector<DepthBounds> possible;
    std::copy_if(bounds.begin(), bounds.end(), std::back_inserter(possible), [](const auto& b) { return b.most >= 0; });
    const DepthRanks ranks(possible, deepest_contacts_);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (claims[i] != nullptr && wrong[i].empty() && !ranks.may_be_listed(bounds[i])) {
        wrong[i] = "extra: not " + which + "either object";
      } else if (claims[i] == nullptr && !wrong[i].empty()) {
        wrong[i] = ranks.must_be_listed(bounds[i]) ? wrong[i] + ", " + which + "an object" : std::string();
      }
    }
  }

  /// All pairs of present objects that may be in contact and whose boxes touch. Found by a sweep along x.
  std::vector<ObjectPair> candidate_pairs() const {
    // Coordinates are relative to the first object, so that no precision is lost far from the origin.
    std::vector<Extents> boxes(objects_.size());
    std::vector<std::uint32_t> order;
    Vector origin;
    for (std::uint32_t i = 0; i < objects_.size(); ++i) {
      if (!objects_[i].present) continue;
      if (order.empty()) origin = Vector(objects_[i].pose.position);
      order.push_back(i);
    }
    const auto bound = [&](std::size_t k) {
      const FrameObject& o = objects_[order[k]];
      const PreparedShape& shape = shapes_[o.shape];
      Extents& box = boxes[order[k]];
      box = extents_of(shape, {rotation_of(o.pose.orientation), Vector(o.pose.position) - origin});
      const double width = band(shape, shape, tolerance_);
      box.lower -= {width, width, width};
      box.upper += {width, width, width};
    };
    base::parallel_for(order.size(), 1, bound);
    std::sort(order.begin(), order.end(), [&](auto p, auto q) { return boxes[p].lower.x < boxes[q].lower.x; });

    std::vector<ObjectPair> out;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const Extents& p = boxes[order[i]];
      for (std::size_t j = i + 1; j < order.size(); ++j) {
        const Extents& q = boxes[order[j]];
        if (q.lower.x > p.upper.x) break;
        if (q.lower.y > p.upper.y || p.lower.y > q.upper.y || q.lower.z > p.upper.z || p.lower.z > q.upper.z) continue;
        const FrameObject &a = objects_[order[i]], &b = objects_[order[j]];
        if (exclusion_of(a, b) != nullptr) continue;
        out.push_back(a.number < b.number ? ObjectPair{order[i], order[j]} : ObjectPair{order[j], order[i]});
      }
    }
    return out;
  }

  std::uint64_t frame_;
  const Shapes& shapes_;
  std::span<const FrameObject> objects_;
  std::span<const std::uint32_t> layer_masks_;
  std::span<const Contact> contacts_;
  std::size_t deepest_contacts_;
  Tolerance tolerance_;
  std::unordered_map<ObjectNumber, std::uint32_t> index_of_;
  std::vector<const Contact*> claimed_;  // the contacts that name a valid pair, sorted by (a, b), each pair once
  std::vector<Difference> differences_;
};

}  // namespace

void mark_excess(std::span<FrameObject> objects, std::size_t colliding) {
  for (FrameObject& object : objects) {
    const auto is_lower = [&](const FrameObject& other) {
      return other.user == object.user && other.number < object.number;
    };
    object.excess = object.user != no_user_number && colliding != 0 &&
                    static_cast<std::size_t>(std::count_if(objects.begin(), objects.end(), is_lower)) >= colliding;
  }
}

std::vector<Difference> check_frame(std::uint64_t frame, const Shapes& shapes, std::span<const FrameObject> objects,
                                    std::span<const std::uint32_t> layer_masks, std::span<const Contact> contacts,
                                    std::size_t deepest_contacts, const Tolerance& tolerance,
                                    std::size_t max_differences) {
  const base::DefaultFloatingPoint floating_point;
  auto out = FrameCheck(frame, shapes, objects, layer_masks, contacts, deepest_contacts, tolerance).run();
  if (out.size() > max_differences) out.resize(max_differences);
  return out;
}

std::vector<Difference> check_phases(std::uint64_t frame, std::span<const Contact> before, std::span<const Contact> now,
                                     std::span<const Contact> ended) {
  const base::DefaultFloatingPoint floating_point;
  std::vector<Difference> out;
  const auto report = [&](const Contact& c, const char* what) {
    out.push_back(
        {c.a, c.b,
         "frame " + std::to_string(frame) + ": pair " + std::to_string(c.a) + "-" + std::to_string(c.b) + " " + what});
  };
  const auto by_key = [](const Contact& p, const Contact& q) { return key(p) < key(q); };
  std::vector<Contact> ends(ended.begin(), ended.end());
  std::stable_sort(ends.begin(), ends.end(), by_key);

  for (const Contact& c : now) {
    const bool was = std::binary_search(before.begin(), before.end(), c, by_key);
    if (was && c.phase != Phase::persist) report(c, "was in contact before, but its phase is not persist");
    if (!was && c.phase != Phase::begin) report(c, "was not in contact before, but its phase is not begin");
  }
  for (const Contact& c : before) {
    if (std::binary_search(now.begin(), now.end(), c, by_key)) continue;
    const auto [first, last] = std::equal_range(ends.begin(), ends.end(), c, by_key);
    if (first == last) {
      report(c, "is no longer in contact, but has no end record");
    } else if (!(first->depth == c.depth && first->normal == c.normal && first->point == c.point &&
                 first->arm_a == c.arm_a && first->arm_b == c.arm_b && first->object_a() == c.object_a() &&
                 first->object_b() == c.object_b() && first->user_data_a == c.user_data_a &&
                 first->user_data_b == c.user_data_b && first->layer_a == c.layer_a && first->layer_b == c.layer_b)) {
      report(c, "has an end record that differs from its last contact");
    }
  }
  for (std::size_t i = 0; i < ends.size(); ++i) {
    if (ends[i].phase != Phase::end) report(ends[i], "is among the ended contacts with another phase");
    if (i > 0 && key(ends[i]) == key(ends[i - 1])) report(ends[i], "ends twice");
    if (!std::binary_search(before.begin(), before.end(), ends[i], by_key)) {
      report(ends[i], "ends without having been in contact");
    } else if (std::binary_search(now.begin(), now.end(), ends[i], by_key)) {
      report(ends[i], "has an end record, but is still in contact");
    }
  }
  return out;
}

}  // namespace ringfence::reference
