// The DDS partitions of Cairn's wire: a writer sends to the readers of its partition only.
// Source: DDS 1.4, 2.2.3.13 (PARTITION).
#pragma once

#include <cstdint>
#include <string>

#include "common/service/session.h"

namespace cairn::wire {

// Which partitions the writers of a topic are in.
enum class Partitions {
  kDefault,  // The one without a name.
  kRobots,   // Each writer belongs to one robot. With security, it writes in a partition of the robot's name.
  kReplies,  // A server has one writer in each partition of replies; each client reads in one of them.
};

// A reader in this one reads in all.
inline constexpr const char* kEveryPartition = "*";

// Clients share that many partitions, so that a reply reaches a sixteenth of them. (A content filter would keep all
// replies to others away, but Fast DDS 2.9 changes a writer's list of filters while the writer uses it.)
inline constexpr std::uint64_t kReplyPartitions = 16;

[[nodiscard]] inline std::string ReplyPartition(std::uint64_t number) {
  return "reply." + std::to_string(number);
}
[[nodiscard]] constexpr std::uint64_t ReplyPartitionOf(ClientId client) {
  return client % kReplyPartitions;
}

}  // namespace cairn::wire
