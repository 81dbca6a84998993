#include "server/ros2/command_calls.h"

#include <algorithm>
#include <iterator>
#include <random>
#include <utility>

namespace cairn::server {
namespace {

constexpr std::size_t kMostItems = 4096;  // Of each kind, in the parts of one answer together.

// Random, as every client of the native wire draws its number, and never sent: nobody else can answer in its name.
ClientId DrawClient() {
  std::random_device random;
  return std::uniform_int_distribution<ClientId>(1)(random);
}

Reply Failed(StatusCode code, const char* why) {
  Reply reply;
  reply.status = {code, why};
  return reply;
}

template <typename Items>
void Append(const Items& more, Items& all) {
  const std::size_t room = kMostItems - std::min(kMostItems, all.size());
  all.insert(all.end(), more.begin(),
             std::next(more.begin(), static_cast<std::ptrdiff_t>(std::min(room, more.size()))));
}

}  // namespace

CommandCalls::CommandCalls(Inbound& inbound) : inbound_(inbound), client_(DrawClient()) {}

void CommandCalls::Ask(std::uint64_t asker, Request&& request, Done done, Clock::time_point now) {
  std::int64_t number = 0;
  {
    const MutexLock lock(mutex_);
    const auto of_asker =
        std::count_if(calls_.begin(), calls_.end(), [asker](const auto& call) { return call.second.asker == asker; });
    if (calls_.size() < kMostOpen && static_cast<std::size_t>(of_asker) < kMostOfOne) {
      number = next_++;
      calls_.emplace(number, Call{asker, done, now, {}, false});
    }
  }
  if (number == 0) return done(Failed(StatusCode::kResourceExhausted, "too many commands are waiting"));
  request.asker = asker;
  request.client = client_;
  request.sequence = number;
  if (inbound_.TryPush(std::move(request))) return;
  {
    const MutexLock lock(mutex_);
    calls_.erase(number);
  }
  done(Failed(StatusCode::kResourceExhausted, "the server is busy"));
}

bool CommandCalls::Take(const Reply& reply) {
  if (!IsOwn(reply)) return false;
  const MutexLock lock(mutex_);
  const auto found = calls_.find(reply.sequence);
  if (found == calls_.end()) return true;  // Too late.
  Call& call = found->second;
  call.answered = reply.last;  // First: also where memory is short, nobody waits in vain.
  call.reply.status = reply.status;
  Append(reply.robots, call.reply.robots);
  Append(reply.jobs, call.reply.jobs);
  Append(reply.saved, call.reply.saved);
  return true;
}

void CommandCalls::Tick(Clock::time_point now) {
  for (;;) {
    Call call;
    {
      const MutexLock lock(mutex_);
      const auto due = std::find_if(calls_.begin(), calls_.end(), [now](const auto& one) {
        return one.second.answered || now - one.second.asked > kPatience;
      });
      if (due == calls_.end()) return;
      call = std::move(due->second);
      calls_.erase(due);
    }
    call.done(call.answered ? call.reply : Failed(StatusCode::kDeadlineExceeded, "the server did not answer in time"));
  }
}

}  // namespace cairn::server
