// A robot that streams to a Cairn server: what it needs besides its drivers. README.md of client/lib explains it.
#include <cstdio>

#include "client/lib/robot_client.h"

using namespace cairn;
bool NextScan(Scan* scan, Odometry* odometry);  // Your robot's drivers.

int main() {
  auto bus = wire::Bus::Create({.domain = 0, .interfaces = {"127.0.0.1"}}, "my robot");
  if (!bus) return std::puts(bus.error().message.c_str()), 1;

  SessionRequest request;
  request.robot = "r1";
  request.site = "hall";
  request.sensors = {"laser"};
  client::RobotClient::Callbacks callbacks;
  callbacks.pose = [](const PoseReport& pose) { std::printf("%.3f %.3f\n", pose.T_map_robot.x, pose.T_map_robot.y); };
  client::RobotClientOptions options;
  options.window = 0;  // A robot that drives cannot wait: see "While the server is down".
  auto robot = client::RobotClient::Open(**bus, request, 5.0, callbacks, options);
  if (!robot) return std::puts(robot.error().message.c_str()), 1;

  Scan scan;
  Odometry odometry;
  while (NextScan(&scan, &odometry)) {
    Result<void> sent = (*robot)->Publish(odometry);
    if (sent) sent = (*robot)->Publish(scan);
    if (!sent) std::puts(sent.error().message.c_str());
  }
  (void)(*robot)->WaitSettled(10.0);
  (void)(*robot)->WaitSafe(10.0);  // A server that is killed later still has everything.
  return (*robot)->End() ? 0 : 1;
}
