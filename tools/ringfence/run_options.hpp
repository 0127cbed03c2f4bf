#pragma once

#include <CLI/CLI.hpp>

#include "options.hpp"

namespace ringfence::tools {

inline constexpr std::uint32_t max_frames = 10'000'000;

/// Each function adds options to a command, in the groups of option_groups.hpp. Their values are written to the last
/// argument, which must outlive the command.

/// --frames and --warmup. In a replay 0 frames are all frames of the motion.
void add_frames(CLI::App& command, FrameOptions& frames, bool replay);
/// Options of the service and of faults. Includes add_users and add_link.
void add_service(CLI::App& command, ServiceOptions& service);
/// The users and the options of the service that `scale` shares with `run`.
void add_users(CLI::App& command, ServiceOptions& service);
/// The limit of the list of contacts, in the group of the option before.
void add_deepest_contacts(CLI::App& command, ServiceOptions& service);
/// The generated world. Includes add_population.
void add_world(CLI::App& command, worlds::PaperWorldOptions& world);
/// The options of the generated world except the number of objects.
void add_population(CLI::App& command, worlds::PaperWorldOptions& world);
/// The random rays of a load.
void add_rays(CLI::App& command, RunOptions& options);
/// The files of queries and answers.
void add_queries(CLI::App& command, ReplayOptions& options);
/// Adds --view, and what belongs to it.
void add_view(CLI::App& command, ViewOptions& view);
/// The journal; --journal only if `writes`.
void add_journal_options(CLI::App& command, JournalOptions& journal, bool writes);
/// Checks and output files. Includes add_quiet.
void add_output(CLI::App& command, OutputOptions& output);
void add_quiet(CLI::App& command, OutputOptions& output);

}  // namespace ringfence::tools
