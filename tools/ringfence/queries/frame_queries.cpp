#include "queries/frame_queries.hpp"

#include <utility>

namespace ringfence::tools {

FrameQueries::FrameQueries(const QueryLoad& load) : load_(load) {
  if (load.is_empty()) return;
  figures_.emplace();
  if (load.answers.empty()) return;
  file_.emplace(load.answers);
  file_->print("frame,query,object,child,triangle,fraction,px,py,pz,nx,ny,nz,distance\n");
}

void FrameQueries::select_rows(std::uint32_t frame) {
  if (load_.rays > 0) {
    make_rays(load_, frame, random_);
    rows_ = random_;
    return;
  }
  const std::size_t begin = next_;
  while (next_ < load_.rows.size() && load_.rows[next_].frame == frame) ++next_;
  rows_ = std::span(load_.rows).subspan(begin, next_ - begin);
}

void FrameQueries::add_frame(std::uint32_t frame, const World& world) {
  select_rows(frame);
  if (rows_.empty()) return;
  answers_.answer(world, rows_);
  figures_->work += answers_.work();
  figures_->hits += answers_.hit_count();
  figures_->ms += answers_.ms();
  for (std::size_t i = 0; i < rows_.size(); ++i) figures_->digest.add(frame, rows_[i].query, answers_.hits(i));
  if (file_) write_answers();
}

// {} formats the shortest text that reads back as the same double.
void FrameQueries::write_answers() {
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    for (const Hit& hit : answers_.hits(i)) {
      file_->print("{},{},{},{},{},{},{},{},{},{},{},{},{}\n", rows_[i].frame, rows_[i].query, hit.object.number(),
                   hit.child, hit.triangle, hit.fraction, hit.point.x, hit.point.y, hit.point.z, hit.normal.x,
                   hit.normal.y, hit.normal.z, hit.distance);
    }
  }
}

void FrameQueries::finish() {
  if (file_) file_->close();
}

}  // namespace ringfence::tools
