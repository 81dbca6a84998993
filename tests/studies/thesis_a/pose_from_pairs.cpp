// Rotation and translation from the same selected pairs of lines, computed in several ways. Poses half-way: see
// server/slam/voting/pose_from_pairs.h.
#include "server/slam/voting/pose_from_pairs.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/slam/features/corners.h"
#include "server/slam/features/feature_extraction.h"
#include "server/slam/voting/voting.h"
#include "tests/studies/scene.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_a/thesis_a.h"

namespace cairn::studies {
namespace {

using slam::LineFeature;
using slam::LinePair;
using slam::ScanFeatures;

const LineFeature& Line(const ScanFeatures& features, int index) {
  return features.lines[static_cast<std::size_t>(index)];
}

// The way that the thesis advises against (3.5.12.3, Figure 3.29): it compares the points in which two matched lines
// meet in one scan and in the other.
std::optional<Eigen::Vector2d> TranslationFromCorners(const ScanFeatures& prev, const ScanFeatures& curr,
                                                      const std::vector<LinePair>& pairs, double rotation_rad,
                                                      bool real_only, const slam::PoseOptions& options) {
  const Eigen::Matrix2d R = Pose2{0, 0, rotation_rad}.rotation();
  std::vector<slam::WeightedVector> candidates;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.size(); ++j) {
      const LineFeature &a = Line(prev, pairs[i].ref), &b = Line(prev, pairs[j].ref);
      const LineFeature &c = Line(curr, pairs[i].curr), &d = Line(curr, pairs[j].curr);
      const auto in_prev = slam::MeetingPoint(a, b, options.crossing_rad),
                 in_curr = slam::MeetingPoint(c, d, options.crossing_rad);
      if (!in_prev || !in_curr) continue;
      const auto is_real = [](const ScanFeatures& features, int m, int n) {
        return std::any_of(features.corners.begin(), features.corners.end(), [&](const slam::CornerFeature& corner) {
          return corner.real &&
                 ((corner.line_a == m && corner.line_b == n) || (corner.line_a == n && corner.line_b == m));
        });
      };
      if (real_only && !(is_real(prev, pairs[i].ref, pairs[j].ref) && is_real(curr, pairs[i].curr, pairs[j].curr)))
        continue;
      candidates.push_back({*in_prev - R * *in_curr, std::sqrt(std::sqrt(a.length * b.length * c.length * d.length))});
    }
  }
  const slam::RobustMean mean = slam::MeanWithoutOutliers(std::move(candidates), options.translation_spread_m,
                                                          static_cast<int>(options.translation_keep));
  if (mean.kept == 0) return std::nullopt;
  return mean.mean;
}

// Error samples by the name of the way they were made; metres or degrees.
using Samples = std::map<std::string, std::vector<double>>;

constexpr char kPlain[] = "1 plain mean", kWeighted[] = "2 length-weighted mean (3.5.12.2, first step)",
               kThesis[] = "3 as 2, outliers removed (Table 3.27)",
               kOurs[] = "4 as 3, weighted by the square of the length (Cairn)";
constexpr char kVectors[] = "1 distance vectors of lines (Tables 3.28-3.31)", kAllCorners[] = "2 corner points, all",
               kRealCorners[] = "3 corner points, real corners only",
               kMatcher[] = "4 whole matcher (pairs that contradict the odometry are dropped)";

void CompareOnce(const ScanFeatures& prev, const ScanFeatures& curr, const Pose2& motion, const Pose2& odometry,
                 Samples& rotations, Samples& translations, int& unmatched) {
  slam::VotingOptions options;
  const slam::VotingMatch match = slam::MatchLinesByVoting(prev, curr, odometry, options);
  if (!match.result.converged || match.result.degenerate || match.pairs.size() < 3) {
    ++unmatched;
    return;
  }
  const auto rotation_with = [&](double power, double spread) {
    slam::PoseOptions pose = options.pose;
    pose.rotation_length_power = power;
    pose.rotation_spread_rad = spread;
    return slam::RotationFromPairs(prev, curr, match.pairs, pose)->rotation_rad;
  };
  const auto note = [&](const char* name, double rotation) {
    rotations[name].push_back(Degrees(std::abs(AngleDiff(rotation, motion.theta))));
  };
  note(kPlain, rotation_with(0.0, kPi));
  note(kWeighted, rotation_with(1.0, kPi));
  note(kThesis, rotation_with(1.0, options.pose.rotation_spread_rad));
  const double rotation = rotation_with(options.pose.rotation_length_power, options.pose.rotation_spread_rad);
  note(kOurs, rotation);

  // All ways get the same rotation and the same pairs. Only cases in which every way has an answer are counted.
  const auto offsets = slam::OffsetsOf(prev, curr, match.pairs, rotation, options.pose);
  const auto vectors = slam::TranslationFromOffsets(offsets, rotation, odometry.translation(), options.pose);
  const auto corners = TranslationFromCorners(prev, curr, match.pairs, rotation, false, options.pose);
  const auto real = TranslationFromCorners(prev, curr, match.pairs, rotation, true, options.pose);
  if (!vectors || vectors->degenerate || !corners || !real) return;
  const auto error = [&](const Eigen::Vector2d& translation) {
    return 100 * (translation - motion.translation()).norm();
  };
  translations[kVectors].push_back(error(vectors->translation));
  translations[kAllCorners].push_back(error(*corners));
  translations[kRealCorners].push_back(error(*real));
  translations[kMatcher].push_back(error(match.result.T_ref_curr.translation()));
}

Series Cumulative(const std::string& label, std::vector<double> samples) {
  std::sort(samples.begin(), samples.end());
  Series series{.label = label, .mark = Mark::kLine};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    series.x.push_back(std::max(samples[i], 1e-3));
    series.y.push_back(100.0 * static_cast<double>(i + 1) / static_cast<double>(samples.size()));
  }
  return series;
}

void AddComparison(Report& report, const Samples& samples, const std::string& what, const std::string& unit,
                   const std::string& name) {
  Table table({what + ", way", "cases", "mean (" + unit + ")", "median", "p95", "p99", "max"});
  Plot plot{.title = what + " error: share of cases below",
            .x = {"error", unit, true},
            .y = {"share of cases", "%", false, 0.0, 101.0}};
  for (const auto& [way, errors] : samples) {
    const Distribution d = DistributionOf(errors);
    table.Add({way, Count(static_cast<long long>(errors.size())), Number(d.mean, 3), Number(d.median, 3),
               Number(d.p95, 3), Number(d.p99, 3), Number(d.max, 2)});
    plot.series.push_back(Cumulative(way, errors));
  }
  report.Add(table, name);
  report.Add(plot, name + "_plot");
}

}  // namespace

void StudyPoseFromPairs(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Rotation and translation from matched lines (3.5.12.2, 3.5.12.3)");
  report.Text(
      "Each case consists of two simulated scans with 181 beams, at most 0.3 m and 15 deg apart, with "
      "a range noise of 1 cm and an odometry error of about 3 cm and 2 deg, in the worlds `room`, "
      "`building` and `office`. All ways of computing get the same pairs of lines, as the voting "
      "matcher selected them, including wrong ones. The thesis states (Figure 3.29) that distance "
      "vectors between lines are more exact than corner points, because errors of the slopes of the "
      "lines move the corner points.");
  Samples rotations, translations;
  int unmatched = 0;
  const int pairs = context.Pick(1500, 200);
  for (const char* world : {"room", "building", "office"}) {
    const Scene scene(world);
    sim::Random random(context.seed);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int i = 0; i < pairs; ++i) {
      const Pose2 from = scene.DrawPose(random);
      const Pose2 motion{0.3 * unit(random), 0.1 * unit(random), Radians(15) * unit(random)};
      if (scene.Clearance(from * motion) < 0.3) continue;
      const Pose2 odometry{motion.x + sim::Normal(random, 0.03), motion.y + sim::Normal(random, 0.03),
                           motion.theta + sim::Normal(random, Radians(2))};
      const auto see = [&](const Pose2& pose) {
        return slam::ExtractFeatures(scene.Look(pose, Sick(0.01), random), slam::FeatureOptions{});
      };
      const ScanFeatures prev = see(from), curr = see(from * motion);
      CompareOnce(prev, curr, motion, odometry, rotations, translations, unmatched);
    }
  }
  report.Text(Count(unmatched) + " of " + Count(3 * pairs) +
              " pairs of scans are left out because they did not match, show a corridor, or have fewer than "
              "three pairs of lines.");
  AddComparison(report, rotations, "Rotation", "deg", "rotation");
  AddComparison(report, translations, "Translation", "cm", "translation");
  const auto p95 = [](const Samples& samples, const char* way) { return DistributionOf(samples.at(way)).p95; };
  const bool as_thesis = p95(translations, kVectors) < p95(translations, kAllCorners);
  report.Text(as_thesis ? "The 95th percentile is smaller with distance vectors than with corner points, as the thesis "
                          "states."
                        : "The 95th percentile is no larger with corner points than with distance vectors, which the "
                          "thesis does not expect.");
  report.Expect(p95(rotations, kThesis) < 2.0 && p95(translations, kVectors) < 10.0 &&
                    p95(rotations, kThesis) <= p95(rotations, kPlain) * 1.05,
                "the errors are too large for correctly matched pairs, or removing outliers increases them");
}

}  // namespace cairn::studies
