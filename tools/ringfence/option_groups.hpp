#pragma once

#include <array>

/// The groups of options in the help of every command, in the manual page, in this order.
namespace ringfence::tools::option_groups {

inline constexpr const char* world = "World";
inline constexpr const char* service = "Service";
inline constexpr const char* clients = "Clients";
inline constexpr const char* journal = "Journal";
inline constexpr const char* processes = "Nodes in other processes";
inline constexpr const char* faults = "Faults";
inline constexpr const char* output = "Output";
inline constexpr const char* help = "Help";
inline constexpr std::array all{world, service, clients, journal, processes, faults, output, help};

}  // namespace ringfence::tools::option_groups
