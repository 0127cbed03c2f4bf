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

/// The pose of one object from one frame on, or its absence.
struct MotionRow {
  std::uint32_t frame = 0;
  ObjectNumber object = 0;
  bool present = true;  ///< false: the object is absent from this frame until its next row
  bool jump = false;    ///< the object was placed at the pose: it did not move there from the pose before
  Pose pose;            ///< valid if present
  bool operator==(const MotionRow&) const noexcept = default;
};

/// Recorded movement: rows sorted by frame, at most one row per object and frame. The rows of frame k are applied
/// before collisions of frame k are detected. An object without a row keeps its pose.
struct Motion {
  std::uint32_t frames = 0;  ///< CSV: frame of the last row plus 1; binary: as in the file's header
  std::vector<MotionRow> rows;
};

/// Reads the movement of the objects of `scene` from a file. A file that begins with RFMOTION is binary; any other is
/// CSV. docs/formats.md describes both formats.
///
/// Throws InputError that names the file and the line (CSV) or byte offset (binary) for:
/// - a wrong header, field count or file size; an object count that differs from the scene;
/// - a number that is not finite; a quaternion whose length differs from 1 by more than 10^-3; a jump other than 0 or
/// 1;
/// - frames in descending order; two rows of an object in one frame;
/// - an object that the scene does not have, or that is static.
///
/// Binary motion has every object in every frame, and no jumps. The result has a row only where a pose or presence
/// changes.
Motion read_motion(const std::filesystem::path& file, const Scene& scene);

/// Parses motion from memory. `name` is the file name in messages.
Motion parse_motion(std::string_view bytes, const std::string& name, const Scene& scene);

/// Formats motion as CSV, with the column `jump` if a row is a jump. Every row reads back with the same bits.
std::string format_motion_csv(const Motion& motion);
void write_motion_csv(const std::filesystem::path& file, const Motion& motion);

/// Writes binary motion frame by frame, so that memory does not grow with the length of the recording.
///
/// Every member throws Error that names the file if it cannot be written. One thread at a time.
class BinaryMotionWriter {
 public:
  /// Creates the file. `objects` is the number of objects of the scene.
  BinaryMotionWriter(std::filesystem::path file, std::uint32_t objects);
  ~BinaryMotionWriter();
  BinaryMotionWriter(const BinaryMotionWriter&) = delete;
  BinaryMotionWriter& operator=(const BinaryMotionWriter&) = delete;

  /// Appends one frame: the poses of all objects in the order of the scene. A NaN position marks an absent object.
  void add_frame(std::span<const Pose> poses);

  /// Writes the frame count into the header and closes the file. Readers refuse a file without this step.
  void finish();

 private:
  void write(const void* bytes, std::size_t size);

  std::filesystem::path name_;
  std::FILE* file_ = nullptr;
  std::uint32_t objects_;
  std::uint32_t frames_ = 0;
};

}  // namespace ringfence::worlds
