#include "server/jobs/smooth_job.h"

#include <gtest/gtest.h>
#include <pthread.h>

#include <asio/post.hpp>
#include <atomic>
#include <chrono>
#include <ctime>
#include <future>
#include <random>
#include <thread>
#include <utility>

#include "server/jobs/job_worker.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/server/robots/one_session.h"
#include "tests/server/slam/site/site_drives.h"
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

class SmoothSiteTest : public ::testing::Test {
 protected:
  std::vector<double> progress_;
  JobControl control_{[this](double progress) { progress_.push_back(progress); }};
  Job job_ = [] {
    Job job;
    job.id = 9;
    job.site = "lab";
    return job;
  }();
};

TEST_F(SmoothSiteTest, RedrawsTheMapAlongTheFullPathAndSaysHowMuchBetterItFits) {
  const auto smoothed = SmoothSite(job_, {Material()}, nullptr, control_);
  ASSERT_TRUE(smoothed);
  EXPECT_LT(smoothed->outcome.cost_after, smoothed->outcome.cost_before);
  EXPECT_GT(smoothed->outcome.cost_after, 0.0);
  EXPECT_EQ(smoothed->version->info.job, 9U);
  EXPECT_EQ(smoothed->version->info.note, "smoothed: 1 robot, 20 keyframes, 20 scans");
  EXPECT_EQ(smoothed->outcome.message, "1 robot, 20 keyframes, 20 scans");
  slam::OccupancyGrid expected{slam::GridOptions{}};
  for (int k = 0; k < kKeyframes; ++k) expected.Draw(RoomScan(4 * k), TruePose(4 * k));
  const RobotGrid& part = smoothed->version->parts.at(5);
  ASSERT_EQ(part.chunks.size(), expected.chunk_count());
  expected.ForEachChunk([&](const slam::ChunkKey& key, const slam::GridChunk& chunk) {
    EXPECT_EQ(part.chunks.at(key)->log_odds, chunk.log_odds);
  });
  EXPECT_EQ(part.keyframes, static_cast<std::size_t>(kKeyframes));
  EXPECT_EQ(smoothed->version->smoothed.at("r1").path->size(), static_cast<std::size_t>(kKeyframes));
}

TEST_F(SmoothSiteTest, TheResultIsTheSumOverAllRobots) {
  SessionMaterial other = Material();
  other.session = 6;
  other.robot = "r2";
  const auto one = SmoothSite(job_, {Material()}, nullptr, control_);
  const auto both = SmoothSite(job_, {Material(), other}, nullptr, control_);
  ASSERT_TRUE(one && both);
  EXPECT_EQ(both->outcome.message, "2 robots, 40 keyframes, 40 scans");
  EXPECT_EQ(both->version->parts.size(), 2U);
  EXPECT_EQ(both->version->smoothed.size(), 2U);
  EXPECT_DOUBLE_EQ(both->outcome.cost_before, one->outcome.cost_before);  // A mean over equal robots.
  EXPECT_DOUBLE_EQ(both->outcome.cost_after, one->outcome.cost_after);
}

// Nobody has said where the second one starts; each has a map of its own, and both have seen a part of the same
// corridor.
TEST_F(SmoothSiteTest, RobotsThatHaveSeenTheSameAreSmoothedTogether) {
  const slam::test::World world = slam::test::RingCorridor(true);
  const auto material_of = [&](SessionId session, double from_m, const Pose2& T_own_start) {
    SessionMaterial material{.session = session,
                             .robot = "r" + std::to_string(session),
                             .snapshot = slam::test::DriveRing(world, from_m, 60.0, T_own_start, session).snapshot,
                             .grid_options = {},
                             .start_known = session == 1};
    return material;
  };
  const std::vector<SessionMaterial> material{material_of(1, 0.0, {}), material_of(2, 24.0, {5.0, -3.0, 1.0})};
  const slam::SiteOptions options = SiteOptionsOf(slam::MapperOptions{});
  const auto smoothed = SmoothSite(job_, material, &options, control_);
  ASSERT_TRUE(smoothed);
  EXPECT_NE(smoothed->outcome.message.find("; joined 2: r1 ("), std::string::npos) << smoothed->outcome.message;
  EXPECT_EQ(smoothed->outcome.message.find("not joined"), std::string::npos) << smoothed->outcome.message;
  const RobotGrid& moved = smoothed->version->parts.at(2);
  EXPECT_FALSE(moved.fragment);
  ASSERT_TRUE(moved.path);
  ASSERT_EQ(moved.path->size(), material[1].snapshot.keyframes.size());
  // 24 m along the first side.
  EXPECT_LT((moved.path->front().translation() - Eigen::Vector2d(24.0, 0.0)).norm(), 0.5);
  slam::OccupancyGrid expected(slam::GridOptions{});
  for (std::size_t k = 0; k < moved.path->size(); ++k)
    expected.Draw(*material[1].snapshot.keyframes[k].scan, (*moved.path)[k]);
  EXPECT_EQ(moved.chunks.size(), expected.chunk_count());
  EXPECT_EQ(smoothed->version->smoothed.at("r2").path->front().T_map_robot, moved.path->front());
  EXPECT_TRUE(std::ranges::is_sorted(progress_));
  EXPECT_GT(progress_.back(), 0.95);

  const auto apart = SmoothSite(job_, material, nullptr, control_);
  ASSERT_TRUE(apart);
  EXPECT_EQ(apart->version->parts.at(2).path->front(), (Pose2{5.0, -3.0, 1.0}));
  EXPECT_TRUE(apart->version->parts.at(2).fragment);
  EXPECT_FALSE(apart->version->parts.at(1).fragment);
  EXPECT_FALSE(apart->version->smoothed.contains("r2"));

  // A job that only joins begins with other places and makes nearly the same version, and none where there is nothing.
  job_.kind = JobKind::kJoin;
  const auto joined = SmoothSite(job_, material, &options, control_);
  ASSERT_TRUE(joined && joined->version);
  const std::vector<Pose2>& joined_path = *joined->version->parts.at(2).path;
  ASSERT_EQ(joined_path.size(), moved.path->size());
  for (std::size_t k = 0; k < joined_path.size(); ++k)
    EXPECT_LT((joined_path[k].translation() - (*moved.path)[k].translation()).norm(), 0.05) << k;
  const auto nothing = SmoothSite(job_, {material[0]}, &options, control_);
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(nothing->version);
  EXPECT_NE(nothing->outcome.message.find("nothing to join yet"), std::string::npos);
  // Two that are joined with each other, and with nobody whose place is known.
  std::vector<SessionMaterial> unknown = material;
  unknown[0].start_known = false;
  const auto among_themselves = SmoothSite(job_, unknown, &options, control_);
  ASSERT_TRUE(among_themselves);
  EXPECT_FALSE(among_themselves->version);
}

TEST_F(SmoothSiteTest, TheSmoothedPathIsTheOneAlongWhichTheMapIsDrawn) {
  SessionMaterial material = Material();
  std::swap(material.snapshot.online_path, material.snapshot.full_path);  // Now the online path is right.
  const auto smoothed = SmoothSite(job_, {material}, nullptr, control_);
  ASSERT_TRUE(smoothed);
  EXPECT_EQ(smoothed->version->smoothed.at("r1").path->back().T_map_robot, TruePose(4 * (kKeyframes - 1)));
}

TEST_F(SmoothSiteTest, ProgressGoesFromNothingToAll) {
  ASSERT_TRUE(SmoothSite(job_, {Material()}, nullptr, control_));
  ASSERT_EQ(progress_.size(), slam::SmoothingSteps(Material().snapshot));
  EXPECT_TRUE(std::is_sorted(progress_.begin(), progress_.end()));
  EXPECT_EQ(progress_.front(), 0.0);
  EXPECT_GT(progress_.back(), 0.95);
}

TEST_F(SmoothSiteTest, CancellingEndsItAtTheNextStep) {
  control_.Cancel();
  const auto smoothed = SmoothSite(job_, {Material()}, nullptr, control_);
  ASSERT_FALSE(smoothed);
  EXPECT_EQ(smoothed.error().code, StatusCode::kCancelled);
  EXPECT_EQ(progress_.size(), 1U);
}

// A robot in a site, and a job that asks both. The sites have a pool of their own.
class SmoothJobTest : public SmoothSiteTest {
 protected:
  SmoothJobTest() {
    roster_.Take(testing::RequestOf("r1"));
    for (int step = 0; step < 10; ++step) {
      roster_.Take(testing::OdometryOf("r1", testing::RoomOdometry(step)));
      roster_.Take(testing::ScanOf("r1", RoomScan(step)));
    }
  }
  ~SmoothJobTest() override {
    release_.set_value();
    robots_pool_.join();
    maps_pool_.join();
  }
  // Lets the robot or the site answer nothing until the end of the test.
  void HoldRobot() {
    EXPECT_TRUE(roster_.Find("r1")->Post(SnapshotWanted{[held = held_](SessionMaterial&&) { held.wait(); }}));
  }
  void HoldSite() {
    asio::post(maps_pool_, [held = held_] { held.wait(); });
  }
  Result<JobOutcome> Run(double timeout_s, bool enable = true) {
    JobsOptions options;
    options.snapshot_timeout_s = timeout_s;
    return SmoothJob(options, {}, roster_, atlas_).Run(job_, enable, control_);
  }

  std::promise<void> release_;
  std::shared_future<void> held_{release_.get_future()};
  asio::thread_pool robots_pool_{1}, maps_pool_{1};
  Outbound outbound_{256};
  Atlas atlas_{MapsOptions{}, 0.05, true, maps_pool_, outbound_};
  Roster roster_{RobotsOptions{}, FewParticles(), robots_pool_, outbound_, atlas_};

 private:
  static slam::MapperOptions FewParticles() {
    slam::MapperOptions options;
    options.filter.particles = 10;
    return options;
  }
};

TEST_F(SmoothJobTest, PublishesAndEnablesANewVersion) {
  const auto outcome = Run(20.0);
  ASSERT_TRUE(outcome) << outcome.error().message;
  EXPECT_EQ(outcome->map_version, 2U);
  EXPECT_EQ(atlas_.Find("lab")->snapshot()->info.enabled_version, 2U);
}

TEST_F(SmoothJobTest, DoesNotEnableTheNewVersionUnlessAsked) {
  const auto outcome = Run(20.0, false);
  ASSERT_TRUE(outcome) << outcome.error().message;
  EXPECT_EQ(outcome->map_version, 2U);
  EXPECT_EQ(atlas_.Find("lab")->snapshot()->info.enabled_version, 1U);
}

TEST_F(SmoothJobTest, AsksEveryRobotOfTheSite) {
  roster_.Take(testing::RequestOf("r2"));
  roster_.Take(testing::OdometryOf("r2", testing::RoomOdometry(0)));
  roster_.Take(testing::ScanOf("r2", RoomScan(0)));
  const auto outcome = Run(20.0);
  ASSERT_TRUE(outcome) << outcome.error().message;
  EXPECT_EQ(outcome->message.substr(0, 8), "2 robots");
}

TEST_F(SmoothJobTest, ASiteWithoutRobotsOrThatIsGoneFailsWithAReason) {
  job_.site = "hall";
  EXPECT_EQ(Run(20.0).error().code, StatusCode::kFailedPrecondition);
  job_.site = "lab";
  const Atlas without_it(MapsOptions{}, 0.05, true, maps_pool_, outbound_);
  EXPECT_EQ(SmoothJob({}, {}, roster_, without_it).Run(job_, true, control_).error().code, StatusCode::kNotFound);
}

TEST_F(SmoothJobTest, FailsIfARobotDoesNotHandOverItsStateInTime) {
  HoldRobot();
  EXPECT_EQ(Run(0.1).error().code, StatusCode::kDeadlineExceeded);
}

TEST_F(SmoothJobTest, FailsIfTheSiteDoesNotAnswerInTime) {
  HoldSite();
  EXPECT_EQ(Run(5.0).error().code, StatusCode::kDeadlineExceeded);
}

TEST_F(SmoothJobTest, ACancelledJobWaitsForNobody) {
  HoldRobot();
  control_.Cancel();
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(Run(60.0).error().code, StatusCode::kCancelled);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
}

// Of eight steps six are made, because the online path is kept.
constexpr double kLastStepOfOneKeyframe = 5.0 / 8.0;

TEST_F(SmoothJobTest, AJobThatIsCancelledWhileItWaitsForItsSiteEndsAtOnce) {
  HoldSite();
  std::atomic<bool> nearly_drawn{false};
  JobControl control(
      [&nearly_drawn](double progress) { nearly_drawn = nearly_drawn || progress >= kLastStepOfOneKeyframe; });
  std::jthread cancels([&] {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!nearly_drawn && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    control.Cancel();
  });
  JobsOptions options;
  options.snapshot_timeout_s = 60.0;
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(SmoothJob(options, {}, roster_, atlas_).Run(job_, true, control).error().code, StatusCode::kCancelled);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(30));
}

// The job said failed, and the switch was completed later.
TEST_F(SmoothJobTest, ASwitchThatHasBegunIsWaitedFor) {
  std::promise<void> release;
  const std::shared_future<void> robot_held = release.get_future().share();
  bool holds = false;
  // The robot has handed over its state by the last step, and answers the correction late.
  JobControl control([&](double progress) {
    if (progress < kLastStepOfOneKeyframe || std::exchange(holds, true)) return;
    EXPECT_TRUE(roster_.Find("r1")->Post(SnapshotWanted{[robot_held](SessionMaterial&&) { robot_held.wait(); }}));
  });
  constexpr double kTimeoutS = 3.0;
  JobsOptions options;
  options.snapshot_timeout_s = kTimeoutS;
  auto job =
      std::async(std::launch::async, [&] { return SmoothJob(options, {}, roster_, atlas_).Run(job_, true, control); });
  EXPECT_EQ(job.wait_for(std::chrono::duration<double>(1.5 * kTimeoutS)), std::future_status::timeout);
  release.set_value();
  const auto outcome = job.get();
  ASSERT_TRUE(outcome) << outcome.error().message;
  EXPECT_EQ(atlas_.Find("lab")->snapshot()->info.enabled_version, outcome->map_version);
}

// A robot with a fit of some ten seconds: loops between random keyframes contradict each other and leave no sparse
// order for the elimination. Its scans have one beam each, so that drawing them takes no time.
SessionMaterial MaterialWithALongFit() {
  constexpr std::size_t kCount = 400;
  SessionMaterial material{.session = 5, .robot = "r1", .snapshot = {}, .grid_options = {}};
  slam::MapperSnapshot& snapshot = material.snapshot;
  Scan one_beam = RoomScan(0);
  one_beam.ranges_m.resize(1);
  const auto scan = std::make_shared<const Scan>(one_beam);
  std::mt19937_64 random(1);
  const Eigen::Matrix3d covariance = 1e-4 * Eigen::Matrix3d::Identity();
  for (std::size_t k = 0; k < kCount; ++k) {
    snapshot.keyframes.push_back({scan, {}});
    snapshot.full_path.push_back({0.01 * static_cast<double>(k), 0.0, 0.0});
    if (k == 0) continue;
    snapshot.relations.push_back({k - 1, k, {0.01, 0.0, 0.0}, covariance, false});
    for (int loop = 0; loop < 3; ++loop)
      snapshot.relations.push_back(
          {random() % k, k, {0.1 * static_cast<double>(random() % 40), 1.0, 1.0}, covariance, true});
  }
  snapshot.online_path = snapshot.full_path;
  snapshot.pose_graph.max_iterations = 1000;
  snapshot.pose_graph.tolerance = 0.0;
  return material;
}

// Whether somebody cancels the job, or the server stops.
class EndOfAFit : public ::testing::TestWithParam<bool> {};

INSTANTIATE_TEST_SUITE_P(JobWorker, EndOfAFit, ::testing::Bool(),
                         [](const auto& cancels) { return cancels.param ? "Cancel" : "Stop"; });

// Drawing asks before each step whether the job was cancelled, but the fit draws nothing for minutes. A server that
// was told to stop meanwhile waited for its end.
TEST_P(EndOfAFit, ComesAtTheNextIteration) {
  const SessionMaterial material = MaterialWithALongFit();
  const JobsOptions options;
  Outbound outbound(32);
  JobList list(options, outbound, [] { return Stamp{0}; });
  std::promise<clockid_t> clock_of_worker;
  JobWorker worker(options, list, [&](const Job& job, bool, const JobControl& control) -> Result<JobOutcome> {
    clockid_t clock{};
    pthread_getcpuclockid(pthread_self(), &clock);
    clock_of_worker.set_value(clock);
    auto smoothed = SmoothSite(job, {material}, nullptr, control);
    if (!smoothed) return tl::unexpected(smoothed.error());
    return smoothed->outcome;
  });
  worker.Start();
  const auto job = worker.Submit("lab", JobKind::kSmooth, false);
  ASSERT_TRUE(job);
  const clockid_t clock = clock_of_worker.get_future().get();
  const auto worked_s = [clock] {
    timespec time{};
    clock_gettime(clock, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  const auto wait_until = [](const auto& condition) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!condition() && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    return condition();
  };
  // The first half of the progress is drawing along the online path; then the fit begins.
  const double before_fit = (2.0 * static_cast<double>(material.snapshot.keyframes.size()) - 1.0) /
                            (4.0 * static_cast<double>(material.snapshot.keyframes.size()));
  ASSERT_TRUE(wait_until([&] { return list.Find(job->id)->progress >= before_fit - 1e-9; }));
  const double begun_s = worked_s();
  ASSERT_TRUE(wait_until([&] { return worked_s() > begun_s + 0.05; }));
  if (GetParam()) {
    ASSERT_TRUE(list.Cancel(job->id));
    EXPECT_TRUE(wait_until([&] { return list.Find(job->id)->state == JobState::kCancelled; }));
  } else {
    worker.Stop();
  }
  EXPECT_EQ(list.Find(job->id)->state, JobState::kCancelled);
  EXPECT_LT(list.Find(job->id)->progress, 0.5) << "the drawing after the fit has begun";
}

TEST_F(SmoothSiteTest, ASiteWithoutScansFailsWithAReason) {
  EXPECT_EQ(SmoothSite(job_, {}, nullptr, control_).error().code, StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace cairn::server
