// A few runs of the consistency study: the measure detects wrong covariances, and the mapper's stated
// uncertainty in a building has its known value.
#include "tests/studies/mapper/mapper_consistency.h"

#include <gtest/gtest.h>

namespace cairn::studies {
namespace {

MapperConsistency InTheBuilding(int runs, double seconds, double doubt_factor) {
  MapperConsistencyOptions options;
  options.runs = runs;
  options.mapper.filter.particles = 50;
  options.doubt_factor = doubt_factor;
  return StudyMapperConsistency(ConsistencyDrives(seconds).front(), options);
}

TEST(MapperConsistency, TwiceTheDoubtIsAQuarterOfTheNees) {
  const MapperConsistency as_reported = InTheBuilding(2, 15.0, 1.0), doubled = InTheBuilding(2, 15.0, 2.0);
  ASSERT_GE(as_reported.points.size(), 3U);
  EXPECT_NEAR(doubled.whole.nees, as_reported.whole.nees / 4.0, 1e-9);
  EXPECT_NEAR(doubled.whole.heading_nees, as_reported.whole.heading_nees / 4.0, 1e-9);
  EXPECT_EQ(doubled.whole.position_error_m, as_reported.whole.position_error_m);
  EXPECT_GE(doubled.whole.inside, as_reported.whole.inside);
}

// The right NEES is 3. The actual value is checked from both sides, so that a covariance of twice or half the
// size is detected.
TEST(MapperConsistency, InABuildingTheMapperIsMoreDoubtfulThanItsErrorsAre) {
  const MapperConsistency result = InTheBuilding(6, 30.0, 1.0);
  std::printf("mean NEES %.3f, error %.3f m, reported %.3f m\n", result.whole.nees, result.whole.position_error_m,
              result.whole.position_sigma_m);
  EXPECT_LT(result.whole.position_error_m, 0.06);
  EXPECT_NEAR(result.whole.nees, 0.55, 0.2);
  EXPECT_EQ(result.whole.not_localized, 0.0);
}

}  // namespace
}  // namespace cairn::studies
