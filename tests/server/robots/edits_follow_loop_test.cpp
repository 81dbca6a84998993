// What a person says of the map of a robot whose path is bent later: by a large loop of its own, or by a job.
#include <gtest/gtest.h>

#include <asio/thread_pool.hpp>
#include <future>
#include <memory>
#include <utility>
#include <vector>

#include "server/maps/site.h"
#include "tests/server/robots/room_robot.h"
#include "tests/server/robots/slipping_drive.h"

namespace cairn::server {
namespace {

// Hands over what the site asks for. The test waits meanwhile.
struct EstimatorOwner : GridOwner {
  explicit EstimatorOwner(SessionEstimator& its_estimator) : estimator(its_estimator) {}
  void Adopt(Correction&& correction) override { estimator.Handle(std::move(correction)); }
  void SetMapEpoch(std::uint32_t epoch) override { estimator.Handle(EpochChange{epoch}); }
  SessionEstimator& estimator;
};

class MapOfOneRobot : public ::testing::Test {
 protected:
  static EstimatorSetup FewParticles() {
    EstimatorSetup setup;
    setup.mapper.filter.particles = 20;
    setup.mapper.filter.back_end.landmarks.enabled = false;  // The landmarks alone would nearly correct the drift.
    return setup;
  }
  MapOfOneRobot() {
    EXPECT_TRUE(record_.AddSensors({"laser"}));
    site_->Join({.session = 4, .robot = 104, .owner = owner_});
  }
  ~MapOfOneRobot() override { pool_.join(); }
  void Take(const Odometry& odometry, Scan scan) {
    EXPECT_TRUE(record_.OdometryReceived(testing::kOwner, odometry.sequence));
    estimator_.Handle(testing::OdometryOf("r1", odometry));
    record_.ScanReceived(testing::kScans, scan.sequence);
    estimator_.Handle(testing::ScanOf("r1", std::move(scan)));
  }
  Pose2 PoseAt(Stamp stamp) { return record_.snapshot().path.At(stamp)->T_map_robot; }
  void Enable(std::uint32_t version) {
    std::promise<bool> done;
    site_->Enable(version, [&](const Result<std::uint32_t>& enabled) { done.set_value(enabled.has_value()); });
    ASSERT_TRUE(done.get_future().get());
  }
  void AddAround(const Eigen::Vector2d& place) {
    MapEdit edit{.kind = MapEditKind::kKeepOut, .points_map = {{-0.2, -0.2}, {0.2, -0.2}, {0.0, 0.4}}, .note = {}};
    std::promise<bool> done;
    site_->AddEdit(Moved(edit, {place.x(), place.y(), 0.0}),
                   [&](const Result<std::uint64_t>& added) { done.set_value(added.has_value()); });
    ASSERT_TRUE(done.get_future().get());
  }
  Eigen::Vector2d Place() {
    std::promise<void> reached;
    site_->Publish([&] { reached.set_value(); });
    reached.get_future().wait();
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& point : site_->snapshot()->edits->at(0).points_map) sum += point;
    return sum / 3.0;
  }

  asio::thread_pool pool_{1};
  Outbound outbound_{65536};
  std::shared_ptr<Site> site_ = std::make_shared<Site>("lab", 0.05, MapsOptions{}, pool_, outbound_);
  SessionRecord record_{4, testing::RequestOf("r1"), RobotsOptions{}};
  SessionEstimator estimator_{FewParticles(),
                              record_,
                              {.send = [](const OutboundValue&) { return true; },
                               .grid_changed = [this](GridChange&& change) { site_->Change(std::move(change)); }}};
  std::shared_ptr<EstimatorOwner> owner_ = std::make_shared<EstimatorOwner>(estimator_);
};

constexpr double kCell_m = 0.05;

TEST_F(MapOfOneRobot, AKeepOutGoesWithTheVersionOfTheMapThatIsEnabled) {
  for (int step = 0; step < 80; ++step) Take(testing::RoomOdometry(step), testing::RoomScan(step));
  const Stamp early = testing::RoomScan(30).stamp;
  const Eigen::Vector2d beside_the_robot(0.3, 0.2);
  const Eigen::Vector2d said = PoseAt(early) * beside_the_robot;
  ASSERT_NO_FATAL_FAILURE(AddAround(said));
  SessionMaterial material;
  estimator_.Handle(SnapshotWanted{[&material](SessionMaterial&& taken) { material = std::move(taken); }});
  std::vector<Pose2> path = material.snapshot.full_path;
  for (std::size_t k = 0; k < path.size(); ++k) path[k] = Pose2{2.0, 1.0, 0.01 * static_cast<double>(k)} * path[k];
  MapVersion version;
  version.parts[4] = {.chunks = {}, .keyframes = path.size(), .path = std::make_shared<const std::vector<Pose2>>(path)};
  site_->AddVersion(std::move(version), [](const Result<std::uint32_t>& number) { EXPECT_EQ(number, 2U); });
  for (int round = 0; round < 3; ++round) {
    ASSERT_NO_FATAL_FAILURE(Enable(2));
    EXPECT_GT((Place() - said).norm(), 1.0);
    EXPECT_LT((Place() - PoseAt(early) * beside_the_robot).norm(), kCell_m);
    ASSERT_NO_FATAL_FAILURE(Enable(1));
    EXPECT_LT((Place() - said).norm(), 1e-6) << "the grid is the one of before";
  }
  for (int step = 80; step < 90; ++step) Take(testing::RoomOdometry(step), testing::RoomScan(step));
  EXPECT_LT((Place() - said).norm(), 1e-6);
}

TEST_F(MapOfOneRobot, AKeepOutStaysAroundItsMachineWhereTheRobotClosesALargeLoop) {
  const Eigen::Vector2d before_the_robot(1.5, 0.9);
  Pose2 true_then;
  Eigen::Vector2d said = Eigen::Vector2d::Zero();
  testing::DriveWithASlip([&](const Odometry& odometry, Scan scan) { Take(odometry, std::move(scan)); },
                          [&](const Pose2& truth) {
                            true_then = truth;
                            said = record_.snapshot().status.pose.T_map_robot * before_the_robot;
                            AddAround(said);
                          });
  ASSERT_FALSE(HasFatalFailure());
  const Eigen::Vector2d machine = true_then * before_the_robot;
  EXPECT_GT((said - machine).norm(), 0.3) << "the map must need correcting";
  const Pose2 now = PoseAt(static_cast<Stamp>(testing::kAfterTheSlip) * testing::kSlippingPeriod);
  EXPECT_LT((Place() - now * before_the_robot).norm(), kCell_m);
  EXPECT_LT((Place() - machine).norm(), 0.5 * (said - machine).norm());
}

}  // namespace
}  // namespace cairn::server
