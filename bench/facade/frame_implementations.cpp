#include "facade/frame_implementations.hpp"

#include "facade/service_frames.hpp"

namespace ringfence::bench {

const std::vector<Implementation>& frame_implementations() {
  constexpr std::uint32_t any = 0xffffffff;
  constexpr double peer = 0.03;  // Bullet keeps contact points of earlier frames and uses margins
  static const std::vector<Implementation> all = {
      {"ringfence", false, any, 0, [](const RecordedWorld& w) { return make_service_frame(w, 0, Placement::server); }},
      {"ringfence_region", false, any, 0,
       [](const RecordedWorld& w) { return make_service_frame(w, 0, Placement::region); }},
      {"ringfence_place", false, any, 0, make_place_frame},
      {"ringfence_server_2", true, any, 0,
       [](const RecordedWorld& w) { return make_service_frame(w, 2, Placement::server); }},
      {"ringfence_region_2", true, any, 0,
       [](const RecordedWorld& w) { return make_service_frame(w, 2, Placement::region); }},
      {"loop", false, any, 0, make_loop_frame},
      {"tbb", true, any, 0, [](const RecordedWorld& w) { return make_tbb_frame(w, 1); }},
      {"tbb_2", true, any, 0, [](const RecordedWorld& w) { return make_tbb_frame(w, 2); }},
#ifdef RINGFENCE_BENCH_FCL
      {"fcl", false, any, peer, [](const RecordedWorld& w) { return make_fcl_frame(w, 1); }},
      {"fcl_2", true, any, peer, [](const RecordedWorld& w) { return make_fcl_frame(w, 2); }},
#endif
#ifdef RINGFENCE_BENCH_BULLET
      {"bullet", false, 64000, peer, make_bullet_frame},
#endif
#ifdef RINGFENCE_BENCH_EMBREE
      {"embree", false, any, 0, make_embree_frame},
#endif
#ifdef RINGFENCE_BENCH_CGAL
      {"cgal", false, any, 0, make_cgal_frame},
#endif
  };
  return all;
}

}  // namespace ringfence::bench
