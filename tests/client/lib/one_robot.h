// A robot's client and the server that it talks to, for the tests of RobotClient.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "client/lib/robot_client.h"
#include "tests/client/lib/fake_server.h"
#include "tests/loopback.h"

namespace cairn::client {

using namespace test;

inline SessionRequest Robot(const std::string& name) {
  SessionRequest request;
  request.robot = name;
  request.site = "hall";
  request.sensors = {"front", "rear"};
  return request;
}

inline Scan SomeScan() {
  Scan scan;
  scan.ranges_m.assign(180, 1.0F);
  return scan;
}

inline std::vector<std::uint64_t> OneTo(std::uint64_t n) {
  std::vector<std::uint64_t> numbers(n);
  std::iota(numbers.begin(), numbers.end(), 1);
  return numbers;
}

class RobotClientTest : public ::testing::Test {
 protected:
  std::unique_ptr<RobotClient> Open(const RobotClientOptions& options = {}, RobotClient::Callbacks callbacks = {}) {
    return Must(RobotClient::Open(*bus_, Robot("r1"), 20.0, std::move(callbacks), options));
  }

  std::unique_ptr<FakeServer> server_ = std::make_unique<FakeServer>(LoopbackOptions());
  const std::unique_ptr<wire::Bus> bus_ = MakeBus("robot");
};

}  // namespace cairn::client
