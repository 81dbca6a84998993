#include "client/web/viewer.h"

#include "client/web/web_json.h"

namespace cairn::web {
namespace {

std::string Event(const std::string& name, const std::string& json) {
  return "event: " + name + "\ndata: " + json + "\n\n";
}

}  // namespace

StateTexts::Text StateTexts::Get(const ServerView& view, const std::string& site) {
  const MutexLock lock(mutex_);
  const auto found = written_.find(site);
  if (found != written_.end() && found->second.view == view.number) return found->second.text;
  auto text = std::make_shared<const std::string>(StateJson(view, site, commands_));
  if (found != written_.end() && found->second.view > view.number) return text;
  // The same text stays the same object, so that a viewer need not compare the whole of it.
  if (found != written_.end() && *found->second.text == *text) {
    found->second.view = view.number;
    return found->second.text;
  }
  if (written_.size() > kMaxSites) written_.clear();
  written_[site] = {.view = view.number, .text = text};
  return text;
}

std::string Viewer::NextPiece() {
  constexpr std::chrono::milliseconds kLongest{500};
  constexpr std::chrono::seconds kSilence{10};
  std::string piece;
  const auto view = watch_.WaitForNewer(view_, kLongest);
  if (view->number > view_) AddView(*view, piece);
  if (map_) AddTiles(piece);
  // A line now and then, so that a proxy between here and the browser does not close a silent connection.
  const auto now = Clock::now();
  if (piece.empty() && now - told_ > kSilence) piece = ": still here\n\n";
  if (!piece.empty()) told_ = now;
  return piece;
}

void Viewer::AddView(const ServerView& view, std::string& piece) {
  view_ = view.number;
  const StateTexts::Text state = states_.Get(view, site_);
  if (state != state_) piece += Event("state", *state);
  state_ = state;
  const auto flow = view.flows.find(site_);
  if (flow == view.flows.end() || flow->second->back().time_ms <= flow_ms_) return;
  piece += Event("flow", FlowJson(*flow->second, flow_ms_));
  flow_ms_ = flow->second->back().time_ms;
}

void Viewer::AddTiles(std::string& piece) {
  const client::TileChanges changes = map_->map().ChangesSince(tiles_);
  tiles_ = changes.now;
  if (changes.whole || !changes.changed.empty()) piece += Event("tiles", TilesJson(changes));
}

}  // namespace cairn::web
