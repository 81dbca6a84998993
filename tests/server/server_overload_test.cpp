// The server when robots send more than it can estimate: slow, but alive.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "server/robots/session.h"
#include "tests/eventually.h"
#include "tests/server/support/whole_server.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kOverloadClient = 7;

ServerOptions SlowOnOneThread() {
  ServerOptions options = TestOptions();
  options.server.threads = 1;
  options.slam.filter.particles = 6000;
  options.slam.gate = {.distance_m = 0.0, .turn_rad = 0.0};  // Every scan updates the filter.
  return options;
}

// How long the server took for `steps` scans of each robot, all sent at once; `meanwhile` is called while it works.
double SecondsFor(const ServerOptions& options, int robot_count, int steps,
                  const std::function<void(WholeServer&)>& meanwhile) {
  WholeServer house(options);
  std::vector<std::string> robots;
  for (int i = 0; i < robot_count; ++i) robots.push_back("r" + std::to_string(i));
  for (const std::string& robot : robots) house.Open(robot, kOverloadClient);
  const auto begin = std::chrono::steady_clock::now();
  for (int step = 0; step < steps; ++step) {
    for (const std::string& robot : robots) {
      house.SendOdometry(robot, kOverloadClient, RoomOdometry(step));
      house.SendScan(robot, kOverloadClient, RoomScan(step));
    }
  }
  const auto settled = [&] {
    meanwhile(house);
    return std::all_of(robots.begin(), robots.end(), [&](const std::string& robot) {
      return house.LastLedger(robot).settled_through == static_cast<std::uint64_t>(steps);
    });
  };
  EXPECT_TRUE(house.WaitFor(settled, std::chrono::seconds(600)));  // Sanitized, beside other tests.
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// Twelve robots on one thread with a full queue each. The watchdog was starved once in such a case, and the server
// killed for being busy: the sign of life that was asked of a robot waited behind all its scans, and those of the
// others.
TEST(ServerOverload, IsHealthyUnderOverloadAsLongAsItMoves) {
  ServerOptions options = SlowOnOneThread();
  constexpr int kRobots = 12, kScans = 60;
  // A limit that neither a turn of each robot nor the drawing of what these change in the map reaches on this machine,
  // sanitized or not, but all queues together do. Half of a turn is odometry, so this is twice as long as the turns
  // take.
  const double seconds_per_scan = SecondsFor(options, 1, 10, [](WholeServer&) {}) / 10.0;
  options.server.stall_limit_s = std::max(0.3, kRobots * Session::kEventsPerTurn * seconds_per_scan);
  const double seconds =
      SecondsFor(options, kRobots, kScans, [](WholeServer& house) { EXPECT_TRUE(house.server().healthy()); });
  EXPECT_GT(seconds, 2.0 * options.server.stall_limit_s) << "the work was too little to show anything";
}

std::ptrdiff_t PosesOf(const WholeServer& house, const std::string& robot) {
  const auto poses = house.All<PoseReport>();
  return std::count_if(poses.begin(), poses.end(), [&](const PoseReport& pose) { return pose.robot == robot; });
}

// One thread estimates for all. A robot whose queue is full must not make another one wait for more than a turn.
TEST(ServerOverload, ARobotThatSendsTooMuchDelaysACalmOneByATurn) {
  WholeServer house(SlowOnOneThread());
  for (const char* robot : {"flood", "calm"}) house.Open(robot, kOverloadClient);
  int step = 0;
  const auto flood = [&](int scans) {
    for (int last = step + scans; step < last; ++step) {
      house.SendOdometry("flood", kOverloadClient, RoomOdometry(step));
      house.SendScan("flood", kOverloadClient, RoomScan(step));
    }
  };
  flood(50);
  for (int calm = 0; calm < 4; ++calm) {
    const auto before = PosesOf(house, "flood");
    house.SendOdometry("calm", kOverloadClient, RoomOdometry(calm));
    house.SendScan("calm", kOverloadClient, RoomScan(calm));
    house.SendOdometry("calm", kOverloadClient, RoomOdometry(calm + 1));
    ASSERT_TRUE(house.WaitFor([&] { return PosesOf(house, "calm") == calm + 1; }));
    // A turn has eight events, so four scans and their odometry; and as much may have been begun before.
    EXPECT_LE(PosesOf(house, "flood") - before, 10) << calm;
    EXPECT_LT(house.LastLedger("flood").settled_through + 15, static_cast<std::uint64_t>(step)) << "no flood is left";
    flood(10);
  }
}

// What is sent waits in a lane until its thread takes it. Such a thread once hung, while the server went on to say that
// it was alive.
TEST(ServerOverload, IsNotHealthyWhereNobodyTakesWhatItSends) {
  ServerOptions options = TestOptions();
  options.server.stall_limit_s = 0.5;
  Inbound inbound(64);
  Outbound outbound(64);
  Server server(options, inbound, outbound, 1);
  ASSERT_TRUE(server.Start());
  EXPECT_TRUE(server.healthy());
  SessionRequest request;
  request.robot = "r";
  request.site = "lab";
  request.sensors = {"laser"};
  request.client = request.session = kOverloadClient;
  ASSERT_TRUE(inbound.Push(request));
  EXPECT_TRUE(test::Eventually([&] { return !server.healthy(); }));
  for (const auto lane : {Outbound::Lane::kLive, Outbound::Lane::kMap, Outbound::Lane::kReplies})
    while (outbound.lane(lane).size() > 0) static_cast<void>(outbound.lane(lane).Pop());
  EXPECT_TRUE(test::Eventually([&] { return server.healthy(); }));
  server.Stop();
  // Its housekeeping, which looks at all others, is watched as well.
  EXPECT_TRUE(test::Eventually([&] { return !server.healthy(); }));
}

// The middleware counted for days what a forged heartbeat had announced. Nobody could ask the server any more, and it
// went on to say that it was alive.
TEST(ServerOverload, IsNotHealthyWhereTheMiddlewareIsBusyWithOneDatagram) {
  WholeServer house;
  house.server().SetReceiving(std::chrono::seconds(4));
  EXPECT_TRUE(house.server().healthy());
  house.server().SetReceiving(std::chrono::seconds(6));
  EXPECT_TRUE(test::Eventually([&] { return !house.server().healthy(); }));
  house.server().SetReceiving(std::chrono::seconds(0));
  EXPECT_TRUE(test::Eventually([&] { return house.server().healthy(); }));
}

}  // namespace
}  // namespace cairn::server::testing
