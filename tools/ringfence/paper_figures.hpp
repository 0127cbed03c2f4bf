#pragma once

#include <cstdint>

#include "ringfence/config.hpp"

namespace ringfence::tools {

/// A frame time that the text of section 4 of the paper states. The paper's graphs give no exact values.
struct PaperFigure {
  Deployment deployment;
  std::uint32_t nodes;
  std::uint32_t objects;
  double ms;
  const char* relation;  ///< of the frame time to `ms`: "about", "over" or "at most"
};

inline constexpr PaperFigure paper_figures[] = {
    {Deployment::user, 1, 1000, 1500, "about"},           {Deployment::user, 1, 4000, 6000, "over"},
    {Deployment::user, 16, 1000, 600, "at most"},         {Deployment::user, 16, 4000, 1500, "at most"},
    {Deployment::user_collision, 1, 1000, 1200, "about"}, {Deployment::user_collision, 1, 4000, 4100, "about"},
    {Deployment::user_collision, 16, 4000, 300, "about"},
};

/// Contacts per frame at 4000 objects; the paper says "in excess of 1600".
inline constexpr double paper_contacts = 1600;
inline constexpr std::uint32_t paper_contacts_objects = 4000;

/// The paper's frame time for a configuration; null if it states none.
inline const PaperFigure* paper_figure(Deployment deployment, std::uint32_t nodes, std::uint32_t objects) {
  for (const PaperFigure& figure : paper_figures) {
    if (figure.deployment == deployment && figure.nodes == nodes && figure.objects == objects) return &figure;
  }
  return nullptr;
}

}  // namespace ringfence::tools
