#include "server/slam/known_grid/grid_localisation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "server/slam/tracking/blind_motion.h"

namespace cairn::slam {
namespace {

constexpr double kMinScore = 0.4;     // Share of the points that must lie on surfaces of the map.
constexpr double kGuessSigmaM = 0.1;  // The alignment may correct the pose by some of these.
constexpr double kGuessSigmaRad = 0.03;
constexpr double kMapSigmaM = 0.02;  // Errors of the map: less than half a cell.
constexpr double kMapSigmaRad = 0.003;
// With more doubt than this the robot is followed on, but it is not localized: three standard deviations reach half a
// metre, which is another place.
constexpr double kLocalizedSigmaM = 0.17;
constexpr double kLocalizedSigmaRad = 0.07;
constexpr double kLostSigmaM = 0.5;  // With more doubt than this the robot is lost.
constexpr double kLostSigmaRad = 0.15;
constexpr double kCompareEveryM = 0.5;  // As the self-check of a robot that maps.
constexpr double kStretchOfComparisonsM = 5.0;
constexpr int kMinCompared = 100;  // Points over a stretch.

bool IsBeyond(const Eigen::Matrix3d& covariance, double sigma_m, double sigma_rad) {
  const double most = sigma_m * sigma_m;
  return covariance(0, 0) > most || covariance(1, 1) > most || covariance(2, 2) > sigma_rad * sigma_rad;
}

// The symmetric part of a matrix without its negative eigenvalues.
Eigen::Matrix3d PositivePart(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(0.5 * (matrix + matrix.transpose()));
  return axes.eigenvectors() * axes.eigenvalues().cwiseMax(0.0).asDiagonal() * axes.eigenvectors().transpose();
}

}  // namespace

bool GridLocalisation::Place::localized() const {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance.topLeftCorner<2, 2>());
  return reason != PoseReason::kLost && axes.eigenvalues().maxCoeff() <= kLocalizedSigmaM * kLocalizedSigmaM &&
         covariance(2, 2) <= kLocalizedSigmaRad * kLocalizedSigmaRad;
}

GridLocalisation::GridLocalisation(const GridLocalisationOptions& options)
    : options_(options),
      recovery_(options.recovery, options.loop, options.self_check, options.align, options.surface, options.blind,
                options.uses_odometry, options.lost_after_m) {
  options_.align.min_score = kMinScore;
}

void GridLocalisation::Begin(std::shared_ptr<const KnownGrid> map, const Recovery::Known& known, bool said) {
  map_ = std::move(map);
  comparisons_.clear();
  last_ = {known.T_map_robot, known.covariance, PoseReason::kLost};
  T_odom_robot_ = known.T_odom_robot;
  said_ = said;
  recovery_.Begin(known, false);
}

void GridLocalisation::Replace(std::shared_ptr<const KnownGrid> map) {
  map_ = std::move(map);
  recovery_.ForgetMap();
  if (!looking()) LookNear();
}

void GridLocalisation::LookNear() {
  comparisons_.clear();
  last_.reason = PoseReason::kLost;
  recovery_.BeginNear({last_.T_map_robot, T_odom_robot_, last_.covariance}, T_map_track());
}

void GridLocalisation::Lose(bool odometry_goes_on) {
  comparisons_.clear();
  last_.reason = PoseReason::kLost;
  recovery_.Begin({last_.T_map_robot, T_odom_robot_, last_.covariance}, odometry_goes_on);
}

void GridLocalisation::Doubt(const SceneAgreement& before, double score, bool at_several_places) {
  last_.reason = PoseReason::kLost;
  recovery_.BeginOnPath({last_.T_map_robot, T_odom_robot_, last_.covariance}, T_map_track());
  recovery_.BeginDoubt(before, score, at_several_places);
}

void GridLocalisation::BeginWhereSaid(const Pose2& T_map_robot) {
  const PlaceSearchOptions& place = options_.recovery.place;
  last_ = {T_map_robot, PoseCovariance(place.near_m, place.near_rad), PoseReason::kLost};
  comparisons_.clear();
  said_ = true;
}

GridLocalisation::Place GridLocalisation::CarriedTo(const Pose2& T_odom_robot) const {
  if (looking() || said_) {
    const Recovery::Belief belief = recovery_.BeliefAt(T_odom_robot, T_track_robot_);
    return {belief.T_map_robot, belief.covariance, PoseReason::kLost};
  }
  const Pose2 moved = Between(T_odom_robot_, T_odom_robot);
  const Eigen::Matrix3d J = J_compose_right(last_.T_map_robot, moved);
  const double blind_m = unmatched_m_ + moved.translation().norm();
  const Eigen::Matrix3d covariance = last_.covariance + J * options_.blind.Covariance(moved) * J.transpose();
  const PoseReason reason = blind_m > options_.lost_after_m ? PoseReason::kLost : PoseReason::kOdometryOnly;
  return {last_.T_map_robot * moved, covariance, reason};
}

GridLocalisation::Followed GridLocalisation::Take(const Sight& sight) {
  // Only now it is known where odometry has the robot that somebody has said to be there.
  if (std::exchange(said_, false))
    recovery_.BeginWhereSaid({last_.T_map_robot, sight.scan.T_odom_robot, last_.covariance});
  Followed followed = recovery_.active() ? Look(sight) : Follow(sight);
  last_ = followed.place;
  T_odom_robot_ = sight.scan.T_odom_robot;
  T_track_robot_ = sight.step.T_track_robot;
  return followed;
}

bool GridLocalisation::IsCleared(const Sight& sight) const {
  if (!sight.step.matched || recovery_.was_carried()) return false;
  const SeenScan now{*sight.scan.scan, sight.points_robot, sight.step.T_track_robot, sight.step.score};
  // The first scan since then was matched with what it may not belong to.
  const std::vector<RecentScan>& recent = recovery_.recent();
  const auto since = std::span(recent).subspan(std::min<std::size_t>(1, recent.size()));
  return !StaysDifferent(recovery_.doubt()->before, AgreementWithMap({*map_, T_map_track()}, now),
                         ConflictWith(since, now));
}

// The robot is looked for, or doubted.
GridLocalisation::Followed GridLocalisation::Look(const Sight& sight) {
  if (recovery_.doubt()) {
    if (IsCleared(sight) || recovery_.doubted_in_vain()) {
      recovery_.End();
      last_.reason = PoseReason::kOdometryOnly;  // Until the next alignment.
      return Follow(sight);
    }
    AddStep(sight.step);
  }
  // The second scan of a doubted robot is the first that is matched with what it belongs to.
  const std::size_t recent = recovery_.recent().size();
  const bool keep = recent == 0 || (recovery_.doubt() && recent == 1) ||
                    MovedEnough(Between(T_track_kept_, sight.step.T_track_robot), options_.gate);
  if (keep) {
    T_track_kept_ = sight.step.T_track_robot;
    if (const auto found = recovery_.Take(sight.scan, sight.step, sight.points_robot, *map_)) {
      recovery_.End();
      comparisons_.clear();
      fix_ = {found->place.T_map_robot, found->place.covariance, sight.step.T_track_robot};
      blind_covariance_.setZero();
      unmatched_m_ = 0.0;
      Align(sight, fix_);
      return {{fix_.T_map_robot, fix_.covariance, PoseReason::kTracking}, true};
    }
  }
  const Recovery::Belief belief = recovery_.BeliefAt(sight.scan.T_odom_robot, sight.step.T_track_robot);
  return {{belief.T_map_robot, belief.covariance, PoseReason::kLost}, keep};
}

// The pose that the way since the last fix leads to.
GridLocalisation::Fix GridLocalisation::Predicted(const TrackStep& step) const {
  const Pose2 moved = Between(fix_.T_track_robot, step.T_track_robot);
  const Eigen::Matrix3d J_fix = J_compose_left(fix_.T_map_robot, moved);
  const Eigen::Matrix3d J_moved = J_compose_right(fix_.T_map_robot, moved);
  return {fix_.T_map_robot * moved,
          J_fix * fix_.covariance * J_fix.transpose() +
              J_moved * (options_.drift.Covariance(moved) + blind_covariance_) * J_moved.transpose(),
          step.T_track_robot};
}

// What the step adds to the way, and to what no scan has measured of it.
void GridLocalisation::AddStep(const TrackStep& step) {
  const double step_m = (step.T_track_robot.translation() - T_track_robot_.translation()).norm();
  way_m_ += step_m;
  if (options_.uses_odometry) {
    blind_covariance_ = UnmeasuredAfter(blind_covariance_, step, fix_.T_track_robot, options_.odometry_walk);
  } else if (!step.matched) {
    blind_covariance_ += options_.blind.Covariance({step_m, 0.0, 0.0});
  }
  unmatched_m_ = step.matched ? 0.0 : unmatched_m_ + step_m;
}

GridLocalisation::Followed GridLocalisation::Follow(const Sight& sight) {
  const TrackStep& step = sight.step;
  AddStep(step);
  Fix now = Predicted(step);
  PoseReason reason = step.matched ? last_.reason : PoseReason::kOdometryOnly;
  const bool moved_enough = MovedEnough(Between(fix_.T_track_robot, step.T_track_robot), options_.gate);
  bool contradicted = false, fixed = false;
  if (moved_enough) {
    fixed = Align(sight, now);
    if (fixed) unmatched_m_ = 0.0;
    reason = fixed ? PoseReason::kTracking : PoseReason::kOdometryOnly;
    fix_ = now;
    blind_covariance_.setZero();
    contradicted = Contradicted(sight, now.T_map_robot);
  }
  last_ = {now.T_map_robot, now.covariance, reason};
  T_odom_robot_ = sight.scan.T_odom_robot;
  T_track_kept_ = step.T_track_robot;
  if (contradicted) {
    Lose(true);
  } else if (unmatched_m_ > options_.lost_after_m || IsBeyond(now.covariance, kLostSigmaM, kLostSigmaRad)) {
    LookNear();
  }
  return {last_, moved_enough && (step.matched || fixed)};
}

bool GridLocalisation::Align(const Sight& sight, Fix& fix) const {
  const Eigen::Matrix3d prior = fix.covariance + PoseCovariance(kGuessSigmaM, kGuessSigmaRad);
  const MatchResult match = AlignPointsToSurfaces(sight.points_robot, map_->surfaces(),
                                                  {fix.T_map_robot, fix.T_map_robot, prior}, options_.align);
  if (!match.converged) return false;
  const Eigen::Vector3d error(match.T_ref_curr.x - fix.T_map_robot.x, match.T_ref_curr.y - fix.T_map_robot.y,
                              AngleDiff(match.T_ref_curr.theta, fix.T_map_robot.theta));
  constexpr double kChiSquare3 = 16.3;  // 0.999
  if (error.dot(prior.ldlt().solve(error)) > kChiSquare3) return false;
  // What the scan itself tells, without the prior that took part in the alignment, and less by the errors of the map.
  // Where it shows nothing, as along a corridor, the doubt stays.
  const Eigen::Matrix3d information = match.covariance.inverse();
  const Eigen::Matrix3d measured = PositivePart(information - prior.inverse());
  const Eigen::Matrix3d less =
      (Eigen::Matrix3d::Identity() + measured * PoseCovariance(kMapSigmaM, kMapSigmaRad)).inverse();
  fix.covariance = PositivePart((fix.covariance.inverse() + PositivePart(less * measured)).inverse());
  const Eigen::Vector3d correction = fix.covariance * (less * (information * error));
  fix.T_map_robot = {fix.T_map_robot.x + correction.x(), fix.T_map_robot.y + correction.y(),
                     WrapAngle(fix.T_map_robot.theta + correction.z())};
  return true;
}

// Whether contradictions prevail over the last metres.
bool GridLocalisation::Contradicted(const Sight& sight, const Pose2& T_map_robot) {
  if (!comparisons_.empty() && way_m_ - comparisons_.back().way_m < kCompareEveryM) return false;
  comparisons_.push_back({way_m_, map_->Compare(*sight.scan.scan, sight.points_robot, T_map_robot)});
  while (way_m_ - comparisons_.front().way_m > kStretchOfComparisonsM) comparisons_.pop_front();
  VisibilityCounts all;
  for (const Comparison& one : comparisons_) all += one.counts;
  return all.known() >= kMinCompared && all.contradicted > options_.self_check.max_conflict * all.known();
}

}  // namespace cairn::slam
