// The estimator of a session whose robot drives through the room of room_world.h, without a thread: what it is told is
// done when the call returns.
#pragma once

#include <gtest/gtest.h>

#include <utility>

#include "server/robots/session_estimator.h"
#include "tests/server/robots/one_session.h"

namespace cairn::server::testing {

struct RoomRobot {
  explicit RoomRobot(const EstimatorSetup& setup = FewParticles()) : estimator(setup, record, Outputs()) {
    EXPECT_TRUE(record.AddSensors({"laser"}));
  }

  static EstimatorSetup FewParticles() {
    EstimatorSetup setup;
    setup.mapper.filter.particles = 20;
    return setup;
  }
  static SessionOutputs Outputs() {
    return {.send = [](const OutboundValue&) { return true; }, .grid_changed = [](GridChange&&) {}};
  }
  void Take(const Odometry& odometry, Scan scan) {
    EXPECT_TRUE(record.OdometryReceived(kOwner, odometry.sequence));
    estimator.Handle(OdometryOf("r1", odometry));
    record.ScanReceived(kScans, scan.sequence);
    estimator.Handle(ScanOf("r1", std::move(scan)));
  }
  void Drive(int first, int last) {
    for (int step = first; step < last; ++step) Take(RoomOdometry(step), RoomScan(step));
  }

  SessionRecord record{4, RequestOf("r1"), RobotsOptions{}};
  SessionEstimator estimator;
};

}  // namespace cairn::server::testing
