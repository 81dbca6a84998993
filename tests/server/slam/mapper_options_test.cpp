// Options of the estimator that contradict each other are refused at the start, in words that name both keys.
#include "server/slam/mapper_options.h"

#include <gtest/gtest.h>

#include "common/options/config.h"

namespace cairn::slam {
namespace {

VisitOptions TreeOf(MapperOptions& options) {
  return [&options](OptionVisitor& visitor) { visitor.Section("slam", "", [&] { Visit(visitor, options); }); };
}

TEST(MapperOptions, TheDefaultsContradictNothing) {
  const auto result = Validate(MapperOptions());
  EXPECT_TRUE(result) << result.error().message;
}

struct Contradiction {
  const char* name;
  std::vector<std::string> broken;  // Just beyond what is allowed.
  std::vector<std::string> whole;   // Just allowed, or not contradicting because another part is off.
  const char* message;
};

class Contradictions : public testing::TestWithParam<Contradiction> {};

TEST_P(Contradictions, AreRefusedAndNamed) {
  MapperOptions broken;
  ASSERT_TRUE(ApplySet(GetParam().broken, TreeOf(broken)));
  const auto result = Validate(broken);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, GetParam().message);
}

TEST_P(Contradictions, AreNotSeenWhereThereAreNone) {
  MapperOptions whole;
  ASSERT_TRUE(ApplySet(GetParam().whole, TreeOf(whole)));
  const auto result = Validate(whole);
  EXPECT_TRUE(result) << result.error().message;
}

INSTANTIATE_TEST_SUITE_P(
    MapperOptions, Contradictions,
    testing::Values(
        Contradiction{"PairDistances",
                      {"slam.front_end.refine.last_pair_distance_m=0.6"},
                      {"slam.front_end.refine.last_pair_distance_m=0.5"},
                      "slam.front_end.refine.last_pair_distance_m (0.6) must not exceed "
                      "slam.front_end.refine.first_pair_distance_m (0.5)"},
        Contradiction{"PairDistancesOfIcp",
                      {"slam.matching.icp.last_pair_distance_m=0.6"},
                      {"slam.matching.icp.last_pair_distance_m=0.5"},
                      "slam.matching.icp.last_pair_distance_m (0.6) must not exceed "
                      "slam.matching.icp.first_pair_distance_m (0.5)"},
        Contradiction{"AssociationAcross",
                      {"slam.matching.line_lsq.association.max_across_m=0.6"},
                      {"slam.matching.line_lsq.association.max_across_m=0.5"},
                      "slam.matching.line_lsq.association.max_across_m (0.6) must not exceed "
                      "slam.matching.line_lsq.association.first_across_m (0.5)"},
        Contradiction{"AssociationSlope",
                      {"slam.matching.line_lsq.association.first_slope_rad=0.25",
                       "slam.matching.line_lsq.association.max_slope_rad=0.3"},
                      {"slam.matching.line_lsq.association.first_slope_rad=0.3",
                       "slam.matching.line_lsq.association.max_slope_rad=0.3"},
                      "slam.matching.line_lsq.association.max_slope_rad (0.3) must not exceed "
                      "slam.matching.line_lsq.association.first_slope_rad (0.25)"},
        Contradiction{"PointsOfALine",
                      {"slam.front_end.features.lines.min_points=9"},
                      {"slam.front_end.features.lines.min_points=8"},
                      "slam.front_end.features.lines.min_points (9) must not exceed "
                      "slam.front_end.features.lines.max_points_needed (8)"},
        Contradiction{"GridHit",
                      {"slam.grid.hit_probability=0.985"},
                      {"slam.grid.hit_probability=0.98"},
                      "slam.grid.hit_probability (0.985) must not exceed slam.grid.clamp_probability (0.98)"},
        Contradiction{"GridMiss",
                      {"slam.grid.miss_probability=0.01"},
                      {"slam.grid.miss_probability=0.01", "slam.grid.clamp_probability=0.995"},
                      "slam.grid.miss_probability (0.01) must be at least 1 minus slam.grid.clamp_probability (0.98)"},
        Contradiction{"GridNoReturn",
                      {"slam.grid.no_return_free_m=26"},
                      {"slam.grid.no_return_free_m=25"},
                      "slam.grid.no_return_free_m (26) must not exceed slam.grid.max_ray_m (25)"},
        Contradiction{"OpacityNoReturn",
                      {"slam.dpslam.opacity.no_return_m=21"},
                      {"slam.dpslam.opacity.no_return_m=20"},
                      "slam.dpslam.opacity.no_return_m (21) must not exceed slam.dpslam.opacity.max_ray_m (20)"},
        Contradiction{"DpSlamForgets",
                      {"slam.dpslam.segment.keep_m=19"},
                      {"slam.dpslam.segment.keep_m=19", "slam.dpslam.hierarchical=false"},
                      "slam.dpslam.segment.keep_m (19) must be at least slam.dpslam.opacity.max_ray_m (20)"},
        Contradiction{"DpSlamTrajectories",
                      {"slam.dpslam.segment.trajectories=201", "slam.filter=dpslam"},
                      {"slam.dpslam.segment.trajectories=201"},
                      "slam.dpslam.segment.trajectories (201) must not exceed slam.particles (200)"},
        Contradiction{"CorrectionWithoutLandmarks",
                      {"slam.filter=landmark_correction", "slam.landmarks.enabled=false"},
                      {"slam.filter=ekf", "slam.landmarks.enabled=false"},
                      "slam.filter (landmark_correction) has nothing to correct by without slam.landmarks.enabled "
                      "(false)"},
        Contradiction{"CorrelativeShifts",
                      {"slam.matching.correlative.window_m=0.05", "slam.matching.correlative.cell_m=0.06"},
                      {"slam.matching.correlative.window_m=0.06", "slam.matching.correlative.cell_m=0.06"},
                      "slam.matching.correlative.cell_m (0.06) must not exceed slam.matching.correlative.window_m "
                      "(0.05)"},
        Contradiction{"CorrelativeTurns",
                      {"slam.matching.correlative.turn_step_rad=0.4"},
                      {"slam.matching.correlative.turn_step_rad=0.3"},
                      "slam.matching.correlative.turn_step_rad (0.4) must not exceed "
                      "slam.matching.correlative.window_rad (0.3490658503988659)"},
        Contradiction{"NdtCells",
                      {"slam.matching.ndt.map.cell_m=2.5"},
                      {"slam.matching.ndt.map.cell_m=2.5", "slam.matching.ndt.coarse.cell_m=0"},
                      "slam.matching.ndt.coarse.cell_m (2) must be 0 or at least slam.matching.ndt.map.cell_m (2.5)"},
        Contradiction{"PairingGap",
                      {"slam.pairing.max_stamp_jump_s=1.5"},
                      {"slam.pairing.max_stamp_jump_s=2"},
                      "slam.pairing.max_gap_s (2) must not exceed slam.pairing.max_stamp_jump_s (1.5)"},
        Contradiction{"PlaceEvidence",
                      {"slam.line_match.places.memory=0.5"},
                      {"slam.line_match.places.memory=0.75"},
                      "slam.line_match.places.settled (3.5) must be below 1 / (1 - memory), with "
                      "slam.line_match.places.memory (0.5)"},
        Contradiction{"MergedKeyframes",
                      {"slam.front_end.reference_keyframes=7", "slam.front_end.use_odometry=false"},
                      {"slam.front_end.reference_keyframes=7"},
                      "slam.front_end.no_odometry.merged_keyframes (8) must not exceed "
                      "slam.front_end.reference_keyframes (7)"}),
    [](const auto& contradiction) { return std::string(contradiction.param.name); });

}  // namespace
}  // namespace cairn::slam
