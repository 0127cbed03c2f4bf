#include "picture/svg.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

constexpr const char* font = "'DejaVu Sans', Verdana, Helvetica, Arial, sans-serif";

std::int64_t tenths(double value) { return std::llround(value * 10); }

/// A number of tenths without needless characters: 12, -3.5, .5.
std::string number(std::int64_t value) {
  const std::int64_t whole = std::abs(value) / 10, rest = std::abs(value) % 10;
  const char* const sign = value < 0 ? "-" : "";
  if (rest == 0) return fmt::format("{}{}", sign, whole);
  return whole == 0 ? fmt::format("{}.{}", sign, rest) : fmt::format("{}{}.{}", sign, whole, rest);
}
std::string number(double value) { return number(tenths(value)); }

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// Class names of inks and styles: a letter and a number in the order of their first use. There are few of them.
template <class Key>
class ClassNames {
 public:
  explicit ClassNames(char prefix) : prefix_(prefix) {}
  std::string of(const Key& key) {
    const auto at = std::find(keys_.begin(), keys_.end(), key);
    const auto number = at - keys_.begin();
    if (at == keys_.end()) keys_.push_back(key);
    return fmt::format("{}{}", prefix_, number);
  }
  /// Calls visit(class name, key) for all.
  template <class Visit>
  void each(Visit visit) const {
    for (std::size_t i = 0; i < keys_.size(); ++i) visit(fmt::format(".{}{}", prefix_, i), keys_[i]);
  }

 private:
  char prefix_;
  std::vector<Key> keys_;
};

class Writer {
 public:
  std::string write(const Drawing& drawing, PictureColors colors);

 private:
  void add(const Polygon& polygon);
  void add(const Circle& circle);
  void add(const Dots& dots);
  void add(const Lines& lines);
  void add(const Text& text);
  void move_to(Point to, std::string& path);
  std::string style_sheet(PictureColors colors) const;
  std::string color_rules(bool dark) const;

  std::string body_;
  ClassNames<Style> styles_{'s'};
  ClassNames<Ink> dot_inks_{'d'}, line_inks_{'l'}, text_inks_{'t'};
  std::int64_t x_ = 0, y_ = 0;  ///< current point of the path, tenths
};

// Relative coordinates are shorter. They are differences of rounded coordinates, so errors do not add up.
void Writer::move_to(Point to, std::string& path) {
  const std::int64_t x = tenths(to.x), y = tenths(to.y);
  const std::string dx = number(x - x_), dy = number(y - y_);
  const char last = path.back();
  if (last != 'm' && last != 'l' && dx.front() != '-') path += ' ';
  path += dx;
  if (dy.front() != '-') path += ' ';
  path += dy;
  x_ = x;
  y_ = y;
}

void Writer::add(const Polygon& polygon) {
  std::string path = "m";
  x_ = y_ = 0;
  move_to(polygon.points.front(), path);
  path += 'l';
  for (std::size_t i = 1; i < polygon.points.size(); ++i) move_to(polygon.points[i], path);
  body_ += fmt::format("<path class=\"{}\" d=\"{}z\"/>\n", styles_.of(polygon.style), path);
}

void Writer::add(const Circle& circle) {
  body_ += fmt::format("<circle class=\"{}\" cx=\"{}\" cy=\"{}\" r=\"{}\"/>\n", styles_.of(circle.style),
                       number(circle.centre.x), number(circle.centre.y), number(circle.radius));
}

// A line of no length with round ends is a dot.
void Writer::add(const Dots& dots) {
  if (dots.centres.empty()) return;
  std::string path;
  x_ = y_ = 0;
  for (const Point& centre : dots.centres) {
    path += 'm';
    move_to(centre, path);
    path += "h0";
  }
  body_ += fmt::format("<path class=\"{}\" stroke-width=\"{}\" d=\"{}\"/>\n", dot_inks_.of(dots.ink),
                       number(2 * dots.radius), path);
}

void Writer::add(const Lines& lines) {
  if (lines.lines.empty()) return;
  std::string path;
  x_ = y_ = 0;
  for (const auto& [from, to] : lines.lines) {
    path += 'm';
    move_to(from, path);
    path += 'l';
    move_to(to, path);
  }
  body_ += fmt::format("<path class=\"{}\" stroke-width=\"{}\" d=\"{}\"/>\n", line_inks_.of(lines.ink),
                       number(lines.width), path);
}

void Writer::add(const Text& text) {
  constexpr const char* anchors[] = {"start", "middle", "end"};
  body_ += fmt::format("<text class=\"{}{}\" x=\"{}\" y=\"{}\" font-size=\"{}\"{}{}>{}</text>\n",
                       text_inks_.of(text.ink), text.halo ? " halo" : "", number(text.at.x), number(text.at.y),
                       number(text.size), text.bold ? " font-weight=\"bold\"" : "",
                       text.anchor == Text::Anchor::start
                           ? ""
                           : fmt::format(" text-anchor=\"{}\"", anchors[static_cast<std::size_t>(text.anchor)]),
                       escaped(text.text));
}

std::string Writer::color_rules(bool dark) const {
  const auto paint = [dark](const char* what, const std::optional<Ink>& ink) {
    if (!ink) return fmt::format("{}:none", what);
    const Color color = color_of(*ink, dark);
    std::string rule = fmt::format("{}:#{:02x}{:02x}{:02x}", what, color.red, color.green, color.blue);
    if (color.opacity < 1) rule += fmt::format(";{}-opacity:{}", what, color.opacity);
    return rule;
  };
  std::string rules =
      fmt::format(".page{{{}}}.halo{{{}}}\n", paint("fill", Ink{Meaning::page}), paint("stroke", Ink{Meaning::page}));
  styles_.each([&](const std::string& name, const Style& style) {
    rules += fmt::format("{}{{{};{}}}\n", name, paint("fill", style.fill), paint("stroke", style.edge));
  });
  const auto add = [&](const char* what) {
    return [&, what](const std::string& name, Ink ink) { rules += fmt::format("{}{{{}}}\n", name, paint(what, ink)); };
  };
  dot_inks_.each(add("stroke"));
  line_inks_.each(add("stroke"));
  text_inks_.each(add("fill"));
  return rules;
}

std::string Writer::style_sheet(PictureColors colors) const {
  std::string sheet = ".halo{paint-order:stroke;stroke-width:3px;stroke-linejoin:round}\n";
  styles_.each([&](const std::string& name, const Style& style) {
    if (style.edge) sheet += fmt::format("{}{{stroke-width:{}px}}\n", name, style.edge_width);
  });
  dot_inks_.each([&](const std::string& name, Ink) { sheet += name + "{stroke-linecap:round}\n"; });
  sheet += color_rules(colors == PictureColors::dark);
  if (colors == PictureColors::automatic)
    sheet += fmt::format("@media (prefers-color-scheme:dark){{\n{}}}\n", color_rules(true));
  return sheet;
}

std::string Writer::write(const Drawing& drawing, PictureColors colors) {
  std::string clips;
  std::size_t clipped = 0;
  for (const Layer& layer : drawing.layers) {
    std::string group = "<g";
    if (layer.clip) {
      const Rectangle& clip = *layer.clip;
      clips += fmt::format("<clipPath id=\"clip{}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>\n",
                           clipped, number(clip.min.x), number(clip.min.y), number(clip.max.x - clip.min.x),
                           number(clip.max.y - clip.min.y));
      group += fmt::format(" clip-path=\"url(#clip{})\"", clipped++);
    }
    if (layer.crisp) group += " shape-rendering=\"crispEdges\"";
    body_ += group + ">\n";
    for (const Mark& mark : layer.marks) std::visit([this](const auto& each) { add(each); }, mark);
    body_ += "</g>\n";
  }
  const std::string width = number(drawing.width), height = number(drawing.height);
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" "
      "font-family=\"{2}\">\n<title>{3}</title>\n<style>\n{4}</style>\n{5}"
      "<rect class=\"page\" width=\"{0}\" height=\"{1}\"/>\n{6}</svg>\n",
      width, height, font, escaped(drawing.title), style_sheet(colors), clips, body_);
}

}  // namespace

std::string to_svg(const Drawing& drawing, PictureColors colors) { return Writer().write(drawing, colors); }

}  // namespace ringfence::tools
