#include "picture/world_picture.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "picture/outline.hpp"
#include "picture/region_plan.hpp"
#include "picture/styles.hpp"
#include "picture/surroundings.hpp"
#include "picture/view.hpp"

namespace ringfence::tools {
namespace {

constexpr double smallest_outline = 1.6;  // radius in pixels; smaller objects are dots
constexpr std::size_t most_contacts_with_edge = 2000;

class WorldPicture {
 public:
  explicit WorldPicture(const World& world)
      : world_(world), view_(world.config().bounds_min, world.config().bounds_max), plan_(world) {}

  Drawing draw(const std::string& contact) && {
    add_regions();
    add_objects();
    add_contacts();
    add_region_labels();
    add_surroundings(drawing_, world_, view_, shown_, contact);
    return std::move(drawing_);
  }

 private:
  Layer& add_layer() { return drawing_.layers.emplace_back(); }
  Point corner(std::size_t x, std::size_t y) const;
  Rectangle rectangle(const RegionPlan::Area& area) const;
  void add_area(const RegionPlan::Area& area, Layer& fills, Layer& stripes) const;
  void add_regions();
  void add_objects();
  void add_object(const ObjectView& object, Layer& layer, std::vector<Dots>& dots);
  void add_contacts();
  void add_region_labels();

  const World& world_;
  View view_;
  RegionPlan plan_;
  Drawing drawing_;
  Shown shown_;
};

Point WorldPicture::corner(std::size_t x, std::size_t y) const {
  const auto share = [](std::size_t at) { return static_cast<double>(at) / RegionPlan::side; };
  return {view_.map().min.x + view_.width() * share(x), view_.map().max.y - view_.height() * share(y)};
}

Rectangle WorldPicture::rectangle(const RegionPlan::Area& area) const {
  return {corner(area.x, area.end_y), corner(area.end_x, area.y)};
}

/// The part of a convex polygon where `value` is at least 0. `value` is linear.
template <class Value>
std::vector<Point> clip(const std::vector<Point>& polygon, Value value) {
  std::vector<Point> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Point &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
    const double at_p = value(p), at_q = value(q);
    if (at_p >= 0) kept.push_back(p);
    if ((at_p >= 0) != (at_q >= 0)) {
      const double share = at_p / (at_p - at_q);
      kept.push_back({p.x + (q.x - p.x) * share, p.y + (q.y - p.y) * share});
    }
  }
  return kept;
}

// Where nodes own parts of a column above each other, their colours are diagonal stripes.
void WorldPicture::add_area(const RegionPlan::Area& area, Layer& fills, Layer& stripes) const {
  constexpr double stripe = 9;  // distance along x + y
  const std::vector<NodeId>& owners = plan_.owners()[area.owners];
  const auto style_of_node = [](NodeId node) { return Style{Ink{Meaning::region, hue_of(node)}, {}, 1}; };
  if (owners.empty()) return;
  const Polygon whole = polygon_of(rectangle(area), style_of_node(owners.front()));
  fills.marks.push_back(whole);
  const auto count = static_cast<double>(owners.size());
  const Rectangle r = rectangle(area);
  for (std::size_t i = 1; i < owners.size(); ++i) {
    const double period = stripe * count, first = std::floor((r.min.x + r.min.y) / period) * period;
    for (double from = first + stripe * static_cast<double>(i); from < r.max.x + r.max.y; from += period) {
      auto band = clip(whole.points, [&](const Point& p) { return p.x + p.y - from; });
      band = clip(band, [&](const Point& p) { return from + stripe - p.x - p.y; });
      if (band.size() >= 3) stripes.marks.push_back(Polygon{std::move(band), style_of_node(owners[i])});
    }
  }
}

void WorldPicture::add_regions() {
  Layer fills, stripes, edges;
  fills.crisp = true;
  for (const RegionPlan::Area& area : plan_.areas()) add_area(area, fills, stripes);
  Lines lines{{}, Ink{Meaning::border}, 1};
  for (const auto& [x, y, end_x, end_y] : plan_.boundaries())
    lines.lines.emplace_back(corner(x, y), corner(end_x, end_y));
  edges.marks.push_back(std::move(lines));
  for (Layer* layer : {&fills, &stripes, &edges}) drawing_.layers.push_back(std::move(*layer));
}

// From the lowest to the highest, as they are seen from above; static objects first, because many are the ground.
void WorldPicture::add_objects() {
  std::vector<ObjectView> objects = world_.objects();
  std::erase_if(objects, [](const ObjectView& object) { return !object.spec.enabled; });
  const auto is_static = [](const ObjectView& object) { return object.spec.category == Category::fixed; };
  std::stable_sort(objects.begin(), objects.end(), [&](const ObjectView& p, const ObjectView& q) {
    if (is_static(p) != is_static(q)) return is_static(p);
    return p.spec.pose.position.z < q.spec.pose.position.z;
  });
  Layer& layer = add_layer();
  layer.clip = view_.map();
  std::vector<Dots> dots;  // by ink
  for (const ObjectView& object : objects) add_object(object, layer, dots);
  for (Dots& each : dots) layer.marks.push_back(std::move(each));
}

void WorldPicture::add_object(const ObjectView& object, Layer& layer, std::vector<Dots>& dots) {
  const ObjectSpec& spec = object.spec;
  ++shown_.objects[static_cast<std::size_t>(spec.category)];
  const Outline outline = outline_of(world_.shape(spec.shape), spec.pose.orientation);
  const Point centre = view_(spec.pose.position);
  const double radius = outline.radius * view_.scale();
  const Rectangle& map = view_.map();
  if (!(centre.x > map.min.x - radius && centre.x < map.max.x + radius && centre.y > map.min.y - radius &&
        centre.y < map.max.y + radius)) {
    ++shown_.outside;
    return;
  }
  const std::uint8_t hue = hue_of(world_.node_at(spec.pose.position).value_or(NodeId(0)));
  if (radius < smallest_outline) {
    const Ink ink = ink_of(spec.category, hue);
    auto same = std::find_if(dots.begin(), dots.end(), [&](const Dots& each) { return each.ink == ink; });
    if (same == dots.end()) same = dots.insert(dots.end(), Dots{{}, 1, ink});
    same->centres.push_back(centre);
  } else if (outline.corners.size() < 3) {
    layer.marks.emplace_back(Circle{centre, radius, style_of(spec.category, hue)});
  } else {
    Polygon polygon{{}, style_of(spec.category, hue)};
    for (const Point& corner : outline.corners)
      polygon.points.push_back({centre.x + corner.x * view_.scale(), centre.y - corner.y * view_.scale()});
    layer.marks.emplace_back(std::move(polygon));
  }
}

void WorldPicture::add_contacts() {
  const std::span<const Contact> contacts = world_.contacts();
  const auto count = static_cast<double>(std::max<std::size_t>(1, contacts.size()));
  shown_.contact_radius = std::clamp(50 / std::sqrt(count), 1.2, 5.0);
  Layer& layer = add_layer();
  layer.clip = view_.map();
  if (contacts.size() > most_contacts_with_edge) {
    Dots dots{{}, shown_.contact_radius, Ink{Meaning::contact}};
    for (const Contact& contact : contacts) dots.centres.push_back(view_(contact.point));
    layer.marks.push_back(std::move(dots));
    return;
  }
  for (const Contact& contact : contacts)
    layer.marks.push_back(Circle{view_(contact.point), shown_.contact_radius + contact_edge / 2, contact_style});
}

std::string name_of_owners(const std::vector<NodeId>& owners) {
  std::string numbers;
  for (const NodeId node : owners) numbers += fmt::format("{}{}", numbers.empty() ? "" : ", ", node.number());
  return fmt::format("{} {}", owners.size() == 1 ? "node" : "nodes", numbers);
}

// At the top left of each region, if it has room there.
void WorldPicture::add_region_labels() {
  constexpr double size = 12, room = 8;
  const auto columns = [](double pixels, double of) {
    return static_cast<std::size_t>(std::ceil(pixels / of * RegionPlan::side));
  };
  Layer& layer = add_layer();
  for (std::size_t owners = 0; owners < plan_.owners().size(); ++owners) {
    const std::string name = name_of_owners(plan_.owners()[owners]);
    const double width = size * static_cast<double>(name.size()) * 0.7 + 2 * room, height = size + 2 * room;
    const auto area = plan_.first_area(owners, columns(width, view_.width()), columns(height, view_.height()));
    if (!area) continue;
    const Point at = rectangle(*area).min;
    layer.marks.push_back(
        Text{{at.x + room, at.y + size + room / 2}, name, size, {Meaning::text}, Text::Anchor::start, true, true});
  }
}

}  // namespace

Drawing draw_world(const World& world, const std::string& contact) { return WorldPicture(world).draw(contact); }

}  // namespace ringfence::tools
