#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "ringfence/contact.hpp"
#include "worlds/paper_world.hpp"

namespace ringfence::bench {

/// Some frames of the paper's world as they were: who is there, and every pose of every frame. The objects steer and
/// answer their contacts while it is recorded; whoever plays it back only detects.
///
/// Played to and fro, so that the movement from one frame to the next is always one of the world's own.
struct RecordedWorld {
  worlds::Scene scene;                           ///< object i has number i + 1 and shape number scene.objects[i].shape
  std::unique_ptr<geometry::ShapeTable> shapes;  ///< the scene's, under the same numbers
  geometry::FixedSpace space{{0, 0, 0}, {1, 1, 1}};
  std::vector<std::vector<Pose>> frames;

  std::size_t objects() const noexcept { return scene.objects.size(); }
  /// Which of `frames` is played k-th.
  std::size_t played(std::size_t k) const noexcept {
    const std::size_t period = 2 * frames.size() - 2;
    return k % period < frames.size() ? k % period : period - k % period;
  }
};

/// Records `frames` frames (at least 2), after some that let the crowds form.
RecordedWorld record_world(worlds::ShapeSetting shapes, std::uint32_t objects, std::size_t frames);

/// Somebody's way to do a whole frame: poses in, broad phase, exact narrow phase, every contact out.
class FrameTester {
 public:
  virtual ~FrameTester() = default;
  /// A frame with these poses. This is what is timed.
  virtual void run(const std::vector<Pose>& poses) = 0;
  /// Contacts that the last frame gave out, in any order; normal, depth and point as the tester has them.
  virtual std::size_t contacts() const = 0;
  /// Which two numbers touch, as a << 32 | b with a < b, in any order. Not timed.
  virtual std::vector<std::uint64_t> touching() const = 0;
};

/// What a tester that has no contacts of its own layout puts them in.
class ContactList {
 public:
  void clear() noexcept { contacts_.clear(); }
  Contact& add() { return contacts_.emplace_back(); }
  std::size_t size() const noexcept { return contacts_.size(); }
  std::vector<std::uint64_t> keys() const;

 private:
  std::vector<Contact> contacts_;
};

std::unique_ptr<FrameTester> make_fcl_frame(const RecordedWorld& world);
std::unique_ptr<FrameTester> make_bullet_frame(const RecordedWorld& world);
std::unique_ptr<FrameTester> make_embree_frame(const RecordedWorld& world);
std::unique_ptr<FrameTester> make_cgal_frame(const RecordedWorld& world);

/// Our own sweep and kernels without the service: one loop, or oneTBB's work stealing on `threads` threads, where pairs
/// are tested while the sweep goes on. What nodes, regions and messages cost or are worth is the difference to these.
std::unique_ptr<FrameTester> make_loop_frame(const RecordedWorld& world);
std::unique_ptr<FrameTester> make_tbb_frame(const RecordedWorld& world, int threads);

}  // namespace ringfence::bench
