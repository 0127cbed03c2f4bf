#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/error.hpp"
#include "ringfence/status.hpp"
#include "worlds/paper_world.hpp"

namespace ringfence::bench {

/// Some frames of a world: the objects, and the pose of every object in every frame. The playback only detects
/// contacts.
///
/// It is played forwards and backwards, so that the motion between two frames is always a recorded one.
struct RecordedWorld {
  worlds::Scene scene;                           ///< object i has number i + 1 and shape number scene.objects[i].shape
  std::unique_ptr<geometry::ShapeTable> shapes;  ///< the scene's shapes, under the same numbers
  geometry::FixedSpace space{{0, 0, 0}, {1, 1, 1}};
  std::vector<std::vector<Pose>> frames;

  std::size_t objects() const noexcept { return scene.objects.size(); }
  /// Index into `frames` of the k-th frame of the playback.
  std::size_t played(std::size_t k) const noexcept {
    const std::size_t period = 2 * frames.size() - 2;
    return k % period < frames.size() ? k % period : period - k % period;
  }
};

/// Records `frames` frames (at least 2) of the paper's world, after some frames in which the crowds form. While it is
/// recorded the objects steer and react to their contacts.
RecordedWorld record_world(worlds::ShapeSetting shapes, std::uint32_t objects, std::size_t frames);

/// A world that no program of ours has recorded, of the same coverage as the paper's: bodies of 0.2 to 2.5 m on each
/// axis (30 % boxes, among them plates and rods; 20 % capsules, 15 % spheres, 35 % hulls of up to 64 points) fly on
/// straight lines through a flat world with walls, and through each other. Half of them start in crowds. A tenth rests,
/// a twentieth is ten times as fast as the others. Objects near each other do not have numbers near each other.
RecordedWorld make_drift_world(std::uint32_t objects, std::size_t frames);

/// In the paper's world a third of the objects rests in each frame. Lets them move too: by 2 cm along x in a frame.
void let_all_move(RecordedWorld& world);
/// Lets `percent` of the objects, chosen by their numbers, rest: they keep their first pose.
void let_rest(RecordedWorld& world, std::uint32_t percent);

/// Throws Error unless a call of World was accepted: a benchmark must not time frames that were refused.
inline void require_ok(Status status) {
  if (status != Status::ok) throw Error(std::string("World refused a call: ") + name_of(status));
}

/// An implementation of a whole frame: poses in, broad phase, exact narrow phase, all contacts out.
class FrameTester {
 public:
  virtual ~FrameTester() = default;
  /// Computes a frame with these poses. This is timed.
  virtual void run(const std::vector<Pose>& poses) = 0;
  /// Number of contacts of the last frame. They may be in any order and format, with normal, depth and point.
  virtual std::size_t contacts() const = 0;
  /// The pairs of numbers in contact, as a << 32 | b with a < b, in any order. Not timed.
  virtual std::vector<std::uint64_t> touching() const = 0;
};

/// Contact storage for implementations without a contact format of their own.
class ContactList {
 public:
  void clear() noexcept { contacts_.clear(); }
  Contact& add() { return contacts_.emplace_back(); }
  std::size_t size() const noexcept { return contacts_.size(); }
  std::vector<std::uint64_t> keys() const;

 private:
  std::vector<Contact> contacts_;
};

std::unique_ptr<FrameTester> make_fcl_frame(const RecordedWorld& world, int threads);
std::unique_ptr<FrameTester> make_bullet_frame(const RecordedWorld& world);
std::unique_ptr<FrameTester> make_embree_frame(const RecordedWorld& world);
std::unique_ptr<FrameTester> make_cgal_frame(const RecordedWorld& world);

/// Our sweep and kernels without the service: in one loop, or with the work stealing of oneTBB on `threads` threads,
/// where pairs are tested while the sweep continues. The difference to these shows what nodes, regions and messages
/// cost or gain.
std::unique_ptr<FrameTester> make_loop_frame(const RecordedWorld& world);
std::unique_ptr<FrameTester> make_tbb_frame(const RecordedWorld& world, int threads);

}  // namespace ringfence::bench
