// A roster with an atlas, for its tests.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "server/robots/roster.h"
#include "tests/server/robots/one_session.h"

namespace cairn::server::testing {

constexpr std::size_t kLane = 256;

// A roster with an atlas. What it sends stays in the lane until somebody asks for it.
class RosterTest : public ::testing::Test {
 protected:
  ~RosterTest() override { pool_.join(); }

  Roster& roster(const RobotsOptions& options = {}, bool create_sites = true) {
    if (roster_ != nullptr) return *roster_;
    slam::MapperOptions mapper;
    mapper.filter.particles = 20;
    atlas_ = std::make_unique<Atlas>(maps_, 0.05, create_sites, pool_, outbound_);
    EXPECT_TRUE(atlas_->Create("lab"));
    roster_ = std::make_unique<Roster>(options, mapper, pool_, outbound_, *atlas_);
    return *roster_;
  }
  // Nothing more can be sent until the next call of sent().
  void FillLane() {
    while (outbound_.Send(PoseReport{})) {
    }
  }
  Sent& sent() {
    while (auto value = outbound_.lane(Outbound::Lane::kLive).TryPop()) sent_.Keep(std::move(*value));
    return sent_;
  }
  SessionState LastState(const std::string& robot, ClientId client) {
    SessionState last;
    const auto look = [&](const SessionState& state) {
      if (state.robot == robot && state.client == client) last = state;
    };
    sent().ForEach([&](const OutboundValue& value) {
      if (const auto* const refusal = std::get_if<SessionRefusal>(&value)) look(refusal->state);
      if (const auto* const state = std::get_if<SessionState>(&value)) look(*state);
    });
    return last;
  }
  // Refusals have their own topic: the state of the client's former session may be published before or after one.
  SessionState LastRefusal(const std::string& robot, ClientId client) {
    SessionState last;
    for (const SessionRefusal& refusal : sent().All<SessionRefusal>()) {
      if (refusal.state.robot == robot && refusal.state.client == client) last = refusal.state;
    }
    return last;
  }
  bool WaitPhase(const std::string& robot, ClientId client, SessionPhase phase) {
    return sent_.WaitFor([&] {
      const SessionState state = LastState(robot, client);
      return state.robot == robot && state.phase == phase;
    });
  }
  // The robot opens a session, draws something and ends it.
  void DriveAndEnd(const std::string& robot, ClientId client) {
    roster().Take(RequestOf(robot, client));
    for (int step = 0; step < 5; ++step) {
      roster().Take(OdometryOf(robot, RoomOdometry(step), client));
      roster().Take(ScanOf(robot, RoomScan(step), client));
    }
    ASSERT_TRUE(roster().End(robot));
    ASSERT_TRUE(WaitPhase(robot, client, SessionPhase::kEnded));
  }
  void Suspend(ClientId client) {
    for (const auto& session : roster().All()) {
      const SessionState state = session->record().state();
      if (state.client == client) roster().Take(ClientLiveliness{client, state.robot_id, false});
    }
  }

  MapsOptions maps_;
  asio::thread_pool pool_{2};
  Outbound outbound_{kLane};
  Sent sent_;
  std::unique_ptr<Atlas> atlas_;
  std::unique_ptr<Roster> roster_;
};

}  // namespace cairn::server::testing
