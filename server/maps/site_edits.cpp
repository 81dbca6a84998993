// What people have said about a site's map (site.h).
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "server/maps/answer_once.h"
#include "server/maps/site.h"

namespace cairn::server {
namespace {

slam::ChunkKey TileAt(const Eigen::Vector2d& point, double resolution_m) {
  const Eigen::Vector2d tile = (point / (kTileCells * resolution_m)).array().floor();
  return {static_cast<int>(tile.x()), static_cast<int>(tile.y())};
}

}  // namespace

std::uint64_t Site::ShowEdits() {
  joint_.SetEdits(edits_.overlay());
  info_changed_ = true;
  StoreSite();
  Render();
  Send();
  return edits_.version();
}

// A tile far away would make the whole map too large for those who draw it or are localised in it.
Result<void> Site::CheckNear(const MapEdit& edit) const {
  if (edit.kind == MapEditKind::kOrigin) return {};  // It makes no tile.
  constexpr double kNear_m = 20.0;
  const auto box = joint_.DrawnBox();
  if (!box) return Fail(StatusCode::kFailedPrecondition, "nothing is drawn in site '" + name_ + "' yet");
  const double tile_m = kTileCells * resolution_m_;
  const auto& [low, high] = *box;
  const Eigen::AlignedBox2d drawn(Eigen::Vector2d(low.x, low.y) * tile_m,
                                  Eigen::Vector2d(high.x + 1, high.y + 1) * tile_m);
  for (const Eigen::Vector2d& point : edit.points_map) {
    if (drawn.exteriorDistance(point) <= kNear_m) continue;
    return Fail(
        StatusCode::kFailedPrecondition,
        fmt::format("the edit reaches more than {} m beyond what is drawn in site '{}', which is from {:.1f},{:.1f} "
                    "to {:.1f},{:.1f} m",
                    kNear_m, name_, drawn.min().x(), drawn.min().y(), drawn.max().x(), drawn.max().y()));
  }
  return {};
}

// The tile of a point says which sessions have drawn there. Sessions that still exist come before layers, because
// layers are corrected only by switches of the version. Where nobody has drawn, all sessions are asked.
EditAnchors Site::AnchorsOf(const MapEdit& edit, AnchorTo to) const {
  const auto sessions_at = [&](const Eigen::Vector2d& point) {
    std::vector<SessionId> drawn_by = joint_.DrawnBy(TileAt(point, resolution_m_));
    if (drawn_by.empty())
      for (const auto& [session, drawn] : paths_) drawn_by.push_back(session);
    std::vector<SessionId> living, gone;
    for (const SessionId session : drawn_by)
      if (paths_.contains(session)) (layers_.contains(session) ? gone : living).push_back(session);
    return living.empty() && to == AnchorTo::kAll ? gone : living;
  };
  const auto sees = [this](const Eigen::Vector2d& from, const Eigen::Vector2d& point) { return Sees(from, point); };
  return server::AnchorsOf(edit, paths_, {sessions_at, sees});
}

// Whether nothing stands between the two places in the map as it is shown. The wall on which the point may lie, and
// what is beside it, do not count.
bool Site::Sees(const Eigen::Vector2d& from, const Eigen::Vector2d& point) const {
  constexpr double kBesidePoint_m = 0.3;
  constexpr int kOccupiedFrom = 65, kMostOccupied = 100;
  const double way_m = (point - from).norm() - kBesidePoint_m;
  for (double at_m = 0.0; at_m < way_m; at_m += resolution_m_) {
    const Eigen::Vector2d cell = (from + (point - from).normalized() * at_m) / resolution_m_;
    const int x = static_cast<int>(std::floor(cell.x())), y = static_cast<int>(std::floor(cell.y()));
    const TileKey key{0, FloorDiv(x, kTileCells), FloorDiv(y, kTileCells)};
    const auto tile = joint_.cells().find(key);
    if (tile == joint_.cells().end()) continue;
    const int index = (y - key.y * kTileCells) * kTileCells + x - key.x * kTileCells;
    const int value = (*tile->second)[static_cast<std::size_t>(index)];
    if (value >= kOccupiedFrom && value <= kMostOccupied) return false;
  }
  return true;
}

// Edits that hang on nothing, because an older server has stored them or nothing else was there, or on layers alone.
bool Site::AnchorNew() {
  const auto on_nothing = [this](const EditAnchors& anchors) {
    return std::ranges::all_of(anchors.keyframes,
                               [this](const EditAnchor& one) { return layers_.contains(one.session); });
  };
  return edits_.AnchorAgain(on_nothing, [this](const MapEdit& edit) -> std::optional<EditAnchors> {
    auto anchors = AnchorsOf(edit, AnchorTo::kLiving);
    if (anchors.keyframes.empty()) return std::nullopt;
    return anchors;
  });
}

void Site::ForgetPath(SessionId session) {
  paths_.erase(session);
}

void Site::AnchorElsewhere(SessionId session) {
  const auto is_lost = [session](const EditAnchors& anchors) {
    return std::ranges::find(anchors.keyframes, session, &EditAnchor::session) != anchors.keyframes.end();
  };
  static_cast<void>(
      edits_.AnchorAgain(is_lost, [this](const MapEdit& edit) { return AnchorsOf(edit, AnchorTo::kAll); }));
}

void Site::FollowPaths(const DrawnPaths& changed) {
  DrawnPaths now;
  for (const auto& [session, drawn] : changed) {
    if (joint_.hidden().contains(session)) {
      ForgetPath(session);
    } else if (drawn.path != nullptr) {
      now.emplace(session, drawn);
    }
  }
  if (now.empty()) return;
  bool anchored = false;
  if (!edits_.all()->empty()) {
    // Keyframes may have been retired. What hangs on them is anchored anew before anything moves: to keyframes of which
    // it is known where they lay before and where they lie now.
    for (const auto& [session, drawn] : now) {
      const auto known = paths_.find(session);
      paths_[session] = known == paths_.end() ? drawn : PosesBefore(known->second, drawn);
    }
    const auto is_lost = [&now](const EditAnchors& anchors) {
      return std::ranges::any_of(anchors.keyframes, [&now](const EditAnchor& one) {
        const auto drawn = now.find(one.session);
        return drawn != now.end() && drawn->second.Find(one.keyframe) == nullptr;
      });
    };
    anchored = edits_.AnchorAgain(is_lost, [this](const MapEdit& edit) { return AnchorsOf(edit, AnchorTo::kAll); });
    if (!members_.empty()) anchored = AnchorNew() || anchored;
  }
  for (const auto& [session, drawn] : now) paths_[session] = drawn;
  const bool moved = edits_.Follow(now);
  if (moved) {
    joint_.SetEdits(edits_.overlay());
    info_changed_ = true;
  }
  if (moved || anchored) StoreSite();
}

void Site::ForgetEditsOfLostMap() {
  Run([](Site& site) {
    if (site.joint_.drawn() || site.edits_.all()->empty()) return;
    spdlog::warn(
        "site {}: {} edits are removed, because a robot begins the map anew and nothing of the old one is left",
        site.name_, site.edits_.all()->size());
    site.edits_.Clear();
    site.ShowEdits();
  });
}

void Site::AddEdit(MapEdit&& edit, EditDone done) {
  Run([edit = std::move(edit), done = Once<std::uint64_t>(std::move(done))](Site& site) mutable {
    if (site.retired_) return done(Fail(StatusCode::kNotFound, "site '" + site.name_ + "' was deleted"));
    if (auto valid = ValidateMapEdit(edit); !valid) return done(tl::unexpected(valid.error()));
    if (auto near = site.CheckNear(edit); !near) return done(tl::unexpected(near.error()));
    EditAnchors anchors = site.AnchorsOf(edit, AnchorTo::kAll);
    if (auto added = site.edits_.Add(std::move(edit), std::move(anchors)); !added)
      return done(tl::unexpected(added.error()));
    done(site.ShowEdits());
  });
}

void Site::RemoveEdit(std::uint64_t id, EditDone done) {
  Run([id, done = Once<std::uint64_t>(std::move(done))](Site& site) {
    if (site.retired_) return done(Fail(StatusCode::kNotFound, "site '" + site.name_ + "' was deleted"));
    if (auto removed = site.edits_.Remove(id); !removed) return done(tl::unexpected(removed.error()));
    done(site.ShowEdits());
  });
}

}  // namespace cairn::server
