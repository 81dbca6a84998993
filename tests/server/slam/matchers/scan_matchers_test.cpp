// Tests every scan matcher in the same worlds. The table below lists the limits of each; server/slam/matchers/README.md
// shows the same numbers. If a matcher cannot do something, its result must report it. NDT slides along a corridor,
// because its cells at the end of the view move with the robot. It reports this (degenerate), and the front-end takes
// the position along the corridor from odometry.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <thread>

#include "server/slam/features/feature_extraction.h"
#include "server/slam/methods.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::World;

// The limits that are tested. Errors are of the position; the heading may be wrong by one degree for each
// centimetre of them.
struct Capability {
  MatcherKind kind;
  double exact_m;        // Worst error without noise.
  double bias_m;         // Mean error of many matches with 1 cm of range noise.
  double spread_m;       // Root mean square of the same errors.
  double basin_m;        // Initial errors up to this distance and ...
  double basin_rad;      // ... this angle always lead to the answer.
  double silent_share;   // Starts far outside: largest share of wrong answers that are reported as right.
  double narrowest_rad;  // Narrowest field of view that is sufficient.
  double slide_m;        // Largest motion of the answer from the prior along a corridor.
  bool crowd;            // Whether it finds the motion although half of the view moves.
};
constexpr auto kCapabilities = std::to_array<Capability>({
    {MatcherKind::kVoting, 0.002, 0.002, 0.004, 0.2, Radians(20), 0.02, Radians(90), 0.01, true},
    {MatcherKind::kLineLsq, 0.002, 0.001, 0.003, 0.3, Radians(5), 0.02, Radians(90), 0.01, true},
    {MatcherKind::kHough, 0.012, 0.006, 0.009, 0.7, Radians(30), 0.01, Radians(90), 0.01, true},
    {MatcherKind::kIcp, 0.002, 0.001, 0.003, 0.3, Radians(10), 0.01, Radians(90), 0.01, true},
    {MatcherKind::kCorrelative, 0.012, 0.004, 0.006, 0.4, Radians(15), 0.01, Radians(90), 0.01, true},
    {MatcherKind::kNdt, 0.002, 0.001, 0.004, 0.4, Radians(10), 0.01, Radians(90), 0.25, true},
    {MatcherKind::kNdtDe, 0.002, 0.001, 0.004, 0.5, Radians(20), 0.01, Radians(90), 0.25, true},
});

void PrintTo(const Capability& row, std::ostream* out) {
  *out << MatcherName(row.kind);
}

const MatcherOptions kOptions;
const Eigen::Matrix3d kVague = Eigen::Vector3d(0.09, 0.09, 0.04).asDiagonal();

ScanView ViewOf(const Scan& scan) {
  const std::vector<BeamPoint> points = PointsOf(scan);
  return {ExtractFeatures(points, scan, FeatureOptions{}), SurfacePointsOf(points, scan, SurfaceOptions{})};
}

ScanView ViewFrom(const World& world, const Pose2& pose, const Laser& laser, std::mt19937_64* engine = nullptr) {
  return ViewOf(test::Look(world, pose, laser, engine));
}

double Metres(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm();
}
double Turn(const Pose2& a, const Pose2& b) {
  return std::abs(AngleDiff(a.theta, b.theta));
}
bool Right(const MatchResult& match, const Pose2& truth) {
  return match.converged && Metres(match.T_ref_curr, truth) < 0.06 && Turn(match.T_ref_curr, truth) < Radians(2.0);
}

class ScanMatchers : public testing::TestWithParam<Capability> {
 protected:
  static MatchResult Match(const ScanView& prev, const ScanView& curr, const Pose2& guess,
                           const Eigen::Matrix3d& covariance = kVague) {
    return MakeMatcher(GetParam().kind, kOptions).match(prev, curr, {guess, covariance}, SerialFor);
  }
};

const Laser kLaser{.beams = 361, .step_rad = Radians(0.5)};
const Pose2 kStart{-0.5, 0.2, 0.15};

TEST_P(ScanMatchers, RecoverTheMotionExactlyWithoutNoise) {
  double worst = 0.0;
  for (const Pose2& motion : {Pose2{0.3, 0.05, 0.1}, Pose2{}, Pose2{0.0, 0.0, -Radians(15)}, Pose2{-0.2, 0.2, 0.05},
                              Pose2{0.25, -0.1, Radians(10)}}) {
    const Pose2 guess = motion * Pose2{-0.06, 0.04, 0.03};
    const MatchResult match =
        Match(ViewFrom(test::Office(), kStart, kLaser), ViewFrom(test::Office(), kStart * motion, kLaser), guess);
    ASSERT_TRUE(match.converged) << static_cast<int>(match.failure);
    EXPECT_TRUE(IsCovariance(match.covariance));
    EXPECT_FALSE(match.degenerate);
    EXPECT_GT(match.score, 0.5);
    EXPECT_GT(match.inliers, 0);
    worst = std::max(worst, Metres(match.T_ref_curr, motion));
    EXPECT_LT(Turn(match.T_ref_curr, motion), Radians(100.0) * GetParam().exact_m);
  }
  std::printf("%s: worst error without noise %.4f m\n", MatcherName(GetParam().kind).data(), worst);
  EXPECT_LT(worst, GetParam().exact_m);
}

TEST_P(ScanMatchers, NoiseGivesSpreadButHardlyBias) {
  std::mt19937_64 engine(3);
  Laser laser = kLaser;
  laser.sigma_m = 0.01;
  std::normal_distribution<double> off(0.0, 0.03);
  const Pose2 motion{0.25, 0.05, 0.12};
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double squares = 0.0;
  int matched = 0;
  constexpr int kRuns = 40;
  for (int run = 0; run < kRuns; ++run) {
    const MatchResult match = Match(ViewFrom(test::Office(), kStart, laser, &engine),
                                    ViewFrom(test::Office(), kStart * motion, laser, &engine),
                                    motion * Pose2{off(engine), off(engine), off(engine)});
    if (!match.converged) continue;
    ++matched;
    const Eigen::Vector2d error = match.T_ref_curr.translation() - motion.translation();
    sum += error;
    squares += error.squaredNorm();
  }
  const double bias = sum.norm() / std::max(1, matched), rms = std::sqrt(squares / std::max(1, matched));
  std::printf("%s: %d of %d matched, bias %.4f m, rms %.4f m\n", MatcherName(GetParam().kind).data(), matched, kRuns,
              bias, rms);
  EXPECT_GE(matched, kRuns * 19 / 20);
  EXPECT_LT(bias, GetParam().bias_m);
  EXPECT_LT(rms, GetParam().spread_m);
}

TEST_P(ScanMatchers, ConvergeFromEverywhereInTheirBasin) {
  const Pose2 motion{0.25, 0.05, 0.12};
  const ScanView prev = ViewFrom(test::Office(), kStart, kLaser),
                 curr = ViewFrom(test::Office(), kStart * motion, kLaser);
  int far = 0, silent = 0;
  // kNdtDe runs one population per start; more starts would be too slow.
  const int directions = GetParam().kind == MatcherKind::kNdtDe ? 1 : 6;
  std::printf("%s: share of starts that lead to the answer; rows m, columns deg\n       0    5   10   15   20   30\n",
              MatcherName(GetParam().kind).data());
  for (const double metres : {0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7}) {
    std::printf("%.1f", metres);
    for (const double degrees : {0.0, 5.0, 10.0, 15.0, 20.0, 30.0}) {
      int right = 0, tries = 0;
      for (int direction = 0; direction < directions; ++direction) {
        for (const double side : {-1.0, 1.0}) {
          const double angle = kPi / 3 * direction;
          const Pose2 guess{motion.x + metres * std::cos(angle), motion.y + metres * std::sin(angle),
                            motion.theta + side * Radians(degrees)};
          const MatchResult match = Match(prev, curr, guess, Eigen::Vector3d(0.25, 0.25, 0.25).asDiagonal());
          const bool found = Right(match, motion);
          const bool near = metres <= GetParam().basin_m + 1e-9 && Radians(degrees) <= GetParam().basin_rad + 1e-9;
          if (near) {
            EXPECT_TRUE(found) << metres << " m, " << side * degrees << " deg, towards " << angle;
          }
          if (!near) {
            ++far;
            silent += match.converged && !match.degenerate && !found ? 1 : 0;
          }
          if (!match.converged) {
            EXPECT_EQ(match.T_ref_curr, guess);
          }
          right += found ? 1 : 0;
          ++tries;
        }
      }
      std::printf("  %.2f", 1.0 * right / tries);
    }
    std::printf("\n");
  }
  std::printf("%s: %d of %d far starts answered wrongly without saying so\n", MatcherName(GetParam().kind).data(),
              silent, far);
  EXPECT_LE(1.0 * silent / std::max(1, far), GetParam().silent_share);
}

TEST_P(ScanMatchers, ACorridorIsFlaggedAndTheAnswerMovesAlongItAtMostAsFarAsStated) {
  World corridor;
  corridor.Add({{-50, -1}, {50, -1}}).Add({{-50, 1.2}, {50, 1.2}});
  Laser laser = kLaser;
  laser.range_max_m = 5.0;
  const Pose2 start{0, 0, 0.1}, motion{0.3, 0.03, 0.05}, guess{0.22, 0.0, 0.02};
  const MatchResult match = Match(ViewFrom(corridor, start, laser), ViewFrom(corridor, start * motion, laser), guess,
                                  Eigen::Vector3d(0.01, 0.01, 0.01).asDiagonal());
  ASSERT_TRUE(match.converged) << static_cast<int>(match.failure);
  EXPECT_TRUE(match.degenerate);
  const Eigen::Vector2d along(std::cos(0.1), -std::sin(0.1)), across(-along.y(), along.x());
  EXPECT_GT(std::abs(match.degenerate_direction.dot(along)), 0.99);
  const Eigen::Vector2d off = match.T_ref_curr.translation() - guess.translation();
  const Eigen::Vector2d error = match.T_ref_curr.translation() - motion.translation();
  std::printf("%s: corridor, %.3f m along from the prior, %.4f m across from the truth\n",
              MatcherName(GetParam().kind).data(), off.dot(along), error.dot(across));
  EXPECT_LT(std::abs(off.dot(along)), GetParam().slide_m);
  EXPECT_LT(std::abs(error.dot(across)), 0.03);
  EXPECT_LT(Turn(match.T_ref_curr, motion), Radians(1.0));
  const Eigen::Matrix2d spread = match.covariance.topLeftCorner<2, 2>();
  EXPECT_GT(along.dot(spread * along), 2.0 * across.dot(spread * across));
}

TEST_P(ScanMatchers, OneWallIsFlaggedAndTheAnswerMovesAlongItAtMostAsFarAsStated) {
  World wall;
  wall.Add({{3, -30}, {3, 30}});
  Laser laser = kLaser;
  laser.range_max_m = 6.0;
  const Pose2 motion{0.2, 0.05, 0.06}, guess{0.15, 0.02, 0.03};
  const MatchResult match = Match(ViewFrom(wall, {}, laser), ViewFrom(wall, motion, laser), guess,
                                  Eigen::Vector3d(0.01, 0.01, 0.01).asDiagonal());
  EXPECT_LT(std::abs(match.T_ref_curr.y - guess.y), GetParam().slide_m);
  if (!match.converged) {  // Also allowed: one wall is too little for some matchers. Then the prior is the answer.
    EXPECT_EQ(match.T_ref_curr, guess);
    return;
  }
  EXPECT_TRUE(match.degenerate);
  EXPECT_NEAR(match.T_ref_curr.x, motion.x, 0.04);
}

TEST_P(ScanMatchers, WithoutAScanThePriorIsTheAnswer) {
  const ScanView office = ViewFrom(test::Office(), kStart, kLaser), nothing;
  ScanView point;
  point.points_robot.push_back({{1, 0}, {-1, 0}});
  const Pose2 guess{0.2, 0.01, 0.3};
  for (const auto& [prev, curr] : {std::pair{&office, &nothing},
                                   {&nothing, &office},
                                   {&nothing, &nothing},
                                   {&office, &point},
                                   {&point, &office},
                                   {&point, &point}}) {
    const MatchResult match = Match(*prev, *curr, guess);
    EXPECT_FALSE(match.converged);
    EXPECT_NE(match.failure, MatchFailure::kNone);
    EXPECT_EQ(match.T_ref_curr, guess);
    EXPECT_TRUE(IsCovariance(match.covariance));
  }
}

TEST_P(ScanMatchers, AViewAsWideAsStatedIsSufficientAndANarrowerOneIsNeverSilentlyWrong) {
  const Pose2 motion{0.2, 0.05, 0.1};
  for (const double degrees : {90.0, 120.0, 180.0, 270.0, 360.0}) {
    const double view = Radians(degrees);
    const int beams = static_cast<int>(std::lround(2 * degrees)) + (degrees < 360.0 ? 1 : 0);
    const Laser laser{.beams = beams, .first_rad = -0.5 * view, .step_rad = Radians(0.5)};
    const MatchResult match =
        Match(ViewFrom(test::Office(), kStart, laser), ViewFrom(test::Office(), kStart * motion, laser),
              motion * Pose2{0.04, -0.04, 0.03});
    std::printf("%s: %3.0f deg of view: %s, error %.4f m\n", MatcherName(GetParam().kind).data(), degrees,
                match.converged ? "matched" : "not matched", Metres(match.T_ref_curr, motion));
    if (view >= GetParam().narrowest_rad - 1e-9) {
      EXPECT_TRUE(Right(match, motion));
    }
    if (match.converged && !match.degenerate) {  // An answer must not be wrong without a report.
      EXPECT_TRUE(Right(match, motion));
    }
  }
}

// A crowd: half of the beams end before the wall, in groups, at other places in each scan.
Scan Crowded(Scan scan, std::mt19937_64& engine) {
  std::uniform_real_distribution<double> share(0.3, 0.8);
  constexpr int kBunch = 12;
  std::vector<int> bunches;
  for (int begin = 0; begin < static_cast<int>(scan.ranges_m.size()); begin += kBunch) bunches.push_back(begin);
  std::shuffle(bunches.begin(), bunches.end(), engine);
  for (std::size_t k = 0; k < bunches.size() / 2; ++k) {
    const auto begin = static_cast<std::size_t>(bunches[k]), end = std::min(scan.ranges_m.size(), begin + kBunch);
    const auto range = static_cast<float>(share(engine)) * scan.ranges_m[begin];
    for (std::size_t i = begin; i < end; ++i) scan.ranges_m[i] = std::min(scan.ranges_m[i], range);
  }
  return scan;
}

TEST_P(ScanMatchers, InACrowdMostAnswersAreRightAndAtMostOneInTwentyIsSilentlyWrong) {
  std::mt19937_64 engine(8);
  const Laser laser = test::FullTurnLaser(720);
  const Pose2 motion{0.15, 0.05, 0.08};
  int right = 0, silent = 0;
  constexpr int kRuns = 20;
  for (int run = 0; run < kRuns; ++run) {
    const ScanView prev = ViewOf(Crowded(test::Look(test::Office(), kStart, laser), engine));
    const ScanView curr = ViewOf(Crowded(test::Look(test::Office(), kStart * motion, laser), engine));
    const MatchResult match = Match(prev, curr, motion * Pose2{0.05, -0.03, 0.03});
    right += Right(match, motion) ? 1 : 0;
    silent += match.converged && !Right(match, motion) ? 1 : 0;
  }
  std::printf("%s: half of the view moves: %d of %d right, %d silently wrong\n", MatcherName(GetParam().kind).data(),
              right, kRuns, silent);
  EXPECT_LE(silent, 1);
  if (GetParam().crowd) {
    EXPECT_GE(right, kRuns * 7 / 10);
  }
}

TEST_P(ScanMatchers, NeitherThreadsNorTheirOrderChangeTheAnswer) {
  const Pose2 motion{0.25, 0.05, 0.12};
  const ScanView prev = ViewFrom(test::Office(), kStart, kLaser),
                 curr = ViewFrom(test::Office(), kStart * motion, kLaser);
  const MatchResult a = Match(prev, curr, {0.2, 0, 0.1});
  const ParallelFor three_threads = [](int count, const std::function<void(int, int)>& body) {
    std::jthread first([&] { body(0, count / 3); }), second([&] { body(count / 3, 2 * count / 3); });
    body(2 * count / 3, count);
  };
  const ParallelFor backwards = [](int count, const std::function<void(int, int)>& body) {
    for (int end = count; end > 0; end -= 3) body(std::max(0, end - 3), end);
  };
  for (const ParallelFor& parallel_for : {three_threads, backwards}) {
    const MatchResult b =
        MakeMatcher(GetParam().kind, kOptions).match(prev, curr, {{0.2, 0, 0.1}, kVague}, parallel_for);
    EXPECT_EQ(a.T_ref_curr, b.T_ref_curr);
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_EQ(a.score, b.score);
    EXPECT_EQ(a.inliers, b.inliers);
  }
}

INSTANTIATE_TEST_SUITE_P(All, ScanMatchers, testing::ValuesIn(kCapabilities),
                         [](const testing::TestParamInfo<Capability>& row) {
                           return std::string(MatcherName(row.param.kind));
                         });

TEST(ScanMatching, EveryKindHasANameAndARow) {
  EXPECT_EQ(MatcherNames().size(), kCapabilities.size());
  for (std::size_t k = 0; k < MatcherNames().size(); ++k) {
    const auto kind = static_cast<MatcherKind>(k);
    EXPECT_FALSE(MatcherName(kind).empty());
    EXPECT_TRUE(std::any_of(kCapabilities.begin(), kCapabilities.end(),
                            [kind](const Capability& row) { return row.kind == kind; }));
  }
}

}  // namespace
}  // namespace cairn::slam
