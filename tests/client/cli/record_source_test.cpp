// What a recorder receives, against a server that is made up here, over real DDS on loopback.
#include "client/cli/record_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "tests/loopback.h"

namespace cairn::client {
namespace {

using namespace test;

// Answers questions about robots: r1 is somewhere else each time, or always at one place. It publishes nothing.
class TellingServer {
 public:
  explicit TellingServer(bool drives) : drives_(drives) {
    requests_ = Must(bus_->Subscribe<Request>([this](Request&& request) { Answer(request); }));
  }
  [[nodiscard]] int told() const { return told_; }

 private:
  void Answer(const Request& request) {
    Reply reply;
    reply.client = request.client;
    reply.sequence = request.sequence;
    reply.last = true;
    if (request.kind == RequestKind::kStatus) {
      RobotStatus robot;
      robot.session.robot = robot.pose.robot = "r1";
      robot.session.robot_id = robot.pose.robot_id = HashName("r1");
      robot.pose.reason = PoseReason::kTracking;
      robot.pose.stamp = 100 + (drives_ ? told_.load() : 0);
      reply.robots.push_back(robot);
      ++told_;
    }
    Must(replies_->Publish(reply));
  }

  const bool drives_;
  std::atomic<int> told_ = 0;
  const std::unique_ptr<wire::Bus> bus_ = MakeBus("server");
  const std::unique_ptr<wire::Publication<Reply>> replies_ = Must(bus_->Advertise<Reply>());
  std::unique_ptr<wire::Subscription> requests_;  // Last: its callback uses everything above.
};

class RecordSourceTest : public ::testing::Test {
 protected:
  void Listen(const RecordSourceOptions& options = {}) { source_ = Must(RecordSource::Create(*bus_, queue_, options)); }
  // Publishes scans of both robots until several of each of `expected` have arrived; the robots of those that have. A
  // reader takes what has arrived robot by robot, so that the first scans may all be of one.
  std::vector<NameId> Heard(const std::vector<NameId>& expected) {
    constexpr std::ptrdiff_t kSeveral = 4;
    const auto robots = MakeBus("robots");
    const auto scans = Must(robots->Advertise<ScanSample>());
    std::vector<NameId> heard;
    EXPECT_TRUE(Eventually([&] {
      for (const char* robot : {"r2", "r1"}) {
        ScanSample sample;
        sample.stream = {.robot_id = HashName(robot), .sensor_id = HashName("laser"), .session = 1};
        sample.scan.ranges_m = {1.0F};
        Must(scans->Publish(sample));
      }
      for (const RecordEvent& event : queue_.Take(std::chrono::milliseconds(20)))
        if (const auto* const scan = std::get_if<ScanSample>(&event.value)) heard.push_back(scan->stream.robot_id);
      return std::all_of(expected.begin(), expected.end(),
                         [&](NameId robot) { return std::count(heard.begin(), heard.end(), robot) >= kSeveral; });
    }));
    return heard;
  }

  const std::unique_ptr<wire::Bus> bus_ = MakeBus("recorder");
  RecordQueue queue_{1 << 20};
  std::unique_ptr<RecordSource> source_;
};

TEST_F(RecordSourceTest, HearsAllRobotsOrThoseThatAreNamed) {
  Listen();
  static_cast<void>(Heard({HashName("r1"), HashName("r2")}));
  EXPECT_EQ(source_->renewed(), 0);
  source_.reset();
  static_cast<void>(queue_.Take(std::chrono::milliseconds(0)));
  Listen({.robots = {HashName("r1")}});
  EXPECT_THAT(Heard({HashName("r1")}), ::testing::Each(HashName("r1")));
}

// Forged messages can bring a reader into a state in which it receives nothing (SilenceWatch).
TEST_F(RecordSourceTest, JoinsAnewWhereOnlyTheServerHasNewPosesAndHearsOn) {
  const TellingServer server(true);
  Listen();
  EXPECT_TRUE(Eventually([&] { return source_->renewed() >= 1; }));
  static_cast<void>(Heard({HashName("r1"), HashName("r2")}));
}

TEST_F(RecordSourceTest, StaysWhereNoRobotHasANewPose) {
  const TellingServer server(false);
  Listen();
  EXPECT_TRUE(Eventually([&] { return server.told() >= 4; }));
  EXPECT_EQ(source_->renewed(), 0);
}

TEST_F(RecordSourceTest, WithoutSamplesNoScansAreRead) {
  Listen({.samples = false, .robots = {}});
  EXPECT_EQ(source_->scan_writers(), 0);
  const auto robots = MakeBus("robots");
  const auto scans = Must(robots->Advertise<ScanSample>());
  const auto poses = Must(robots->Advertise<PoseReport>());
  EXPECT_TRUE(Eventually([&] { return poses->matched() > 0; }));
  EXPECT_EQ(scans->matched(), 0);
}

}  // namespace
}  // namespace cairn::client
