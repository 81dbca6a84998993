// What a server has refused since its start because of who sent it. A plain value.
#pragma once

#include <cstdint>

namespace cairn {

struct Refusals {
  bool secure = false;          // Whether DDS Security is on. If not, `peers`, `endpoints` and `samples` are 0.
  std::uint64_t peers = 0;      // Participants without a valid identity or permissions.
  std::uint64_t endpoints = 0;  // Readers and writers of topics that the permissions of their participant do not allow.
  std::uint64_t samples = 0;    // Samples in the name of another robot than the sender's.
  std::uint64_t commands = 0;   // Commands that were sent as questions.
  std::uint64_t datagrams = 0;  // Not valid or not plausible RTPS.
  std::uint64_t over_limit = 0;  // Sessions and requests that were answered RESOURCE_EXHAUSTED.

  bool operator==(const Refusals&) const = default;
};

}  // namespace cairn
