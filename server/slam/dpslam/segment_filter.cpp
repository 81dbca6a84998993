#include "server/slam/dpslam/segment_filter.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace cairn::slam {
namespace {

// Cost of drawing relative to evaluating: all rays of all scans are drawn, but only a part is evaluated.
constexpr std::size_t kDrawingCost = 4;
// Distance between scans used for the comparison: more scans would show the same walls from the same places.
constexpr double kComparedApartM = 2.0;
constexpr double kComparedApartRad = 0.5;
// Smallest share of the evidence introduced at a time; bounds the work.
constexpr double kLeastTemperingStep = 0.01;
constexpr double kFirstStride = 0.5;
// If the log likelihoods of best and worst differ by less, there is no evidence.
constexpr double kDecisive = 1.0;
constexpr std::size_t kOpen = 3;  // Segments that are evaluated again with the next one.
// Effective share of the particles after each introduction of evidence.
constexpr double kKeep = 0.25;
constexpr std::size_t kUsualEvaluations = 24;  // Usual number of evaluations of a segment with evidence.

Eigen::AlignedBox2d SeenFrom(const Evidence& trajectory) {
  Eigen::AlignedBox2d box;
  for (const PlacedRays& placed : trajectory) {
    box.extend(placed.T_start_robot.translation());
    for (const LaserRay& ray : placed.rays->rays)
      box.extend(placed.T_start_robot * Eigen::Vector2d(placed.rays->origin_robot + ray.length_m * ray.direction));
  }
  return box;
}

Evidence Apart(const Evidence& trajectory) {
  Evidence apart;
  for (const PlacedRays& placed : trajectory) {
    if (!apart.empty()) {
      const Pose2 away = Between(apart.back().T_start_robot, placed.T_start_robot);
      if (away.translation().norm() < kComparedApartM && std::abs(away.theta) < kComparedApartRad) continue;
    }
    apart.push_back(placed);
  }
  return apart;
}

Eigen::Vector3d Draw(Rng& rng) {
  const double x = NormalDraw(rng), y = NormalDraw(rng), theta = NormalDraw(rng);
  return {x, y, theta};
}

// The share of the drift that a particle draws: evenly distributed over 0..1 and 0 for the first. Multiples
// of the golden ratio give neighbours, which are relatives, very different shares.
double ShareOfDrift(std::size_t particle) {
  const double turns = 0.6180339887498949 * static_cast<double>(particle);
  return turns - std::floor(turns);
}

}  // namespace

void SegmentFilter::Take(std::vector<Evidence> trajectories, double way_m, Rng& rng) {
  Segment segment;
  segment.trajectories = std::move(trajectories);
  segment.seen_start = SeenFrom(segment.trajectories.front());
  segment.scans = segment.trajectories.front().size();
  for (const Evidence& trajectory : segment.trajectories) {
    segment.T_start_end.push_back(trajectory.back().T_start_robot);
    segment.compared.push_back(Apart(trajectory));
  }
  // The drift of a whole segment is added at the joint where it begins (thesis C 4.5.2); the first segment
  // has none.
  if (!segments_.empty())
    segment.drift_sigma = level_.options().drift.Covariance({way_m, 0.0, 0.0}).diagonal().cwiseSqrt();
  segments_.push_back(std::move(segment));
  const Segment& taken = segments_.back();

  free_ = std::min(fixed_, segments_.size() - 1);
  candidates_.clear();
  std::vector<Pose2> starts;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    Candidate candidate{i, {}, level_.particles()[i].log_weight};
    for (std::size_t k = free_; k < joints_[i].size(); ++k) candidate.joints.push_back(joints_[i][k]);
    Joint joint{ShareOfDrift(i) * Draw(rng), {}, 0};
    if (const std::size_t choices = taken.trajectories.size(); choices > 1)
      joint.trajectory =
          std::min(choices - 1, static_cast<std::size_t>(UniformDraw(rng) * static_cast<double>(choices)));
    candidate.joints.push_back(joint);
    Place(candidate);
    starts.push_back(candidate.joints.back().T_map_start);
    candidates_.push_back(std::move(candidate));
  }

  to_draw_.clear();
  const Eigen::AlignedBox2d seen = SeenBy(taken, starts);
  for (std::size_t s = 0; s + 1 < segments_.size(); ++s) {
    if (!segments_[s].forgotten || segments_[s].drawn) continue;
    for (std::size_t i = 0; i < starts.size(); ++i) starts[i] = joints_[i][s].T_map_start;
    if (SeenBy(segments_[s], starts).intersects(seen)) to_draw_.push_back(s);
  }
  // Segments that are drawn can no longer move.
  if (!to_draw_.empty() && to_draw_.back() >= free_) {
    const auto fixed = static_cast<std::ptrdiff_t>(to_draw_.back() + 1 - free_);
    free_ = to_draw_.back() + 1;
    for (Candidate& candidate : candidates_)
      candidate.joints.erase(candidate.joints.begin(), candidate.joints.begin() + fixed);
  }
  std::erase_if(open_, [&](std::size_t s) { return s < free_; });
  for (std::size_t s = 0; s < free_; ++s) segments_[s].compared = {};
  open_.push_back(segments_.size() - 1);
  log_likelihoods_.clear();
  proposed_.clear();
  tempering_ = 0.0;
  std::fill(stride_.begin(), stride_.end(), kFirstStride);
  moved_ = false;
  moves_left_ = 0;
  at_work_ = true;
  share_ =
      2 * candidates_.size() * (kUsualEvaluations * open_.size() + kDrawingCost * to_draw_.size()) / taken.scans + 1;
  StartDrawing();
}

// Computes the placements from the first free joint on.
void SegmentFilter::Place(Candidate& candidate) const {
  const GridParticle& parent = level_.particles()[candidate.parent];
  Pose2 T_map_joint = parent.T_map_robot;  // Start if there are no joints yet.
  if (free_ > 0 && !joints_[candidate.parent].empty()) {
    const Joint& before = joints_[candidate.parent][free_ - 1];
    T_map_joint = before.T_map_start * segments_[free_ - 1].T_start_end[before.trajectory];
  }
  for (std::size_t k = 0; k < candidate.joints.size(); ++k) {
    const Segment& segment = segments_[free_ + k];
    Joint& joint = candidate.joints[k];
    const Eigen::Vector3d d = segment.drift_sigma.cwiseProduct(joint.drift);
    joint.T_map_start = T_map_joint * Pose2{d.x(), d.y(), WrapAngle(d.z())};
    T_map_joint = joint.T_map_start * segment.T_start_end[joint.trajectory];
  }
}

Eigen::AlignedBox2d SegmentFilter::SeenBy(const Segment& segment, const std::vector<Pose2>& starts) const {
  using Box = Eigen::AlignedBox2d;
  Box box;
  for (const Pose2& T_map_start : starts)
    for (const auto corner : {Box::BottomLeft, Box::BottomRight, Box::TopLeft, Box::TopRight})
      box.extend(T_map_start * Eigen::Vector2d(segment.seen_start.corner(corner)));
  return box;
}

std::vector<MapSample> SegmentFilter::SamplesOf(std::size_t segment) const {
  std::vector<MapSample> samples;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const Joint& joint = joints_[i][segment];
    samples.push_back({joint.T_map_start, level_.particles()[i].map, joint.trajectory});
  }
  return samples;
}

MapSample SegmentFilter::SampleOf(const Candidate& candidate, std::size_t segment) const {
  const Joint& joint = candidate.joints[segment - free_];
  return {joint.T_map_start, level_.particles()[candidate.parent].map, joint.trajectory};
}

void SegmentFilter::StartDrawing() {
  children_.clear();
  if (!to_draw_.empty()) drawings_ = LevelFilter::Distinct(SamplesOf(to_draw_.back()));
}

std::size_t SegmentFilter::DrawSome(std::size_t count, const ParallelFor& parallel_for) {
  Segment& segment = segments_[to_draw_.back()];
  count = std::min(count, drawings_.distinct.size() - children_.size());
  std::vector<Ancestry::Child> more = level_.maps().Draw(std::span(drawings_.distinct).subspan(children_.size(), count),
                                                         segment.trajectories, parallel_for);
  std::move(more.begin(), more.end(), std::back_inserter(children_));
  if (children_.size() == drawings_.distinct.size()) {
    level_.Adopt(drawings_, std::exchange(children_, {}));
    segment.trajectories.clear();
    segment.drawn = true;
    to_draw_.pop_back();
    StartDrawing();
  }
  return count;
}

void SegmentFilter::Work(Rng& rng, const ParallelFor& parallel_for) {
  for (std::size_t left = share_; left > 0 && at_work_;) {
    if (!to_draw_.empty()) {
      const std::size_t drawn = DrawSome(std::max<std::size_t>(left / kDrawingCost, 1), parallel_for);
      left -= std::min(left, kDrawingCost * drawn);
      continue;
    }
    if (level_.maps().blank()) return Finish();
    left -= EvaluateSome(left, parallel_for);
    if (log_likelihoods_.size() < candidates_.size() * open_.size()) continue;
    const bool first = tempering_ == 0.0 && proposed_.empty();
    Enter(proposed_.empty() ? candidates_ : proposed_);
    for (std::size_t i = 0; first && i < candidates_.size(); ++i)
      candidates_[i].before = level_.particles()[i].log_likelihood - candidates_[i].settled;
    if (!proposed_.empty()) Accept(rng);
    if (moves_left_ == 0) RaiseTempering(rng);
    if (moves_left_ > 0) {
      Propose(rng);
    } else {
      Finish();
    }
  }
}

std::size_t SegmentFilter::EvaluateSome(std::size_t count, const ParallelFor& parallel_for) {
  const std::vector<Candidate>& subjects = proposed_.empty() ? candidates_ : proposed_;
  const std::size_t segment = open_[log_likelihoods_.size() / subjects.size()];
  std::vector<MapSample> samples;
  for (std::size_t i = log_likelihoods_.size() % subjects.size(); i < subjects.size() && samples.size() < count; ++i)
    samples.push_back(SampleOf(subjects[i], segment));
  const std::vector<double> more = level_.LogLikelihoods(samples, segments_[segment].compared, parallel_for);
  log_likelihoods_.insert(log_likelihoods_.end(), more.begin(), more.end());
  return samples.size();
}

void SegmentFilter::Enter(std::vector<Candidate>& subjects) {
  const double share = level_.options().evidence_share;
  for (std::size_t i = 0; i < subjects.size(); ++i) {
    subjects[i].settled = 0.0;
    for (std::size_t e = 0; e + 1 < open_.size(); ++e)
      subjects[i].settled += share * log_likelihoods_[e * subjects.size() + i];
    subjects[i].evidence = share * log_likelihoods_[(open_.size() - 1) * subjects.size() + i];
  }
  log_likelihoods_.clear();
}

// Introduces as much more of the evidence as leaves enough effective particles. If that is not all of it, the
// particles are resampled and moved.
void SegmentFilter::RaiseTempering(Rng& rng) {
  const auto size = static_cast<double>(candidates_.size());
  const auto weights_with = [&](double more) {
    std::vector<double> log_weights;
    for (const Candidate& candidate : candidates_)
      log_weights.push_back(candidate.log_weight + more * candidate.evidence);
    return NormalisedWeights(log_weights);
  };
  double more = 1.0 - tempering_;
  const bool all = EffectiveSampleSize(weights_with(more)) >= level_.options().resample_below * size;
  if (!all) {
    double low = 0.0, high = more;
    for (int i = 0; i < 30; ++i) {
      const double middle = 0.5 * (low + high);
      (EffectiveSampleSize(weights_with(middle)) >= kKeep * size ? low : high) = middle;
    }
    more = std::min(more, std::max(low, kLeastTemperingStep));
  }
  tempering_ += more;
  if (all) {
    for (Candidate& candidate : candidates_) candidate.log_weight += more * candidate.evidence;
    return;
  }
  candidates_ = Resampled(candidates_, StratifiedSurvivors(weights_with(more), rng));
  for (Candidate& candidate : candidates_) candidate.log_weight = 0.0;
  moves_left_ = kMoves;
  moved_ = true;
}

void SegmentFilter::Propose(Rng& rng) {
  proposed_ = candidates_;
  // Moves alternate between all free joints and only the last one, on which the segments evaluated before do
  // not depend.
  const double stride = stride_[moves_left_ % 2], stay = std::sqrt(1.0 - stride * stride);
  for (Candidate& candidate : proposed_) {
    const std::size_t first = moves_left_ % 2 == 0 ? 0 : candidate.joints.size() - 1;
    for (std::size_t k = first; k < candidate.joints.size(); ++k)
      candidate.joints[k].drift = stay * candidate.joints[k].drift + stride * Draw(rng);
    Place(candidate);
  }
}

void SegmentFilter::Accept(Rng& rng) {
  std::size_t accepted = 0;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    const double gain =
        proposed_[i].settled - candidates_[i].settled + tempering_ * (proposed_[i].evidence - candidates_[i].evidence);
    if (!(std::log(UniformDraw(rng)) < gain)) continue;
    candidates_[i] = std::move(proposed_[i]);
    ++accepted;
  }
  proposed_.clear();
  // About a quarter of the proposals should be accepted (Roberts et al. 1997).
  const double rate = static_cast<double>(accepted) / static_cast<double>(candidates_.size());
  double& stride = stride_[moves_left_ % 2];
  stride = std::min(1.0, stride * (rate < 0.15 ? 0.5 : rate > 0.4 ? 1.5 : 1.0));
  --moves_left_;
}

void SegmentFilter::Finish() {
  const auto [least, most] =
      std::minmax_element(candidates_.begin(), candidates_.end(),
                          [](const Candidate& a, const Candidate& b) { return a.evidence < b.evidence; });
  const bool decisive = most->evidence - least->evidence > kDecisive || moved_;
  const std::size_t first_scan = [&] {
    std::size_t scans = 0;
    for (std::size_t s = 0; s < free_; ++s) scans += segments_[s].scans;
    return scans;
  }();
  std::vector<GridParticle> particles;
  std::vector<SharedSequence<Joint>> joints;
  for (const Candidate& candidate : candidates_) {
    GridParticle particle = level_.particles()[candidate.parent];
    SharedSequence<Joint> all = joints_[candidate.parent];
    particle.log_weight = candidate.log_weight;
    if (decisive) particle.log_likelihood = candidate.before + candidate.settled + candidate.evidence;
    particle.log_prior = 0.0;
    for (std::size_t s = 0; s < free_; ++s) particle.log_prior -= 0.5 * all[s].drift.squaredNorm();
    std::size_t scan = first_scan;
    for (std::size_t k = 0; k < candidate.joints.size(); ++k) {
      particle.log_prior -= 0.5 * candidate.joints[k].drift.squaredNorm();
      const Joint& joint = candidate.joints[k];
      const bool done = free_ + k < all.size();
      if (!done) all.Append(joint);
      if (done && decisive) all.Mutable(free_ + k) = joint;
      if (done && !decisive) {
        scan += segments_[free_ + k].scans;
        continue;
      }
      for (const PlacedRays& placed : segments_[free_ + k].trajectories[joint.trajectory]) {
        particle.T_map_robot = joint.T_map_start * placed.T_start_robot;
        if (done) {
          particle.path.Set(scan++, particle.T_map_robot);
        } else {
          particle.path.Append(particle.T_map_robot);
        }
      }
    }
    particles.push_back(std::move(particle));
    joints.push_back(std::move(all));
  }
  joints_ = std::move(joints);
  level_.Replace(std::move(particles));
  fixed_ = std::max(fixed_, free_);
  if (!decisive) open_.pop_back();
  if (open_.size() > kOpen) {
    fixed_ = open_.front() + 1;
    open_.erase(open_.begin());
  }

  // Removes maps that no particle owns.
  std::vector<MapSample> maps;
  for (const GridParticle& particle : level_.particles()) maps.push_back({{}, particle.map, 0});
  const LevelFilter::Drawings owned = LevelFilter::Distinct(maps);
  std::vector<Ancestry::Child> children;
  for (const MapSample& sample : owned.distinct) children.push_back({sample.map, {}});
  level_.Adopt(owned, std::move(children));
  Forget();
  at_work_ = false;
}

// Marks the segments that now lie wholly beyond the low level's memory: they are drawn when the robot comes
// near them.
void SegmentFilter::Forget() {
  const Eigen::Vector2d here = level_.best().T_map_robot.translation();
  for (std::size_t s = 0; s < segments_.size(); ++s) {
    if (segments_[s].forgotten) continue;
    const Joint& joint = joints_[level_.best_index()][s];
    const Evidence& way = segments_[s].trajectories[joint.trajectory];
    segments_[s].forgotten = std::all_of(way.begin(), way.end(), [&](const PlacedRays& placed) {
      return ((joint.T_map_start * placed.T_start_robot).translation() - here).norm() > memory_m_;
    });
  }
}

std::size_t SegmentFilter::bytes() const {
  std::size_t sum = level_.maps().ancestry().bytes();
  for (const Segment& segment : segments_)
    if (!segment.drawn)
      for (const PlacedRays& placed : segment.trajectories.front()) sum += placed.rays->rays.size() * sizeof(LaserRay);
  return sum;
}

OccupancyImage SegmentFilter::MapImage() const {
  std::vector<PlacedRays> undrawn;
  const SharedSequence<Joint>& joints = joints_[level_.best_index()];
  for (std::size_t s = 0; s < joints.size(); ++s) {
    if (segments_[s].drawn) continue;
    for (const PlacedRays& placed : segments_[s].trajectories[joints[s].trajectory])
      undrawn.push_back({placed.rays, joints[s].T_map_start * placed.T_start_robot});
  }
  return level_.maps().Image(level_.best().map, undrawn);
}

}  // namespace cairn::slam
