#pragma once

#include "queries/searcher.hpp"
#include "ringfence/query.hpp"

namespace ringfence::queries {

// What a Searcher found, as the caller of a query reads it. Both leave the hit as it is if nothing was found. Any
// thread may call them.

inline void set_object(Hit& hit, const FrameObject& object) noexcept {
  hit.object = ObjectId::of(object.number, object.generation);
  hit.user_data = object.user_data;
}

inline void set(Hit& hit, const ObjectHit& found) noexcept {
  if (found.object == nullptr) return;
  set_object(hit, *found.object);
  hit.fraction = found.hit.fraction;
  hit.normal = found.hit.normal;
  hit.point = found.hit.point;
  hit.child = found.hit.child;
  hit.triangle = found.hit.triangle;
}

inline void set(Hit& hit, const ObjectPoint& found) noexcept {
  if (found.object == nullptr) return;
  set_object(hit, *found.object);
  hit.distance = found.nearest.distance;
  hit.point = found.nearest.point;
  hit.child = found.nearest.child;
  hit.triangle = found.nearest.triangle;
}

}  // namespace ringfence::queries
