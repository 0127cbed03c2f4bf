#include "worlds/motion_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "geometry/vector.hpp"
#include "worlds/csv_text.hpp"
#include "worlds/text_file.hpp"

namespace ringfence::worlds {
namespace {

static_assert(std::endian::native == std::endian::little, "binary motion is little-endian; poses are copied as bytes");

constexpr std::string_view header = "frame,object,x,y,z,qx,qy,qz,qw";
constexpr std::string_view header_with_jump = "frame,object,x,y,z,qx,qy,qz,qw,jump";
constexpr std::string_view magic = "RFMOTION";
constexpr std::size_t fields = 9;  ///< without `jump`
constexpr std::uint32_t max_frames = 100'000'000;

struct BinaryHeader {
  char magic[8];
  std::uint32_t version;
  std::uint32_t objects;
  std::uint32_t frames;
  std::uint32_t zero;
};
static_assert(sizeof(BinaryHeader) == 24);

/// The bits of a pose. Poses are compared by their bits, so -0 differs from 0.
using PoseBits = std::array<std::uint64_t, 5>;
static_assert(sizeof(PoseBits) == sizeof(Pose));

/// The properties of the scene's objects that the CSV reader checks, by object number.
class ObjectIndex {
 public:
  explicit ObjectIndex(const Scene& scene) {
    for (const ObjectSpec& object : scene.objects) {
      entries_.emplace(object.number, Entry{none, object.category == Category::fixed});
    }
  }
  struct Entry {
    std::uint32_t last_frame;  ///< frame of the object's latest row, or `none`
    bool fixed;
  };
  static constexpr std::uint32_t none = 0xffffffffu;

  Entry* find(ObjectNumber number) {
    const auto found = entries_.find(number);
    return found == entries_.end() ? nullptr : &found->second;
  }

 private:
  std::unordered_map<ObjectNumber, Entry> entries_;
};

/// Reads CSV motion line by line. Its messages begin with FILE:LINE.
class CsvReader {
 public:
  CsvReader(std::string_view text, const std::string& name, const Scene& scene) : text_(text, name), objects_(scene) {}

  Motion read() {
    const std::optional<std::string_view> first = text_.next_line();
    has_jump_ = first && *first == header_with_jump;
    if (!first || (*first != header && !has_jump_)) {
      text_.fail(fmt::format("found \"{}\"; expected the header \"{}\", with or without \",jump\" at the end",
                             first.value_or(""), header));
    }
    while (const std::optional<std::string_view> line = text_.next_line()) {
      read_row(*line);
    }
    if (!motion_.rows.empty()) motion_.frames = motion_.rows.back().frame + 1;
    return std::move(motion_);
  }

 private:
  void read_row(std::string_view line) {
    std::array<std::string_view, fields + 1> parts;
    text_.split(line, std::span(parts).first(has_jump_ ? fields + 1 : fields), has_jump_ ? header_with_jump : header);
    MotionRow row;
    row.frame = text_.number<std::uint32_t>(parts[0], "frame", "a whole number of 0 or more");
    row.object = text_.number<std::uint32_t>(parts[1], "object", "the id of an object");
    if (row.frame >= max_frames)
      text_.fail(fmt::format("frame: found {}; expected less than {}", row.frame, max_frames));
    if (!motion_.rows.empty() && row.frame < motion_.rows.back().frame) {
      text_.fail(fmt::format("frame: found {} after {}; expected frames in ascending order", row.frame,
                             motion_.rows.back().frame));
    }
    check_object(row);
    std::size_t empty = 0;
    for (std::size_t i = 2; i < fields; ++i) empty += parts[i].empty();
    row.present = empty != fields - 2;
    if (row.present) {
      row.pose.position = {text_.finite<double>(parts[2], "x"), text_.finite<double>(parts[3], "y"),
                           text_.finite<double>(parts[4], "z")};
      row.pose.orientation = text_.orientation(std::span(parts).subspan<5, 4>());
    }
    if (has_jump_) row.jump = read_jump(parts[fields]);
    motion_.rows.push_back(row);
  }

  bool read_jump(std::string_view text) const {
    if (text != "0" && text != "1") text_.fail_unexpected("jump", text, "0 or 1");
    return text == "1";
  }

  void check_object(const MotionRow& row) {
    ObjectIndex::Entry* object = objects_.find(row.object);
    if (!object) text_.fail(fmt::format("object: found {}; expected an id of the scene", row.object));
    if (object->fixed)
      text_.fail(fmt::format("object: {} is static; expected rows only of objects that may move", row.object));
    if (object->last_frame == row.frame) {
      text_.fail(fmt::format("object: {} has two rows in frame {}; expected at most one row per frame", row.object,
                             row.frame));
    }
    object->last_frame = row.frame;
  }

  CsvText text_;
  ObjectIndex objects_;
  bool has_jump_ = false;  ///< the file has the column `jump`
  Motion motion_;
};

/// Reads binary motion. Its messages name the byte offset and, after the header, the frame and the object.
class BinaryReader {
 public:
  BinaryReader(std::string_view bytes, const std::string& name, const Scene& scene)
      : bytes_(bytes), name_(name), scene_(scene) {}

  Motion read() {
    read_header();
    // The file has every object in every frame. A row is made only where an object differs from the frame before; the
    // first frame is compared with the scene.
    std::vector<ObjectSpec> last = scene_.objects;
    std::size_t at = sizeof(BinaryHeader);
    for (std::uint32_t frame = 0; frame < motion_.frames; ++frame) {
      for (ObjectSpec& object : last) {
        Pose pose;
        std::memcpy(&pose, bytes_.data() + at, sizeof pose);
        add_if_changed(frame, object, pose, at);
        at += sizeof pose;
      }
    }
    return std::move(motion_);
  }

 private:
  [[noreturn]] void fail(std::size_t at, const std::string& message) const {
    throw InputError(fmt::format("{}: byte {}: {}", name_, at, message));
  }

  void read_header() {
    BinaryHeader head;
    if (bytes_.size() < sizeof head) {
      fail(bytes_.size(), fmt::format("the file ends within the header; expected {} bytes", sizeof head));
    }
    std::memcpy(&head, bytes_.data(), sizeof head);
    if (head.version != 1) fail(8, fmt::format("version: found {}; expected 1", head.version));
    if (head.objects != scene_.objects.size()) {
      fail(12, fmt::format("objects: found {}; expected {}, as in the scene", head.objects, scene_.objects.size()));
    }
    if (head.frames >= max_frames) {
      fail(16, fmt::format("frames: found {}; expected less than {}", head.frames, max_frames));
    }
    if (head.zero != 0) fail(20, fmt::format("found {}; expected 0", head.zero));
    const std::uint64_t frame_bytes = std::uint64_t{head.objects} * sizeof(Pose);
    const std::uint64_t expected = sizeof head + head.frames * frame_bytes;
    if (bytes_.size() < expected) {
      const std::uint64_t complete_frames = (bytes_.size() - sizeof head) / frame_bytes;
      fail(bytes_.size(), fmt::format("the file ends within frame {} of {}; expected {} bytes", complete_frames,
                                      head.frames, expected));
    }
    if (bytes_.size() > expected) {
      fail(expected, fmt::format("{} bytes follow the last of {} frames; expected the end", bytes_.size() - expected,
                                 head.frames));
    }
    motion_.frames = head.frames;
  }

  void add_if_changed(std::uint32_t frame, ObjectSpec& object, const Pose& pose, std::size_t at) {
    const auto refuse = [&](std::size_t offset, const std::string& message) {
      fail(at + offset, fmt::format("frame {}, object {}: {}", frame, object.number, message));
    };
    const Vec3d& p = pose.position;
    const bool present = !(std::isnan(p.x) || std::isnan(p.y) || std::isnan(p.z));
    if (present) {
      if (!is_finite(p)) {
        refuse(0,
               fmt::format("position: found ({}, {}, {}); expected finite numbers, or NaN for absent", p.x, p.y, p.z));
      }
      if (!is_unit(pose.orientation)) {
        refuse(offsetof(Pose, orientation),
               fmt::format("orientation: found {}; expected a unit quaternion (length 1 within 0.001)",
                           format_quaternion(pose.orientation)));
      }
    }
    const bool same = present == object.enabled &&
                      (!present || std::bit_cast<PoseBits>(pose) == std::bit_cast<PoseBits>(object.pose));
    if (same) return;
    if (object.category == Category::fixed) refuse(0, "is static but moves; expected its pose in the scene");
    object.enabled = present;
    if (present) object.pose = pose;
    motion_.rows.push_back({frame, object.number, present, false, present ? pose : Pose{}});
  }

  std::string_view bytes_;
  const std::string& name_;
  const Scene& scene_;
  Motion motion_;
};

}  // namespace

Motion parse_motion(std::string_view bytes, const std::string& name, const Scene& scene) {
  if (bytes.starts_with(magic)) return BinaryReader(bytes, name, scene).read();
  return CsvReader(bytes, name, scene).read();
}

Motion read_motion(const std::filesystem::path& file, const Scene& scene) {
  return parse_motion(read_text(file), file.string(), scene);
}

std::string format_motion_csv(const Motion& motion) {
  const bool has_jump = std::any_of(motion.rows.begin(), motion.rows.end(), [](const auto& row) { return row.jump; });
  std::string text(has_jump ? header_with_jump : header);
  text += '\n';
  const auto out = std::back_inserter(text);
  for (const MotionRow& row : motion.rows) {
    const Vec3d& p = row.pose.position;
    const Quat& q = row.pose.orientation;
    if (row.present) {
      fmt::format_to(out, "{},{},{},{},{},{},{},{},{}", row.frame, row.object, p.x, p.y, p.z, q.x, q.y, q.z, q.w);
    } else {
      fmt::format_to(out, "{},{},,,,,,,", row.frame, row.object);
    }
    if (has_jump) text += row.jump ? ",1" : ",0";
    text += '\n';
  }
  return text;
}

void write_motion_csv(const std::filesystem::path& file, const Motion& motion) {
  write_text(file, format_motion_csv(motion));
}

BinaryMotionWriter::BinaryMotionWriter(std::filesystem::path file, std::uint32_t objects)
    : name_(std::move(file)), file_(std::fopen(name_.c_str(), "wb")), objects_(objects) {
  if (!file_) throw Error(fmt::format("{}: cannot be written: {}", name_.string(), std::strerror(errno)));
  BinaryHeader head{{}, 1, objects_, 0, 0};
  std::memcpy(head.magic, magic.data(), sizeof head.magic);
  write(&head, sizeof head);
}

BinaryMotionWriter::~BinaryMotionWriter() {
  if (file_) std::fclose(file_);
}

void BinaryMotionWriter::write(const void* bytes, std::size_t size) {
  if (std::fwrite(bytes, 1, size, file_) != size) {
    throw Error(fmt::format("{}: cannot be written: {}", name_.string(), std::strerror(errno)));
  }
}

void BinaryMotionWriter::add_frame(std::span<const Pose> poses) {
  if (poses.size() != objects_) {
    throw Error(fmt::format("{}: a frame of {} poses; expected {}", name_.string(), poses.size(), objects_));
  }
  write(poses.data(), poses.size_bytes());
  ++frames_;
}

void BinaryMotionWriter::finish() {
  bool written = std::fseek(file_, offsetof(BinaryHeader, frames), SEEK_SET) == 0;
  written = written && std::fwrite(&frames_, sizeof frames_, 1, file_) == 1;
  written = std::fclose(std::exchange(file_, nullptr)) == 0 && written;
  if (!written) throw Error(fmt::format("{}: cannot be written: {}", name_.string(), std::strerror(errno)));
}

}  // namespace ringfence::worlds
