// What people have said about a site's map (site.h).
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <utility>

#include "server/maps/answer_once.h"
#include "server/maps/site.h"

namespace cairn::server {

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
    if (auto added = site.edits_.Add(std::move(edit)); !added) return done(tl::unexpected(added.error()));
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
