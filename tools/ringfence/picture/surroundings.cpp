#include "picture/surroundings.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "picture/styles.hpp"

namespace ringfence::tools {
namespace {

constexpr double margin = 24, text_size = 13, heading_size = 17;
constexpr double legend_gap = 28, legend_width = 172, row_height = 22, indent = 28;
constexpr std::size_t most_nodes_in_legend = 12;

Text text_at(Point at, std::string words, Meaning meaning = Meaning::text) {
  return {at, std::move(words), text_size, {meaning}, Text::Anchor::start, false, false};
}

std::string plural(std::size_t count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

std::string length_text(double metres) {
  if (metres >= 1000) return fmt::format("{:g} km", metres / 1000);
  if (metres >= 1) return fmt::format("{:g} m", metres);
  return metres >= 0.01 ? fmt::format("{:g} cm", metres * 100) : fmt::format("{:g} mm", metres * 1000);
}

void add_scale_bar(Layer& layer, const View& view) {
  const double metres = view.bar_metres(), length = metres * view.scale();
  const double x = view.map().min.x, y = view.map().max.y + 24, end = x + length;
  layer.marks.emplace_back(
      Lines{{{{x, y}, {end, y}}, {{x, y - 5}, {x, y + 5}}, {{end, y - 5}, {end, y + 5}}}, Ink{Meaning::text}, 1.4});
  layer.marks.emplace_back(text_at({end + 10, y + 4.5}, length_text(metres)));
}

/// A legend, written from top to bottom.
class Legend {
 public:
  Legend(Layer& layer, Point at) : layer_(layer), x_(at.x), y_(at.y - first_gap) {}

  void add_heading(const char* words) {
    y_ += section_gap;
    Text heading = text_at({x_, y_}, words);
    heading.bold = true;
    layer_.marks.emplace_back(std::move(heading));
    y_ += row_height;
  }
  void add_row(const std::string& words, const std::string& count) {
    layer_.marks.emplace_back(text_at({x_ + indent, y_}, words));
    Text number = text_at({x_ + legend_width, y_}, count, Meaning::faint_text);
    number.anchor = Text::Anchor::end;
    if (!count.empty()) layer_.marks.emplace_back(std::move(number));
    y_ += row_height;
  }
  /// A row with a circle before it.
  void add_row(const std::string& words, std::size_t count, double radius, const Style& style) {
    layer_.marks.emplace_back(Circle{sample(), radius, style});
    add_row(words, fmt::format("{}", count));
  }
  void add_node(const NodeReport& node) {
    const Point at = sample();
    const std::uint8_t hue = hue_of(node.id);
    const Style style{Ink{Meaning::region, hue}, Ink{Meaning::active, hue}, 1};
    layer_.marks.emplace_back(polygon_of({{at.x - 10, at.y - 7}, {at.x + 10, at.y + 7}}, style));
    add_row(fmt::format("node {}", node.id.number()), fmt::format("{} pairs", node.tested));
  }
  double end() const { return y_ - row_height; }

 private:
  static constexpr double section_gap = 16, first_gap = 4;
  Point sample() const { return {x_ + 10, y_ - 4.5}; }

  Layer& layer_;
  double x_, y_;  ///< start of the next row's baseline
};

/// Returns where the legend ends.
double add_legend(Layer& layer, const World& world, Point at, const Shown& shown, const std::string& contact) {
  Legend legend(layer, at);
  legend.add_heading("regions");
  const std::vector<NodeReport>& nodes = world.report().nodes;
  for (std::size_t i = 0; i < std::min(nodes.size(), most_nodes_in_legend); ++i) legend.add_node(nodes[i]);
  if (nodes.size() > most_nodes_in_legend)
    legend.add_row(fmt::format("and {} more", nodes.size() - most_nodes_in_legend), "");

  legend.add_heading("objects");
  for (std::size_t i = 0; i < category_count; ++i) {
    const auto category = static_cast<Category>(i);
    if (shown.objects[i] != 0) legend.add_row(name_of(category), shown.objects[i], 6, style_of(category, neutral_hue));
  }
  if (shown.outside != 0) legend.add_row("outside the bounds", fmt::format("{}", shown.outside));

  legend.add_heading("contacts");
  legend.add_row(contact, world.contacts().size(), std::max(shown.contact_radius, 3.0), contact_style);
  return legend.end();
}

}  // namespace

void add_surroundings(Drawing& drawing, const World& world, const View& view, const Shown& shown,
                      const std::string& contact) {
  Layer& layer = drawing.layers.emplace_back();
  const Rectangle& map = view.map();
  layer.marks.emplace_back(polygon_of(map, {{}, Ink{Meaning::border}, 1}));
  std::size_t objects = 0;
  for (const std::size_t count : shown.objects) objects += count;
  const std::string words = fmt::format("{}, {}, {}", plural(objects, "object"),
                                        plural(world.contacts().size(), "contact"), plural(world.nodes(), "CD node"));
  Text heading = text_at({margin, 34}, words);
  heading.size = heading_size;
  heading.bold = true;
  layer.marks.emplace_back(std::move(heading));
  const std::string when = world.frames() == 0 ? "before the first frame" : fmt::format("frame {}", world.frames() - 1);
  layer.marks.emplace_back(
      text_at({margin, 55}, when + ", seen from above: x to the right, y up", Meaning::faint_text));
  add_scale_bar(layer, view);
  const double legend_end = add_legend(layer, world, {map.max.x + legend_gap, map.min.y}, shown, contact);
  drawing.width = std::ceil(map.max.x + legend_gap + legend_width + margin);
  drawing.height = std::ceil(std::max(map.max.y + 48, legend_end + margin));
  drawing.title = fmt::format("Collision world from above: {}", words);
}

}  // namespace ringfence::tools
