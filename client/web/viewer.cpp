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
  if (written_.size() > kMaxSites && written_.count(site) == 0) written_.clear();
  return Renew(written_[site], view.number, [&] { return StateJson(view, site, commands_); });
}

StateTexts::Text StateTexts::Doctor(const ServerView& view) {
  const MutexLock lock(mutex_);
  return Renew(doctor_, view.number, [&] { return DoctorJson(view); });
}

template <typename Write>
StateTexts::Text StateTexts::Renew(Written& written, std::uint64_t view, const Write& write) {
  if (written.text && written.view == view) return written.text;
  auto text = std::make_shared<const std::string>(write());
  if (written.text && written.view > view) return text;
  written.view = view;
  // The same text stays the same object, so that a viewer need not compare the whole of it.
  if (!written.text || *written.text != *text) written.text = std::move(text);
  return written.text;
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
  const StateTexts::Text doctor = states_.Doctor(view);
  if (doctor != doctor_) piece += Event("doctor", *doctor);
  doctor_ = doctor;
  const auto flow = view.flows.find(site_);
  if (flow == view.flows.end() || flow->second->back().time_ms <= flow_ms_) return;
  piece += Event("flow", FlowJson(*flow->second, flow_ms_));
  flow_ms_ = flow->second->back().time_ms;
}

void Viewer::AddTiles(std::string& piece) {
  const client::TileChanges changes = pacer_.Next(map_->map().ChangesSince(tiles_), Clock::now());
  tiles_ = changes.now;
  if (changes.whole || !changes.changed.empty()) piece += Event("tiles", TilesJson(changes));
}

}  // namespace cairn::web
