#include "server/slam/recovery/recovery.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

// Scans that are kept: turning on the spot makes many. Those that are being searched for are kept until that has ended.
constexpr std::size_t kMaxRecent = 120;
constexpr std::size_t kMaxHeld = 120;  // Keyframes that may be added to the path at once: bounds the time of one scan.
// Scans for which a place that a job has found is looked at: a minute of most lidars.
constexpr int kMaxScansSuggested = 600;
// Standard deviations of the place of another map relative to that of the robot, where both show it.
constexpr double kOtherMapSigmaM = 0.1, kOtherMapSigmaRad = 0.01;
constexpr double kUnknownM = 1000.0;  // Standard deviation of a place that is not known.
constexpr double kNever = -1.0;       // No search yet.
constexpr double kSigmas = 3.0;       // The search near a pose reaches so far, in standard deviations.
// Of a robot that has been followed: how the doubt grows with the way, how far from the track it is looked for at most,
// and how often everywhere.
constexpr double kDriftPerM = 0.01;
constexpr double kDriftRadPerM = 0.0005;
constexpr double kFarthestM = 10.0;
constexpr double kEverywhereEveryM = 4.0;
// The stretches with which it is looked for near the track, and on how much way with one of them.
constexpr std::array kStretchesM = {kStretchM, 6.0, 3.0};
constexpr double kNextStretchM = 0.25;
// Where the map ends much of what the robot sees is not in it. A place that explains little is believed if so many
// searches near the track in a row found it, which takes kNextStretchM of way for each, and no other place fitted.
constexpr std::size_t kAgreeAtTheEdge = 4;
// Work of the search in the whole map with one scan (PoseSearch; 60,000 blocks take 5 ms). A robot that is probably on
// its path is waited for by nobody. One that is lost, or may have been carried, is to be found soon.
constexpr int kBlocksOnPath = 60'000;
constexpr int kBlocksLost = 100'000;

}  // namespace

void Recovery::Begin(const Known& known, bool odometry_goes_on) {
  End();
  active_ = true;
  odometry_goes_on_ = odometry_goes_on;
  known_ = known;
}

void Recovery::BeginWhereSaid(const Known& known) {
  Begin(known, true);
  said_ = true;
}

void Recovery::BeginNear(const Known& known, const Pose2& T_map_track) {
  BeginOnPath(known, T_map_track);
  said_ = true;
}

void Recovery::BeginOnPath(const Known& known, const Pose2& T_map_track) {
  Begin(known, true);
  T_map_track_ = T_map_track;
}

void Recovery::Move(const Pose2& T_new_old) {
  const Eigen::Matrix3d J = J_compose_right(T_new_old, known_.T_map_robot);
  known_.T_map_robot = T_new_old * known_.T_map_robot;
  known_.covariance = J * known_.covariance * J.transpose();
  if (T_map_track_) T_map_track_ = T_new_old * *T_map_track_;
  ForgetMap();  // What is unconfirmed may lie at other places of the map, which have moved otherwise.
}

void Recovery::End() {
  active_ = false;
  said_ = false;
  contradicted_ = false;
  ForgetScans();
  search_.Forget();
}

void Recovery::ForgetScans() {
  suggestion_.reset();
  LeavePath();
  recent_.clear();
  unconfirmed_.clear();
  StopSearch();
}

void Recovery::StopSearch() {
  search_.Stop();
  searched_at_m_ = kNever;
}

bool Recovery::Suggest(Stamp seen, const Pose2& T_map_robot, std::shared_ptr<const SearchedMap> map) {
  const auto scan = std::ranges::find_if(recent_, [seen](const RecentScan& one) { return one.scan->stamp == seen; });
  if (!active_ || scan == recent_.end()) return false;
  const Candidate place{T_map_robot * scan->T_track_robot.Inverse(), scan->travelled_m};
  const RecentScan& now = recent_.back();
  const bool found_elsewhere = !unconfirmed_.empty() &&
                               now.travelled_m - unconfirmed_.back().travelled_m <= kConfirmWithinM &&
                               !Agree(unconfirmed_.back(), place.T_map_track * now.T_track_robot);
  if (found_elsewhere) return false;
  suggestion_.emplace(Suggestion{place, std::move(map), search_, kMaxScansSuggested});
  suggestion_->search.Forget();
  return true;
}

void Recovery::AgeSuggestion() {
  if (suggestion_ && --suggestion_->scans_left <= 0) suggestion_.reset();
}

// Like a place that was found here: by a second search, some way later, which agrees.
std::optional<FoundPlace> Recovery::ConfirmSuggestion() {
  if (!suggestion_) return std::nullopt;
  const RecentScan& now = recent_.back();
  const double way_m = now.travelled_m - suggestion_->place.travelled_m;
  if (way_m > kConfirmWithinM) suggestion_.reset();
  if (!suggestion_ || way_m < loop_.confirm_after_m) return std::nullopt;
  const Pose2 T_map_robot = suggestion_->place.T_map_track * now.T_track_robot;
  auto place = suggestion_->search.FindNear(*suggestion_->map, recent_, T_map_robot);
  if (place && !ConfirmEachOther(T_map_robot, place->T_map_robot)) place.reset();
  return place;
}

std::vector<Pose2> Recovery::Unconfirmed() const {
  std::vector<Pose2> places;
  if (!has_scans()) return places;
  const Pose2& T_track_robot = recent_.back().T_track_robot;
  for (const Candidate& one : unconfirmed_) places.push_back(one.T_map_track * T_track_robot);
  if (suggestion_) places.push_back(suggestion_->place.T_map_track * T_track_robot);
  return places;
}

void Recovery::LeavePath() {
  if (T_map_track_) StopSearch();  // It began where the path leads.
  doubt_.reset();
  T_map_track_.reset();
  held_.clear();
}

void Recovery::RestorePoints() {
  for (RecentScan& one : recent_) one.points = SurfacePointsOf(PointsOf(*one.scan), *one.scan, surface_);
}

Pose2 Recovery::FromLast(const Pose2& T_track_robot) const {
  return Between(recent_.back().T_track_robot, T_track_robot);
}

void Recovery::Append(const Keyframe& keyframe, const TrackStep& step, std::vector<SurfacePoint> points_robot) {
  double travelled_m = 0.0;
  if (has_scans()) {
    const double before_m = recent_.back().travelled_m;
    // It grows with each scan, so that it says which scan is meant.
    travelled_m = std::max(before_m + FromLast(step.T_track_robot).translation().norm(),
                           std::nextafter(before_m, std::numeric_limits<double>::infinity()));
  }
  recent_.push_back({keyframe.scan.Share(), step.T_track_robot, travelled_m, std::move(points_robot)});
  if (!search_.searching()) KeepLastStretch();  // Otherwise some of them are being searched for.
  if (held_.size() > kMaxHeld) LeavePath();
}

void Recovery::KeepLastStretch() {
  const auto kept = std::ranges::find_if(
      recent_, [&](const RecentScan& one) { return recent_.back().travelled_m - one.travelled_m <= kStretchM; });
  const std::size_t old =
      std::max(static_cast<std::size_t>(kept - recent_.begin()), recent_.size() - std::min(recent_.size(), kMaxRecent));
  recent_.erase(recent_.begin(), recent_.begin() + static_cast<std::ptrdiff_t>(old));
}

std::optional<Recovery::Found> Recovery::Take(const Keyframe& keyframe, const TrackStep& step,
                                              std::vector<SurfacePoint> points_robot, const SearchedMap& map) {
  if (std::exchange(restored_, false)) SearchAgain(map);
  Append(keyframe, step, std::move(points_robot));
  if (doubt_ && !was_carried()) return std::nullopt;
  if (auto place = ConfirmSuggestion()) {
    const bool own = search_.Compare(map, *recent_.back().scan, recent_.back().points, place->T_map_robot) ==
                     PlaceSearch::Agreement::kAgrees;
    if (own) place->covariance += PoseCovariance(kOtherMapSigmaM, kOtherMapSigmaRad);
    return Found{*place, false, !own};
  }
  const Pose2 T_map_robot = BeliefAt(keyframe.T_odom_robot, step.T_track_robot).T_map_robot;
  contradicted_ = search_.Compare(map, *recent_.back().scan, recent_.back().points, T_map_robot) ==
                  PlaceSearch::Agreement::kContradicts;
  const bool followed = said_ && T_map_track_.has_value();
  if (contradicted_ && !followed) LeavePath();
  if (followed) {
    if (const auto place = FindNearTrack(map, T_map_robot)) return Found{*place, false};
  } else if (said_) {
    if (const auto place = search_.FindNear(map, recent_, T_map_robot)) return Found{*place, false};
  }
  const auto place = SearchOn(map);
  if (!place) return std::nullopt;
  return Found{*place, T_map_track_ && IsNear(T_map_robot, place->T_map_robot)};
}

// Where a robot is that was followed to about `T_map_robot`.
std::optional<FoundPlace> Recovery::FindNearTrack(const SearchedMap& map, const Pose2& T_map_robot) {
  const auto [reach_m, reach_rad] = ReachOfTrack();
  const auto returned = search_.FindReturned(map, LastPart(), T_map_robot, reach_m, reach_rad);
  if (!returned) return std::nullopt;
  const FoundPlace& place = returned->place;
  if (returned->clear && IsNear(T_map_robot, place.T_map_robot)) return place;
  // Farther from where the track leads, one search is no proof.
  const bool confirmed = IsConfirmed(place.T_map_robot, recent_.back().travelled_m);
  if (!confirmed || (!returned->clear && unconfirmed_.size() < kAgreeAtTheEdge)) return std::nullopt;
  return place;
}

// Searches on in the whole map. Returns the robot's place once two searches agree.
std::optional<FoundPlace> Recovery::SearchOn(const SearchedMap& map) {
  const double travelled_m = recent_.back().travelled_m;
  if (search_.searching()) {
    // What it has found is looked at with the next scan: that takes as long as a part of the search, and if the robot
    // is on its path, all keyframes since then are added to it.
    if (!search_.complete()) {
      search_.GoOn(BlocksPerScan());
      return std::nullopt;
    }
    const PlaceSearch::Ended ended = search_.End(map, recent_);
    if (doubt_) {
      doubt_->searched = true;
      const Pose2 T_map_believed = *T_map_track_ * recent_.back().T_track_robot;
      if (ended.best && !IsNear(T_map_believed, ended.best->T_map_robot)) doubt_->likely = true;
    }
    const auto& place = ended.found;
    if (place && IsConfirmed(place->T_map_robot, searched_at_m_)) return place;
  }
  const bool followed = said_ && T_map_track_.has_value();
  double every_m = followed ? kEverywhereEveryM : loop_.every_m;
  if (!unconfirmed_.empty()) every_m = std::max(every_m, loop_.confirm_after_m);
  const bool due =
      searched_at_m_ == kNever ? !followed || travelled_m >= every_m : travelled_m - searched_at_m_ >= every_m;
  if (due) {
    KeepLastStretch();  // Where one search follows the other, scans are let go of only here.
    BeginSearch(map, recent_);
  }
  return std::nullopt;
}

void Recovery::BeginSearch(const SearchedMap& map, std::span<const RecentScan> recent) {
  searched_at_m_ = recent.back().travelled_m;
  std::optional<Pose2> T_map_believed;
  if (T_map_track_) T_map_believed = *T_map_track_ * recent.back().T_track_robot;
  search_.Begin(map, recent, T_map_believed);
}

int Recovery::BlocksPerScan() const {
  return T_map_track_ && !doubt_ ? kBlocksOnPath : kBlocksLost;
}

// After a restart: one part was done with each scan since the search began.
void Recovery::SearchAgain(const SearchedMap& map) {
  const auto last = std::ranges::find(recent_, searched_at_m_, &RecentScan::travelled_m);
  if (last == recent_.end()) return;
  BeginSearch(map, {recent_.begin(), last + 1});
  for (auto scan = last + 1; scan != recent_.end() && search_.searching(); ++scan) {
    if (search_.complete()) {
      search_.Stop();
    } else {
      search_.GoOn(BlocksPerScan());
    }
  }
}

bool Recovery::IsNear(const Pose2& T_map_believed, const Pose2& T_map_found) const {
  const Pose2 error = Between(T_map_believed, T_map_found);
  return error.translation().norm() < options_.on_path_m && std::abs(error.theta) < options_.on_path_rad;
}

// A robot that comes back into the map has seen for some metres what the map does not show, and that would count
// against its place. So the whole last stretch is used, its last 6 m and its last 3 m, in turn along the way.
std::span<const RecentScan> Recovery::LastPart() const {
  const double way_m = recent_.back().travelled_m;
  const double stretch_m = kStretchesM[static_cast<std::size_t>(way_m / kNextStretchM) % kStretchesM.size()];
  const auto first =
      std::ranges::find_if(recent_, [&](const RecentScan& one) { return way_m - one.travelled_m <= stretch_m; });
  return {first, recent_.end()};
}

// How far from where the track leads the robot may be.
std::pair<double, double> Recovery::ReachOfTrack() const {
  const double way_m = recent_.back().travelled_m;
  const double sigma_m = std::sqrt(known_.covariance.diagonal().head<2>().maxCoeff()) + kDriftPerM * way_m;
  const double sigma_rad = std::sqrt(known_.covariance(2, 2)) + kDriftRadPerM * way_m;
  return {std::min(kSigmas * sigma_m, kFarthestM), kSigmas * sigma_rad};
}

// All places found within kConfirmWithinM of way must agree.
bool Recovery::IsConfirmed(const Pose2& T_map_robot, double seen_m) {
  const RecentScan& now = recent_.back();
  // That of a job is one of them.
  if (suggestion_ && !Agree(suggestion_->place, T_map_robot)) {
    suggestion_.reset();
    unconfirmed_.clear();
  }
  if (!unconfirmed_.empty() &&
      (seen_m - unconfirmed_.back().travelled_m > kConfirmWithinM || !Agree(unconfirmed_.back(), T_map_robot)))
    unconfirmed_.clear();
  const bool confirmed = !unconfirmed_.empty() && Agree(unconfirmed_.front(), T_map_robot) &&
                         seen_m - unconfirmed_.front().travelled_m >= loop_.confirm_after_m;
  unconfirmed_.push_back({T_map_robot * now.T_track_robot.Inverse(), seen_m});
  return confirmed;
}

bool Recovery::Agree(const Candidate& earlier, const Pose2& T_map_robot) const {
  return ConfirmEachOther(earlier.T_map_track * recent_.back().T_track_robot, T_map_robot);
}

Recovery::Belief Recovery::BeliefAt(const Pose2& T_odom_robot, const Pose2& T_track_robot) const {
  if (!odometry_goes_on_) {
    const Eigen::Vector3d unknown(kUnknownM * kUnknownM, kUnknownM * kUnknownM, kPi * kPi);
    return {known_.T_map_robot, unknown.asDiagonal(), PoseReason::kLost};
  }
  const Pose2 moved = Between(known_.T_odom_robot, T_odom_robot);
  const Eigen::Matrix3d J_known = J_compose_left(known_.T_map_robot, moved);
  const Eigen::Matrix3d J_moved = J_compose_right(known_.T_map_robot, moved);
  Eigen::Matrix3d covariance =
      J_known * known_.covariance * J_known.transpose() + J_moved * blind_.Covariance(moved) * J_moved.transpose();
  const bool lost = contradicted_ || moved.translation().norm() > lost_after_m_;
  const PoseReason reason = lost ? PoseReason::kLost : PoseReason::kOdometryOnly;
  const Pose2 T_map_carried = known_.T_map_robot * moved;
  if (!T_map_track_) return {T_map_carried, covariance, reason};
  // The track may go on at a place that only looks like the last one, and odometry does not show that it was carried.
  const Pose2 T_map_tracked = *T_map_track_ * T_track_robot;
  Eigen::Vector3d apart;
  apart << T_map_tracked.translation() - T_map_carried.translation(),
      AngleDiff(T_map_tracked.theta, T_map_carried.theta);
  if (uses_odometry_) covariance += apart * apart.transpose();
  return {T_map_tracked, covariance, reason};
}

}  // namespace cairn::slam
