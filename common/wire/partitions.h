// The DDS partitions of Cairn's wire: a writer sends to the readers of its partition only.
// Source: DDS 1.4, 2.2.3.13 (PARTITION).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/service/session.h"

namespace cairn::wire {

// Which partitions the writers of a topic are in.
enum class Partitions {
  kDefault,  // The one without a name.
  kRobots,   // Each writer belongs to one robot. With security, it writes in a partition of the robot's name.
  kReplies,  // A server has one writer in each partition of replies; each client reads in one of them.
  // A server has one writer for each share of the robots. It is in the default partition, in which the robots of all
  // shares are read, and in that of its share. There is one writer, in the default partition only, with security,
  // where the permissions of fleets that exist would not allow another one, and with discovery servers: one of Fast DDS
  // 2.9 that is started again sometimes forgets to tell 64 writers of a reader that comes early (1 of 12 times).
  kShares,
};

// A reader in this one reads in all.
inline constexpr const char* kEveryPartition = "*";

// Clients share that many partitions, so that a reply reaches a sixteenth of them. (A content filter would keep all
// replies to others away, but Fast DDS 2.9 changes a writer's list of filters while the writer uses it.)
inline constexpr std::uint64_t kReplyPartitions = 16;

// What is written about one robot reaches, of the robots that read about themselves, a 64th. Without it, the work of a
// fleet would grow with the square of the number of its robots.
inline constexpr std::uint64_t kRobotShares = 64;

[[nodiscard]] inline std::string ReplyPartition(std::uint64_t number) {
  return "reply." + std::to_string(number);
}
[[nodiscard]] constexpr std::uint64_t ReplyPartitionOf(ClientId client) {
  return client % kReplyPartitions;
}

[[nodiscard]] inline std::string SharePartition(std::uint64_t number) {
  return "robots." + std::to_string(number);
}
[[nodiscard]] constexpr std::uint64_t ShareOf(NameId robot_id) {
  return robot_id % kRobotShares;
}

// How many writers a topic has, and the partitions of each; none: the default one. `shares`: whether robots are read
// by their shares.
[[nodiscard]] inline std::vector<std::vector<std::string>> PartitionsOfWriters(Partitions partitions, bool shares) {
  std::vector<std::vector<std::string>> writers;
  if (partitions == Partitions::kReplies) {
    for (std::uint64_t number = 0; number < kReplyPartitions; ++number) writers.push_back({ReplyPartition(number)});
  } else if (partitions == Partitions::kShares && shares) {
    for (std::uint64_t number = 0; number < kRobotShares; ++number) writers.push_back({"", SharePartition(number)});
  } else {
    writers.emplace_back();
  }
  return writers;
}

}  // namespace cairn::wire
