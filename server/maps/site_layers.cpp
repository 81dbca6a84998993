// The parts of a site's map that sessions have drawn which no longer exist (site.h).
#include <utility>
#include <vector>

#include "server/maps/site.h"
#include "server/maps/stored_grid.h"

namespace cairn::server {

void Site::StoreLayer(SessionId session) {
  if (journal_ == nullptr) return;
  journal_->Put(
      {RecordKind::kLayer, site_id_, session},
      [layer = StoredLayer{session, ToStored({.chunks = joint_.ChunksOf(session)})}] { return BytesOf(layer); });
}

void Site::RemoveLayer(SessionId session) {
  for (const std::uint32_t version : versions_.RemoveParts(session)) StoreVersion(version);
  layers_.erase(session);
  if (journal_ != nullptr)
    journal_->Remove({.kind = RecordKind::kLayer, .owner = site_id_, .first = session, .last = session});
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

// A fragment that was never joined is not shown and cannot become part of what is; the oldest of these go.
void Site::FoldOldLayers() {
  if (switch_) return;  // It may need the parts that are folded. The next session that leaves folds more.
  std::vector<SessionId> shown, hidden;  // The oldest first.
  for (const SessionId session : layers_) (joint_.hidden().contains(session) ? hidden : shown).push_back(session);
  for (std::size_t i = 0; i + max_past_sessions_ < hidden.size(); ++i) {
    joint_.Remove(hidden[i]);
    RemoveLayer(hidden[i]);
  }
  if (hidden.size() > max_past_sessions_) StoreSite();
  std::size_t first = 0;
  for (; first + max_past_sessions_ < shown.size(); ++first) {
    joint_.Fold(shown[first], shown[first + 1]);
    RemoveLayer(shown[first]);
  }
  if (first == 0) return;
  for (const std::uint32_t version : versions_.RemoveParts(shown[first])) StoreVersion(version);
  StoreLayer(shown[first]);
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
