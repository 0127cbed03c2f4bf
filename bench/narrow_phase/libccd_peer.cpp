#include <cmath>

#include <ccd/ccd.h>
#include <ccd/quat.h>

#include "narrow_phase/peer.hpp"

namespace ringfence::narrow_phase_bench {
namespace {

struct Object {
  ccd_vec3_t position;
  ccd_quat_t turn, back;
  const geometry::ShapeRow* row = nullptr;
  const geometry::Hull* hull = nullptr;
};

void support(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* out) {
  const Object& o = *static_cast<const Object*>(object);
  ccd_vec3_t d;
  ccdVec3Copy(&d, direction);
  ccdQuatRotVec(&d, &o.back);
  const float* size = o.row->size;
  switch (o.row->kind) {
    case ShapeKind::box:
      ccdVec3Set(out, std::copysign(double{size[0]}, d.v[0]), std::copysign(double{size[1]}, d.v[1]),
                 std::copysign(double{size[2]}, d.v[2]));
      break;
    case ShapeKind::sphere:
    case ShapeKind::capsule: {
      const double length = std::sqrt(ccdVec3Len2(&d));
      ccdVec3Copy(out, &d);
      ccdVec3Scale(out, double{size[0]} / length);
      if (o.row->kind == ShapeKind::capsule) out->v[2] += std::copysign(double{size[1]}, d.v[2]);
      break;
    }
    default: {
      const float x = static_cast<float>(d.v[0]), y = static_cast<float>(d.v[1]), z = static_cast<float>(d.v[2]);
      float best = -1e30f;
      std::size_t at = 0;
      for (std::size_t i = 0; i < o.hull->vertex_count(); ++i) {
        const float along = o.hull->x()[i] * x + o.hull->y()[i] * y + o.hull->z()[i] * z;
        if (along > best) {
          best = along;
          at = i;
        }
      }
      const Vec3f v = o.hull->vertex(at);
      ccdVec3Set(out, double{v.x}, double{v.y}, double{v.z});
    }
  }
  ccdQuatRotVec(out, &o.turn);
  ccdVec3Add(out, &o.position);
}

void centre(const void* object, ccd_vec3_t* out) { ccdVec3Copy(out, &static_cast<const Object*>(object)->position); }

/// MPR, the fastest algorithm of libccd. The depth that it finds is not the least.
class Libccd final : public Peer {
 public:
  explicit Libccd(const Crowd& crowd) : crowd_(crowd) {
    for (const narrow_phase::Body& body : crowd.bodies) {
      Object& object = objects_.emplace_back();
      const Quat& q = body.pose.orientation;
      ccdVec3Set(&object.position, body.pose.position.x, body.pose.position.y, body.pose.position.z);
      ccdQuatSet(&object.turn, double{q.x}, double{q.y}, double{q.z}, double{q.w});
      ccdQuatNormalize(&object.turn);
      ccdQuatInvert2(&object.back, &object.turn);
      object.row = &crowd.shapes->row(body.shape);
      if (object.row->kind == ShapeKind::hull) object.hull = &crowd.shapes->hull(object.row->index_in_kind);
    }
    CCD_INIT(&settings_);
    settings_.support1 = support;
    settings_.support2 = support;
    settings_.center1 = centre;
    settings_.center2 = centre;
    settings_.max_iterations = 100;
  }

  void test() override {
    std::uint8_t* touches = touches_.data();
    for (const std::uint32_t pair : selected_) {
      const geometry::CandidatePair candidate = crowd_.pairs[pair];
      ccd_real_t depth;
      ccd_vec3_t direction, position;
      *touches++ = ccdMPRPenetration(&objects_[candidate.a], &objects_[candidate.b], &settings_, &depth, &direction,
                                     &position) == 0;
    }
  }

 private:
  const Crowd& crowd_;
  std::vector<Object> objects_;
  ccd_t settings_;
};

}  // namespace

std::unique_ptr<Peer> make_libccd(const Crowd& crowd) { return std::make_unique<Libccd>(crowd); }

}  // namespace ringfence::narrow_phase_bench
