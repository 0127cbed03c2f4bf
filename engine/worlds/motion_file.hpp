#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "worlds/input_error.hpp"
#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// An object that moves, appears or goes in a frame.
struct MotionRow {
  std::uint32_t frame = 0;
  ObjectNumber object = 0;
  bool present = true;  ///< false: absent from this frame on, until its next row
  Pose pose;            ///< meaningful where present
  bool operator==(const MotionRow&) const noexcept = default;
};

/// Recorded movement: rows in order of frame, at most one an object and frame. Frame k's rows are applied, then frame
/// k is detected; objects without a row stay where they were.
struct Motion {
  std::uint32_t frames = 0;  ///< the last row's frame and one; of a binary file as it says
  std::vector<MotionRow> rows;
};

/// Reads the movement of `scene` from a file: CSV, or binary where it begins with RFMOTION.
///
/// Throws InputError naming the file and the line (CSV) or byte offset (binary) for a wrong header or field count, what
/// is not a finite number, an orientation further than 10^-3 from unit length, frames out of order, an object that the
/// scene does not have, has twice in a frame, or that is static, counts that are not the scene's, and a file that is
/// too short or too long. A row of an object whose pose has not changed is kept out of binary motion: there every frame
/// has every object.
Motion read_motion(const std::filesystem::path& file, const Scene& scene);

/// The same from memory; `name` stands for the file in messages.
Motion parse_motion(std::string_view bytes, const std::string& name, const Scene& scene);

/// Rows as CSV; every number reads back with the same bits.
std::string format_motion_csv(const Motion& motion);
void write_motion_csv(const std::filesystem::path& file, const Motion& motion);

/// Writes binary motion frame by frame, so that a long recording is never in memory as a whole.
///
/// Throws Error naming the file when it cannot be written. One thread.
class BinaryMotionWriter {
 public:
  /// `objects` is the scene's count.
  BinaryMotionWriter(std::filesystem::path file, std::uint32_t objects);
  ~BinaryMotionWriter();
  BinaryMotionWriter(const BinaryMotionWriter&) = delete;
  BinaryMotionWriter& operator=(const BinaryMotionWriter&) = delete;

  /// One frame: the poses of all objects in the scene's order; a position of NaN stands for an absent one.
  void add_frame(std::span<const Pose> poses);

  /// Puts the frame count into the header and closes the file. Without it the file is not valid.
  void finish();

 private:
  void write(const void* bytes, std::size_t size);

  std::filesystem::path name_;
  std::FILE* file_ = nullptr;
  std::uint32_t objects_;
  std::uint32_t frames_ = 0;
};

}  // namespace ringfence::worlds
