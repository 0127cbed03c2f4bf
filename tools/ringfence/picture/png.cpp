#include "picture/png.hpp"

#include <cmath>
#include <memory>
#include <numbers>

#include <cairo.h>
#include <fmt/format.h>

#include "exit_code.hpp"

namespace ringfence::tools {
namespace {

constexpr double pixels_per_pixel = 2;
constexpr const char* font = "DejaVu Sans";

using Surface =
    std::unique_ptr<cairo_surface_t, decltype([](cairo_surface_t* surface) { cairo_surface_destroy(surface); })>;
using Context = std::unique_ptr<cairo_t, decltype([](cairo_t* context) { cairo_destroy(context); })>;

void require(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw IncompleteError(fmt::format("picture: cannot be drawn: {}", cairo_status_to_string(status)));
}

class Painter {
 public:
  Painter(cairo_t* cairo, bool dark) : cairo_(cairo), dark_(dark) {}

  void paint_page() {
    set_ink({Meaning::page});
    cairo_paint(cairo_);
  }

  void paint(const Layer& layer) {
    cairo_save(cairo_);
    if (layer.clip) {
      const auto& [min, max] = *layer.clip;
      cairo_rectangle(cairo_, min.x, min.y, max.x - min.x, max.y - min.y);
      cairo_clip(cairo_);
    }
    cairo_set_antialias(cairo_, layer.crisp ? CAIRO_ANTIALIAS_NONE : CAIRO_ANTIALIAS_GOOD);
    for (const Mark& mark : layer.marks) std::visit([this](const auto& each) { add(each); }, mark);
    cairo_restore(cairo_);
  }

 private:
  void set_ink(Ink ink) {
    const Color color = color_of(ink, dark_);
    cairo_set_source_rgba(cairo_, color.red / 255.0, color.green / 255.0, color.blue / 255.0, color.opacity);
  }

  /// Paints the current path.
  void apply(const Style& style) {
    if (style.fill) {
      set_ink(*style.fill);
      cairo_fill_preserve(cairo_);
    }
    if (style.edge) {
      set_ink(*style.edge);
      cairo_set_line_width(cairo_, style.edge_width);
      cairo_stroke_preserve(cairo_);
    }
    cairo_new_path(cairo_);
  }

  void add(const Polygon& polygon) {
    for (const Point& point : polygon.points) cairo_line_to(cairo_, point.x, point.y);
    cairo_close_path(cairo_);
    apply(polygon.style);
  }

  void add_circle(Point centre, double radius) {
    cairo_new_sub_path(cairo_);
    cairo_arc(cairo_, centre.x, centre.y, radius, 0, 2 * std::numbers::pi);
  }

  void add(const Circle& circle) {
    add_circle(circle.centre, circle.radius);
    apply(circle.style);
  }

  void add(const Dots& dots) {
    set_ink(dots.ink);
    for (const Point& centre : dots.centres) {
      add_circle(centre, dots.radius);
      cairo_fill(cairo_);
    }
  }

  void add(const Lines& lines) {
    for (const auto& [from, to] : lines.lines) {
      cairo_move_to(cairo_, from.x, from.y);
      cairo_line_to(cairo_, to.x, to.y);
    }
    set_ink(lines.ink);
    cairo_set_line_width(cairo_, lines.width);
    cairo_stroke(cairo_);
  }

  void add(const Text& text) {
    cairo_select_font_face(cairo_, font, CAIRO_FONT_SLANT_NORMAL,
                           text.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo_, text.size);
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_, text.text.c_str(), &extents);
    const double before = text.anchor == Text::Anchor::start ? 0
                          : text.anchor == Text::Anchor::end ? extents.x_advance
                                                             : extents.x_advance / 2;
    cairo_move_to(cairo_, text.at.x - before, text.at.y);
    cairo_text_path(cairo_, text.text.c_str());
    if (text.halo) {
      set_ink({Meaning::page});
      cairo_set_line_width(cairo_, 3);
      cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
      cairo_stroke_preserve(cairo_);
      cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_MITER);
    }
    set_ink(text.ink);
    cairo_fill(cairo_);
  }

  cairo_t* cairo_;
  bool dark_;
};

cairo_status_t append(void* bytes, const unsigned char* more, unsigned length) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(more), length);
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

}  // namespace ringfence::tools

using namespace ringfence::tools;

void ringfence_to_png(const Drawing& drawing, PictureColors colors, std::string& bytes) {
  const auto pixels = [](double length) { return static_cast<int>(std::ceil(length * pixels_per_pixel)); };
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, pixels(drawing.width), pixels(drawing.height)));
  require(cairo_surface_status(surface.get()));
  const Context context(cairo_create(surface.get()));
  cairo_scale(context.get(), pixels_per_pixel, pixels_per_pixel);
  Painter painter(context.get(), colors == PictureColors::dark);
  painter.paint_page();
  for (const Layer& layer : drawing.layers) painter.paint(layer);
  require(cairo_status(context.get()));
  require(cairo_surface_write_to_png_stream(surface.get(), append, &bytes));
}
