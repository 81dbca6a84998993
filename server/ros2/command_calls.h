// The commands of ROS 2 programs, from services and initial poses, on their way to the desk and back: each goes through
// the inbound channel as a native one does, under a client number that is the door's own, so that it takes its turn
// there, and its answer is kept away from the native wire. Bounded: at most kMostOpen wait for their answers, and at
// most kMostOfOne of them for one participant; further ones are answered RESOURCE_EXHAUSTED. One that gets no answer
// within kPatience is answered DEADLINE_EXCEEDED. Thread rule: Take from any thread, the rest from one.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "common/mutex.h"
#include "common/service/request.h"
#include "server/inbound.h"

namespace cairn::server {

class CommandCalls {
 public:
  using Clock = std::chrono::steady_clock;
  // Gets all parts of the answer as one: its status, robots, jobs and saved sites.
  using Done = std::function<void(const Reply&)>;
  static constexpr std::size_t kMostOpen = 64;
  static constexpr std::size_t kMostOfOne = 8;
  static constexpr std::chrono::minutes kPatience{10};  // A large site takes its time to be loaded.

  explicit CommandCalls(Inbound& inbound);

  // `asker`: the participant that asks, or another number for who takes turns with others. `done` is called by Tick;
  // where the command is refused at once, by this call.
  void Ask(std::uint64_t asker, Request&& request, Done done, Clock::time_point now) CAIRN_EXCLUDES(mutex_);
  // Whether the reply is to one of these commands: then it is nobody else's.
  [[nodiscard]] bool Take(const Reply& reply) CAIRN_EXCLUDES(mutex_);
  [[nodiscard]] bool IsOwn(const Reply& reply) const noexcept { return reply.client == client_; }
  // Tells those who wait for what has been answered. They may ask again.
  void Tick(Clock::time_point now) CAIRN_EXCLUDES(mutex_);

 private:
  struct Call {
    std::uint64_t asker = 0;
    Done done;
    Clock::time_point asked;
    Reply reply;
    bool answered = false;
  };

  Inbound& inbound_;
  const ClientId client_;
  Mutex mutex_;
  std::int64_t next_ CAIRN_GUARDED_BY(mutex_) = 1;
  std::map<std::int64_t, Call> calls_ CAIRN_GUARDED_BY(mutex_);  // By the number of the request.
};

}  // namespace cairn::server
