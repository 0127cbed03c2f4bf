#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace ringfence::tools {

/// A point of a drawing in pixels: x to the right, y down.
struct Point {
  double x = 0, y = 0;
  bool operator==(const Point&) const = default;
};

/// A rectangle with sides along the axes.
struct Rectangle {
  Point min, max;
  bool operator==(const Rectangle&) const = default;
};

/// What a mark of a picture stands for. The palette has a colour for each of them.
enum class Meaning : std::uint8_t {
  page,
  text,
  faint_text,
  border,  ///< of the map
  region,  ///< area of a CD node; by hue
  active,  ///< by the hue of the node whose region the object is in
  non_active,
  avatar,
  fixed,
  fixed_edge,
  contact,
};

/// A colour by its meaning.
struct Ink {
  Meaning meaning = Meaning::page;
  std::uint8_t hue = 0;  ///< index into the colours of CD nodes, or neutral_hue; 0 for meanings without a node
  bool operator==(const Ink&) const = default;
};

/// How the inside and the edge of a mark are painted; without an ink it is not.
struct Style {
  std::optional<Ink> fill;
  std::optional<Ink> edge;
  double edge_width = 1;
  bool operator==(const Style&) const = default;
};

/// A closed polygon.
struct Polygon {
  std::vector<Point> points;
  Style style;
};

struct Circle {
  Point centre;
  double radius = 0;
  Style style;
};

/// Filled circles of one size, for marks that are too many or too small for a shape each.
struct Dots {
  std::vector<Point> centres;
  double radius = 1;
  Ink ink;
};

struct Lines {
  std::vector<std::pair<Point, Point>> lines;
  Ink ink;
  double width = 1;
};

struct Text {
  enum class Anchor : std::uint8_t { start, middle, end };
  Point at;  ///< on the baseline
  std::string text;
  double size = 13;
  Ink ink{Meaning::text};
  Anchor anchor = Anchor::start;
  bool bold = false;
  bool halo = false;  ///< has an edge of the page's colour, so that it can be read on marks
};

using Mark = std::variant<Polygon, Circle, Dots, Lines, Text>;

/// Marks in the order of painting.
struct Layer {
  std::optional<Rectangle> clip;
  /// Edges of filled polygons are not smoothed, so that areas that share an edge leave no gap.
  bool crisp = false;
  std::vector<Mark> marks;
};

/// A picture as marks, independent of file format and colours.
struct Drawing {
  double width = 0, height = 0;
  std::string title;  ///< for readers who do not see the picture
  std::vector<Layer> layers;
};

}  // namespace ringfence::tools
