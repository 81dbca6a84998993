#include "server/jobs/smooth_job.h"

#include <gtest/gtest.h>

#include "tests/server/support/room_world.h"

namespace cairn::server {
namespace {

using testing::RoomScan;
using testing::TruePose;

constexpr int kKeyframes = 20;

// A robot whose online path went wrong by 0.15 m half way and whose full path is right.
SessionMaterial Material() {
  SessionMaterial material{.session = 5, .robot = "r1", .snapshot = {}, .grid_options = {}};
  for (int k = 0; k < kKeyframes; ++k) {
    Pose2 online = TruePose(4 * k);
    if (k > kKeyframes / 2) online.x += 0.15;
    material.snapshot.keyframes.push_back({std::make_shared<const Scan>(RoomScan(4 * k)), TruePose(4 * k)});
    material.snapshot.online_path.push_back(online);
    material.snapshot.full_path.push_back(TruePose(4 * k));
    material.snapshot.scans.push_back({RoomScan(4 * k).stamp, static_cast<std::size_t>(k), {}});
  }
  return material;
}

class SmoothJobTest : public ::testing::Test {
 protected:
  SmoothPorts Ports() {
    return {.collect = [this](const std::string&, const JobControl&) -> Result<std::vector<SessionMaterial>> {
              return material_;
            },
            .add_version =
                [this](const std::string&, MapVersion&& version) {
                  added_ = std::move(version);
                  return Result<std::uint32_t>(2U);
                },
            .enable =
                [this](const std::string&, std::uint32_t version) {
                  enabled_ = version;
                  return Result<std::uint32_t>(version);
                }};
  }
  std::vector<SessionMaterial> material_ = {Material()};
  MapVersion added_;
  std::uint32_t enabled_ = 0;
  std::vector<double> progress_;
  JobControl control_{[this](double progress) { progress_.push_back(progress); }};
  Job job_ = [] {
    Job job;
    job.id = 9;
    job.site = "lab";
    return job;
  }();
};

TEST_F(SmoothJobTest, RedrawsTheMapAlongTheFullPathAndSaysHowMuchBetterItFits) {
  const auto outcome = SmoothJob(Ports()).Run(job_, true, control_);
  ASSERT_TRUE(outcome);
  EXPECT_LT(outcome->cost_after, outcome->cost_before);
  EXPECT_EQ(outcome->map_version, 2U);
  EXPECT_EQ(enabled_, 2U);
  EXPECT_EQ(added_.info.job, 9U);
  slam::OccupancyGrid expected{slam::GridOptions{}};
  for (int k = 0; k < kKeyframes; ++k) expected.Draw(RoomScan(4 * k), TruePose(4 * k));
  const auto& chunks = added_.parts.at(5).chunks;
  ASSERT_EQ(chunks.size(), expected.chunks().size());
  for (const auto& [key, chunk] : expected.chunks()) EXPECT_EQ(chunks.at(key)->log_odds, chunk->log_odds);
  EXPECT_EQ(added_.parts.at(5).keyframes, static_cast<std::size_t>(kKeyframes));
  EXPECT_EQ(added_.smoothed.at("r1")->size(), static_cast<std::size_t>(kKeyframes));
}

TEST_F(SmoothJobTest, ProgressGoesFromNothingToAll) {
  ASSERT_TRUE(SmoothJob(Ports()).Run(job_, true, control_));
  ASSERT_EQ(progress_.size(), 4U * kKeyframes);
  EXPECT_TRUE(std::is_sorted(progress_.begin(), progress_.end()));
  EXPECT_EQ(progress_.front(), 0.0);
  EXPECT_GT(progress_.back(), 0.95);
}

TEST_F(SmoothJobTest, LeavesTheVersionDisabledWhereAskedTo) {
  ASSERT_TRUE(SmoothJob(Ports()).Run(job_, false, control_));
  EXPECT_EQ(enabled_, 0U);
}

TEST_F(SmoothJobTest, CancellingEndsItWithoutAVersion) {
  control_.Cancel();
  const auto outcome = SmoothJob(Ports()).Run(job_, true, control_);
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, StatusCode::kCancelled);
  EXPECT_TRUE(added_.parts.empty());
  EXPECT_EQ(progress_.size(), 1U);
}

TEST_F(SmoothJobTest, ASiteWithoutScansFailsWithAReason) {
  material_.clear();
  EXPECT_EQ(SmoothJob(Ports()).Run(job_, true, control_).error().code, StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace cairn::server
