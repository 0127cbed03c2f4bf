#include "facade/queries/frame_recorder.hpp"

namespace ringfence::facade {
void record_frame(const nodes::ServerRole& server, std::uint64_t number, queries::RecordedFrame& frame) {
  const nodes::ObjectTable& table = server.objects();
  frame.begin(table.slots());
  std::size_t objects = 0;
  for (std::uint32_t slot = 0; slot < table.slots(); ++slot) {
    queries::FrameObject& row = frame.row(slot);
    if (table.present()[slot] == 0) {
      row.number = 0;
      continue;
    }
    ++objects;
    const nodes::ObjectRow& object = table.row(slot);
    const bool jumped = (table.marks(slot) & nodes::jumped_mark) != 0;
    row = {object.pose,
           object.shape,
           object.object.number,
           object.object.generation,
           table.group(slot),
           slot,
           static_cast<std::uint8_t>(object.layer),
           static_cast<std::uint8_t>(object.category),
           static_cast<std::uint8_t>(jumped ? 1 : 0)};
    frame.set_user_data(slot, table.origin(slot).user_data);
  }
  server.each_host_owned([&](const nodes::Hosted& hosted) {
    queries::FrameObject& row = frame.row(hosted.object.slot);
    row.pose = hosted.pose;
    row.jumped = 0;
  });
  frame.finish(number, objects);
}

}  // namespace ringfence::facade
