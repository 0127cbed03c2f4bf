#pragma once

#include "options.hpp"
#include "robots/robot_board.hpp"
#include "robots/robot_figures.hpp"

namespace ringfence::tools {

/// Prints what robots measured and found, and writes it to RobotsOptions::json. Reorders the values of `figures`.
void report_robots(const RobotsOptions& options, const RobotInterval& interval, RobotFigures& figures,
                   const RobotBoard& board, const RobotViolations& violations);

}  // namespace ringfence::tools
