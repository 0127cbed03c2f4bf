#include "convert.hpp"

#include <fmt/format.h>

#include "exit_code.hpp"
#include "trace.hpp"
#include "worlds/motion_file.hpp"
#include "worlds/scene_file.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::tools {
namespace {

void refuse_compressed(const ConvertOptions& options, std::string_view text) {
  const char* decompress = nullptr;
  if (text.starts_with("\x1f\x8b")) decompress = "zcat";
  if (text.starts_with("\xfd"
                       "7zXZ"))
    decompress = "xzcat";
  if (!decompress) return;
  throw Error(fmt::format("{}: found compressed data; expected text: {} {} | ringfence convert {} - --out {}",
                          options.input, decompress, options.input == "-" ? "FILE" : options.input, options.kind,
                          options.prefix));
}

}  // namespace

int convert(const ConvertOptions& options) {
  const std::string text = worlds::read_text(options.input);
  refuse_compressed(options, text);
  const std::string name = options.input == "-" ? "standard input" : options.input;
  if (options.kind == "crowd" && (!options.from.empty() || options.minutes != 0)) {
    throw Error("--from, --minutes: expected only with air");
  }
  const Trace trace =
      options.kind == "air" ? read_air(text, name, options.from, options.minutes) : read_crowd(text, name);
  const TraceWorld world = make_trace_world(trace, options.copies);
  worlds::write_scene(options.prefix + ".json", world.scene);
  worlds::write_motion_csv(options.prefix + ".csv", world.motion);
  fmt::print("{0}.json: {1} objects\n{0}.csv: {2} frames, {3} rows\n", options.prefix, world.scene.objects.size(),
             world.motion.frames, world.motion.rows.size());
  return done;
}

}  // namespace ringfence::tools
