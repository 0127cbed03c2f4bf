#include "picture/palette.hpp"

#include <cmath>

namespace ringfence::tools {
namespace {

constexpr Color white{255, 255, 255}, black{0, 0, 0};
constexpr Color light_page = white, dark_page{13, 17, 23};

// Blue, amber, green, purple, sky, olive, indigo, brown; grey.
constexpr Color hues[node_hues + 1] = {{0, 114, 178},  {230, 159, 0}, {0, 158, 115},  {170, 68, 153}, {86, 180, 233},
                                       {153, 153, 51}, {92, 84, 190}, {140, 100, 70}, {110, 120, 130}};

/// `share` of `p` and the rest of `q`.
Color mix(Color p, Color q, double share) {
  const auto channel = [share](std::uint8_t of_p, std::uint8_t of_q) {
    return static_cast<std::uint8_t>(std::lround(share * of_p + (1 - share) * of_q));
  };
  return {channel(p.red, q.red), channel(p.green, q.green), channel(p.blue, q.blue)};
}

}  // namespace

Color color_of(Ink ink, bool dark) {
  const Color page = dark ? dark_page : light_page;
  const Color hue = dark ? mix(hues[ink.hue], white, 0.8) : hues[ink.hue];
  switch (ink.meaning) {
    case Meaning::page:
      return page;
    case Meaning::text:
      return dark ? Color{230, 237, 243} : Color{31, 41, 51};
    case Meaning::faint_text:
      return dark ? Color{154, 165, 177} : Color{82, 96, 109};
    case Meaning::border:
      return dark ? Color{110, 120, 132} : Color{123, 135, 148};
    case Meaning::region:
      return mix(hue, page, dark ? 0.24 : 0.2);
    case Meaning::active:
      return mix(hue, dark ? white : black, 0.9);
    case Meaning::non_active:
      return mix(hue, page, 0.42);
    case Meaning::avatar:
      return dark ? Color{240, 244, 248} : Color{24, 32, 42};
    case Meaning::fixed:
      return dark ? Color{150, 160, 170, 0.35} : Color{110, 120, 130, 0.35};
    case Meaning::fixed_edge:
      return dark ? Color{150, 160, 170} : Color{90, 100, 110};
    case Meaning::contact:
      return dark ? Color{255, 92, 112} : Color{213, 0, 50};
  }
  return page;
}

}  // namespace ringfence::tools
