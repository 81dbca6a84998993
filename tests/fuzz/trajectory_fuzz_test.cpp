#include <gtest/gtest.h>

#include "common/sensor/trajectory.h"
#include "tests/fuzz/mutation.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

TEST(TrajectoryFuzz, DamagedTumFilesAreRefusedOrIncreasing) {
  const TempDirectory directory;
  Trajectory trajectory;
  for (int i = 1; i < 6; ++i) trajectory.push_back({i * 100'000'000LL, {i * 0.5, 1.0, 0.1 * i}});
  ASSERT_TRUE(WriteTum(trajectory, directory / "t.tum"));
  const std::string good = directory.Read("t.tum");
  std::mt19937_64 random(8);
  for (int i = 0; i < 3000; ++i) {
    const auto read =
        ReadTum(directory.Write("bad.tum", Mutate(good, random, {"nan", "inf", "1e999", "\n", "#", "-"})));
    if (!read) {
      EXPECT_FALSE(read.error().message.empty());
      continue;
    }
    for (std::size_t k = 0; k < read->size(); ++k) {
      EXPECT_TRUE((*read)[k].T_map_robot.IsFinite());
      EXPECT_TRUE(k == 0 || (*read)[k].stamp > (*read)[k - 1].stamp);
    }
  }
}

}  // namespace
}  // namespace cairn
