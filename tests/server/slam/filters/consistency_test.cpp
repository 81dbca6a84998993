// A few runs of the consistency study: filters that claim a Gaussian are consistent, and the check can fail.
#include "tests/studies/filters/consistency.h"

#include <gtest/gtest.h>

namespace cairn::studies {
namespace {

using slam::FilterKind;

TEST(Consistency, TheEkfIsAsSureAsItMayBeWithLandmarks) {
  const ConsistencyResult result = StudyConsistency({.kind = FilterKind::kEkf, .runs = 30});
  EXPECT_GT(result.nees_mean, result.nees_low);
  EXPECT_LT(result.nees_mean, result.nees_high);
  EXPECT_GT(result.nees_inside, 0.85);
  EXPECT_GT(result.nis_per_number, result.nis_low);
  EXPECT_LT(result.nis_per_number, result.nis_high);
  EXPECT_EQ(result.landmarks, ConsistencyLandmarks());
  EXPECT_EQ(result.diverged, 0);
}

TEST(Consistency, TheEkfIsAsSureAsItMayBeWithRevisits) {
  const ConsistencyResult result =
      StudyConsistency({.kind = FilterKind::kEkf, .runs = 30, .landmarks = false, .revisits = true});
  EXPECT_GT(result.nees_mean, result.nees_low);
  EXPECT_LT(result.nees_mean, result.nees_high);
}

TEST(Consistency, DriftAloneIsAsLargeAsToldWhichNeitherCorrectionNorParticlesMayChange) {
  // Without any features, every filter equals the drift model.
  for (const FilterKind kind : {FilterKind::kNone, FilterKind::kLandmarkCorrection, FilterKind::kEkf,
                                FilterKind::kFastSlam2Points, FilterKind::kFastSlam1}) {
    const ConsistencyResult result = StudyConsistency({.kind = kind, .runs = 30, .landmarks = false});
    EXPECT_GT(result.nees_mean, result.nees_low) << static_cast<int>(kind);
    EXPECT_LT(result.nees_mean, result.nees_high) << static_cast<int>(kind);
  }
}

TEST(Consistency, ParticleFiltersAreAsSureAsTheyMayBeWithLandmarksBeforeAndAfterTheLoop) {
  for (const FilterKind kind : {FilterKind::kFastSlam2Points, FilterKind::kFastSlam2Oriented, FilterKind::kFastSlam1}) {
    const ConsistencyResult result = StudyConsistency({.kind = kind, .runs = 30});
    EXPECT_GT(result.nees_before, result.nees_low) << static_cast<int>(kind);
    EXPECT_LT(result.nees_before, result.nees_high) << static_cast<int>(kind);
    EXPECT_GT(result.nees_mean, result.nees_low) << static_cast<int>(kind);
    EXPECT_LT(result.nees_mean, result.nees_high) << static_cast<int>(kind);
  }
}

// Here the loop closes at once: of 200 paths one is left, and the spread no longer shows its error (NEES 62).
TEST(Consistency, ParticleFiltersAreAsSureAsTheyMayBeWithRevisitsBeforeAndAfterTheLoop) {
  for (const FilterKind kind : {FilterKind::kFastSlam2Points, FilterKind::kFastSlam1}) {
    const ConsistencyResult result = StudyConsistency({.kind = kind, .runs = 30, .landmarks = false, .revisits = true});
    EXPECT_GT(result.nees_before, result.nees_low) << static_cast<int>(kind);
    EXPECT_LT(result.nees_before, result.nees_high) << static_cast<int>(kind);
    EXPECT_GT(result.nees_mean, result.nees_low) << static_cast<int>(kind);
    EXPECT_LT(result.nees_mean, result.nees_high) << static_cast<int>(kind);
  }
}

TEST(Consistency, LandmarksKeepTheErrorSmallAndParticlesDiverse) {
  const ConsistencyResult none = StudyConsistency({.kind = FilterKind::kNone, .runs = 20});
  for (const FilterKind kind : {FilterKind::kFastSlam2Points, FilterKind::kFastSlam2Oriented, FilterKind::kFastSlam1}) {
    const ConsistencyResult result = StudyConsistency({.kind = kind, .runs = 20});
    EXPECT_LT(result.position_error_m, 0.5 * none.position_error_m) << static_cast<int>(kind);
    EXPECT_EQ(result.landmarks, ConsistencyLandmarks()) << static_cast<int>(kind);
    const ConsistencyPoint& last = result.points.back();
    EXPECT_GT(last.effective_sample_size, 0.25 * 200) << "resampled below one half";
    EXPECT_GT(last.ancestry_depth, 5.0);
  }
}

TEST(Consistency, NoiseTwiceAsLargeAsToldIsFoundOut) {
  const ConsistencyResult result = StudyConsistency({.kind = FilterKind::kNone, .runs = 20, .noise_factor = 2.0});
  EXPECT_GT(result.nees_mean, 2.0 * result.nees_high);
  const ConsistencyResult ekf = StudyConsistency({.kind = FilterKind::kEkf, .runs = 10, .noise_factor = 2.0});
  EXPECT_GT(ekf.nis_per_number, 1.5 * ekf.nis_high);
}

TEST(Consistency, SameSeedsSameFigures) {
  const ConsistencyResult a = StudyConsistency({.runs = 2, .particles = 30, .rounds = 1});
  const ConsistencyResult b = StudyConsistency({.runs = 2, .particles = 30, .rounds = 1});
  EXPECT_EQ(a.nees_mean, b.nees_mean);
  EXPECT_EQ(a.position_error_m, b.position_error_m);
}

}  // namespace
}  // namespace cairn::studies
