#include "server/egress/generation_stamp.h"

#include <variant>

namespace cairn::server {
namespace {

template <typename Value>
void StampOne(Value& value, Generation generation) {
  value.generation = generation;
}

void StampOne(SessionRefusal& refusal, Generation generation) {
  refusal.state.generation = generation;
}

// What is retired is only a key; it is not sent.
void StampOne(Retired& /*retired*/, Generation /*generation*/) {}

void StampOne(Reply& reply, Generation generation) {
  reply.generation = generation;
  for (PoseReport& pose : reply.poses) pose.generation = generation;
  for (MapInfo& map : reply.maps) map.generation = generation;
  for (Job& job : reply.jobs) job.generation = generation;
  for (RobotStatus& robot : reply.robots) {
    robot.session.generation = generation;
    robot.pose.generation = generation;
    for (Ledger& ledger : robot.ledgers) ledger.generation = generation;
  }
}

}  // namespace

void Stamp(OutboundValue& value, Generation generation) {
  std::visit([generation](auto& one) { StampOne(one, generation); }, value);
}

}  // namespace cairn::server
