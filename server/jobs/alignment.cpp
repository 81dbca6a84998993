#include "server/jobs/alignment.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

#include "server/slam/grid/disagreement.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {
namespace {

constexpr std::size_t kComparedEvery = 4;  // Keyframes.
constexpr double kSameAgreement = 0.005;   // Shares that differ by less are the same.
// The mean square of how far scans are off the maps of others has to fall to this share of it, because a new map
// version moves every robot that drives.
constexpr double kBetter = 0.9;
constexpr double kAlignAgainAfter = 2.0;  // Ratio of keyframes, while a robot waits for being joined.
// New keyframes of one robot that are enough. One is made every 0.25 m, or sooner where the robot turns.
constexpr std::uint64_t kMostBetween = 1000;

using PathOf = std::function<const std::vector<Pose2>&(std::size_t session)>;

// How far the scans of each session disagree with the maps of the others, along these paths.
std::optional<double> DisagreementAlong(const std::vector<SessionMaterial>& material,
                                        const std::vector<slam::SmoothedSession>& joint,
                                        const std::vector<std::size_t>& sessions, const PathOf& path_of,
                                        const std::function<bool()>& go_on) {
  slam::Disagreement all;
  for (const std::size_t drawn : sessions) {
    slam::OccupancyGrid grid(material[drawn].grid_options);
    const auto& keyframes = material[drawn].snapshot.keyframes;
    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      if (!go_on()) return std::nullopt;
      if (keyframes[k].localized) grid.Draw(*keyframes[k].scan, path_of(drawn)[k]);
    }
    for (const std::size_t other : sessions) {
      if (other == drawn || joint[other].frame != joint[drawn].frame) continue;
      const auto& seen = material[other].snapshot.keyframes;
      for (std::size_t k = 0; k < seen.size(); k += kComparedEvery) {
        if (!go_on()) return std::nullopt;
        if (seen[k].localized) all.Add(*seen[k].scan, path_of(other)[k], grid);
      }
    }
  }
  return all.mean_m2();
}

}  // namespace

bool Alignment::IsBetter() const {
  return moved_m > cell_m && after_m2 < kBetter * before_m2 && agreement >= agreement_before - kSameAgreement;
}

std::optional<Alignment> AlignmentOf(const std::vector<SessionMaterial>& material,
                                     const std::vector<slam::SmoothedSession>& joint,
                                     const std::function<bool()>& go_on) {
  Alignment alignment;
  std::vector<std::size_t> sessions;
  for (std::size_t i = 0; i < material.size(); ++i) {
    if (!material[i].start_known || !joint[i].joined) continue;
    sessions.push_back(i);
    alignment.cell_m = material[i].grid_options.resolution_m;
    alignment.agreement_before += joint[i].agreement_before;
    alignment.agreement += joint[i].agreement;
    const std::vector<Pose2>& online = material[i].snapshot.online_path;
    for (std::size_t k = 0; k < online.size(); ++k)
      alignment.moved_m =
          std::max(alignment.moved_m, (joint[i].path[k].translation() - online[k].translation()).norm());
  }
  if (alignment.moved_m <= alignment.cell_m) return alignment;
  alignment.agreement_before /= static_cast<double>(sessions.size());
  alignment.agreement /= static_cast<double>(sessions.size());
  const auto before = DisagreementAlong(
      material, joint, sessions,
      [&](std::size_t i) -> const std::vector<Pose2>& { return material[i].snapshot.online_path; }, go_on);
  if (!before) return std::nullopt;
  const auto after = DisagreementAlong(
      material, joint, sessions, [&](std::size_t i) -> const std::vector<Pose2>& { return joint[i].path; }, go_on);
  if (!after) return std::nullopt;
  alignment.before_m2 = *before;
  alignment.after_m2 = *after;
  return alignment;
}

bool AlignmentPace::IsDue(const std::string& site, const std::vector<SessionMaterial>& material) {
  Known now;
  bool waits = false;
  for (const SessionMaterial& session : material) {
    if (session.start_known) {
      now[session.session] = session.snapshot.made();
    }
    waits = waits || (!session.start_known && session.joinable && !session.snapshot.keyframes.empty());
  }
  Known& before = sites_.try_emplace(site).first->second;
  const auto sum = [](const Known& known) {
    return std::accumulate(known.begin(), known.end(), std::uint64_t{0},
                           [](std::uint64_t made, const auto& one) { return made + one.second; });
  };
  const bool joined = now.size() > before.size();
  const std::uint64_t made = sum(now), made_before = sum(before);
  const bool more = made < made_before ||
                    static_cast<double>(made) >= kAlignAgainAfter * static_cast<double>(made_before) ||
                    std::ranges::any_of(now, [&before](const auto& one) {
                      const auto then = before.find(one.first);
                      return one.second >= kMostBetween + (then == before.end() ? 0 : then->second);
                    });
  const bool due = !waits || (!joined && more);
  if (due || joined) before = std::move(now);
  return due;
}

void AlignmentPace::KeepOnly(const std::function<bool(const std::string&)>& exists) {
  std::erase_if(sites_, [&exists](const auto& one) { return !exists(one.first); });
}

}  // namespace cairn::server
