// What sessions that no longer exist have drawn in a site's map (site.h).
#include <utility>

#include "server/maps/site.h"
#include "server/maps/stored_grid.h"

namespace cairn::server {

void Site::StoreLayer(SessionId session) {
  if (journal_ == nullptr) return;
  journal_->Put(
      {RecordKind::kLayer, site_id_, session},
      [layer = StoredLayer{session, ToStored({.chunks = joint_.ChunksOf(session)})}] { return BytesOf(layer); });
}

Result<void> Site::RestoreLayers() {
  const auto take = [this](std::uint64_t number, std::string_view bytes) -> Result<void> {
    const auto layer = LayerOf(bytes);
    if (!layer) return tl::unexpected(layer.error());
    if (layer->session != number) return Fail(StatusCode::kDataLoss, "the record is that of another session");
    layers_.insert(layer->session);
    joint_.Replace(layer->session, FromStored(layer->grid).chunks);
    joint_.SetPast(layer->session);
    return {};
  };
  const auto unreadable = [this](std::uint64_t number, const Status& why) {
    PutAside("the part of the map that session " + std::to_string(number) + " has drawn", why);
  };
  return ReadEach(journal_->store(), {.kind = RecordKind::kLayer, .owner = site_id_}, take, unreadable);
}

void Site::StageGone(SessionId session) {
  const RobotGrid& part = versions_.Find(switch_->version)->parts.at(session);
  switch_->staged.emplace(session, part.chunks);
  RobotGrid& displaced = switch_->displaced[session];
  displaced.chunks = joint_.ChunksOf(session);
  displaced.keyframes = part.keyframes;
  displaced.fragment = joint_.hidden().contains(session);
}

}  // namespace cairn::server
