// The parts of the sensitivity study that decide what its table says.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/studies/sensitivity/constants.h"
#include "tests/studies/sensitivity/map_crispness.h"
#include "tests/studies/sensitivity/run_cache.h"
#include "tests/studies/sensitivity/verdict.h"
#include "tests/temp_directory.h"

namespace cairn::studies {
namespace {

// A robot that looks at one wall from several places. `drift_m`: how far each next pose is believed too far
// from it.
StudyLog WallLog() {
  StudyLog log;
  for (int i = 0; i < 20; ++i) {
    Scan scan;
    scan.stamp = (i + 1) * kNanosPerSecond;
    scan.angle_first_rad = -0.5;
    scan.angle_step_rad = 0.005;
    scan.range_min_m = 0.05;
    scan.range_max_m = 10.0;
    for (int beam = 0; beam <= 200; ++beam)
      scan.ranges_m.push_back(static_cast<float>(2.0 / std::cos(-0.5 + 0.005 * beam)));
    log.records.emplace_back(scan);
  }
  return log;
}

Trajectory PathAlong(double drift_m) {
  Trajectory path;
  for (int i = 0; i < 20; ++i) path.push_back({(i + 1) * kNanosPerSecond, {i * drift_m, 0.013 * i, 0.0}});
  return path;
}

TEST(MapCrispness, AWallDrawnTwiceIsThickerAndMoreBlurred) {
  const StudyLog log = WallLog();
  const MapCrispness crisp = CrispnessOf(log, PathAlong(0.0)), blurred = CrispnessOf(log, PathAlong(0.01));
  EXPECT_LT(crisp.thickness_m, 0.002);
  // Twenty parallel copies one centimetre apart: the standard deviation of 0, 1, ..., 19 cm.
  EXPECT_NEAR(blurred.thickness_m, 0.01 * std::sqrt((20.0 * 20.0 - 1.0) / 12.0), 0.01);
  EXPECT_GT(blurred.blur_m, 3.0 * crisp.blur_m);
}

TEST(MapCrispness, WithoutPosesThereIsNoFigure) {
  EXPECT_TRUE(std::isnan(CrispnessOf(WallLog(), {}).blur_m));
}

TEST(SensitivityVerdict, CountsWhatIsBeyondTenPercentTwoMillimetresAndOtherSeeds) {
  const Figures usual{{"online", 0.100}};
  const auto matters = [&](double changed, const SeedNoise& noise) {
    Effect effect;
    AddEffect("group", "log", usual, {{"online", changed}}, noise, effect);
    return effect.matters;
  };
  EXPECT_FALSE(matters(0.109, {}));
  EXPECT_TRUE(matters(0.112, {}));
  EXPECT_TRUE(matters(0.088, {}));  // Better by a tenth is a change, too.
  EXPECT_TRUE(matters(std::nan(""), {}));
  SeedNoise noise;
  AddNoise(usual, {{"online", 0.080}}, noise);
  AddNoise(usual, {{"online", 0.099}}, noise);
  EXPECT_FALSE(matters(0.120, noise));
  EXPECT_TRUE(matters(0.130, noise));

  Effect small;
  AddEffect("group", "log", {{"online", 0.004}}, {{"online", 0.0055}}, {}, small);
  EXPECT_FALSE(small.matters);
  EXPECT_NEAR(small.groups.at("group").value, 1.375, 1e-9);
}

TEST(SensitivityVerdict, KeepsTheRatioFarthestFromOne) {
  Effect effect;
  AddEffect("group", "a", {{"online", 0.1}}, {{"online", 0.15}}, {}, effect);
  AddEffect("group", "b", {{"online", 0.1}}, {{"online", 0.05}}, {}, effect);
  AddEffect("group", "c", {{"online", 0.1}}, {{"online", 0.12}}, {}, effect);
  EXPECT_EQ(effect.groups.at("group").where, "b, online");
  EXPECT_EQ(effect.largest.where, "b, online");
  EXPECT_NEAR(effect.largest.value, 0.5, 1e-12);
}

TEST(SensitivityCache, GoesOnWhereAnotherRunEnded) {
  const TempDirectory directory;
  const auto file = directory.path() / "runs.tsv";
  {
    RunCache cache(file);
    EXPECT_EQ(cache.Find("a | b"), nullptr);
    cache.Keep("a | b", {{"online", 0.1}, {"smoothed", std::nan("")}});
  }
  RunCache again(file);
  again.Keep("c", {{"online", 1.0}});
  const RunCache both(file);
  ASSERT_NE(both.Find("a | b"), nullptr);
  EXPECT_EQ(both.Find("a | b")->at(0), (std::pair<std::string, double>("online", 0.1)));
  EXPECT_TRUE(std::isnan(both.Find("a | b")->at(1).second));
  ASSERT_NE(both.Find("c"), nullptr);
}

// A row of the table that changes nothing would say that its constant does not matter.
TEST(SensitivityConstants, EachChangesBothWaysAndOnlyWhenAsked) {
  for (const Constant& constant : AllConstants()) {
    slam::MapperOptions usual, halved, doubled;
    const double value = constant.change(usual, 0);
    EXPECT_LT(constant.change(halved, -1), value) << constant.name;
    EXPECT_GT(constant.change(doubled, 1), value) << constant.name;
    EXPECT_EQ(constant.change(usual, 0), value) << constant.name;
  }
}

}  // namespace
}  // namespace cairn::studies
