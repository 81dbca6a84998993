// A server that starts on what a store holds, is asked everything, and goes on with its robots.
#pragma once

#include <memory>

#include "server/ops/start_control.h"
#include "server/store/journal.h"
#include "tests/fuzz/memory_store.h"
#include "tests/fuzz/rooms.h"
#include "tests/server/support/room_world.h"

namespace cairn::fuzz {

constexpr ClientId kReturning = 77;
constexpr SessionToken kTokenBefore = 78;

// A scan of 31 beams; the later ones of the same drive.
inline Scan SmallScan(int step) {
  Scan scan = server::testing::RoomScan(step);
  for (std::size_t i = 0; 6 * i < scan.ranges_m.size(); ++i) scan.ranges_m[i] = scan.ranges_m[6 * i];
  scan.ranges_m.resize(scan.ranges_m.size() / 6 + 1);
  scan.angle_step_rad *= 6.0;
  return scan;
}

// The robot of the session comes back, and drives.
inline void GoOn(server::Roster& roster, const server::Session& session, int first_step) {
  const SessionState state = session.record().state();
  SessionRequest back{.robot = state.robot,
                      .site = state.site,
                      .sensors = {"laser"},
                      .client = kReturning,
                      .has_start = false,
                      .T_map_robot_start = {},
                      .end = false,
                      .session = state.session,
                      .started = true};
  roster.Take(back);
  for (int step = first_step; step < first_step + 3; ++step) {
    roster.Take(server::OdometryArrival{
        {state.robot_id, HashName("odometry"), state.session}, server::testing::RoomOdometry(step), false});
    roster.Take(server::ScanArrival{
        {state.robot_id, HashName("laser"), state.session}, std::make_shared<const Scan>(SmallScan(step)), {}, {}});
  }
}

inline void AskEverything(Rooms& rooms) {
  for (int kind = 0; kind <= static_cast<int>(RequestKind::kMapEnable); ++kind) {
    Request request;
    request.kind = static_cast<RequestKind>(kind);
    request.site = "lab";
    request.robot = "r5";
    request.job = 4;
    request.map_version = 3;
    rooms.Ask(request);
    request.latest = false;
    request.stamp = 15;
    request.smoothed = true;
    if (kind <= static_cast<int>(RequestKind::kStatus)) rooms.Ask(request);
  }
}

// What of a store is there after a start.
enum class Restored { kNothing, kNoSession, kSessions };
inline Restored StartOn(MemoryStore& store) {
  server::Journal journal(store, {});  // Never started: nothing is written.
  Rooms rooms([](server::OutboundValue&&) {}, &journal);
  server::StartControl control;
  const auto sites = rooms.atlas().Restore(control);
  if (!sites) return Must(!sites.error().message.empty(), "a refusal has a reason"), Restored::kNothing;
  const auto sessions = rooms.roster().Restore(control);
  if (!sessions) return Must(!sessions.error().message.empty(), "a refusal has a reason"), Restored::kNothing;
  const auto jobs = rooms.jobs().Restore();
  if (!jobs) return Must(!jobs.error().message.empty(), "a refusal has a reason"), Restored::kNothing;
  AskEverything(rooms);
  const auto restored = rooms.roster().All();
  for (const auto& session : restored) GoOn(rooms.roster(), *session, 8);
  rooms.Finish();
  if (!restored.empty()) return Restored::kSessions;
  return rooms.atlas().All().empty() && jobs->empty() ? Restored::kNothing : Restored::kNoSession;
}

}  // namespace cairn::fuzz
