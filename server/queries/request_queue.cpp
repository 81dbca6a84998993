#include "server/queries/request_queue.h"

#include <algorithm>
#include <utility>

namespace cairn::server {

std::uint64_t RequestQueue::AskerOf(const Request& request) {
  return request.asker != 0 ? request.asker : request.client;
}

RequestQueue::Waiting& RequestQueue::QueueOf(const Request& request) {
  const std::uint64_t asker = AskerOf(request);
  const auto [place, added] = askers_.try_emplace(asker);
  if (added) turns_.push_back(asker);
  return place->second;
}

std::optional<Request> RequestQueue::Push(Request&& request) {
  const MutexLock lock(mutex_);
  if (closed_) return std::move(request);
  std::optional<Request> refused;
  if (size_ >= capacity_) {
    // A command whose answer is there was carried out: nobody may be told that it was not.
    const auto may_give_way = [](const Waiting& waiting) { return waiting.back().rest ? 0 : waiting.size(); };
    const auto longest = std::max_element(askers_.begin(), askers_.end(), [&](const auto& a, const auto& b) {
      return may_give_way(a.second) < may_give_way(b.second);
    });
    const auto own = askers_.find(AskerOf(request));
    const std::size_t waiting = own == askers_.end() ? 0 : own->second.size();
    if (may_give_way(longest->second) < waiting + 2) return std::move(request);
    refused = std::move(longest->second.back().request);
    longest->second.pop_back();
    --size_;
  }
  Waiting& queue = QueueOf(request);
  queue.push_back({std::move(request), std::nullopt});
  ++size_;
  filled_.NotifyOne();
  return refused;
}

std::optional<OpenRequest> RequestQueue::Pop() {
  const MutexLock lock(mutex_);
  while (size_ == 0 && !closed_) filled_.Wait(mutex_);
  if (size_ == 0) return std::nullopt;
  const std::uint64_t asker = turns_.front();
  turns_.pop_front();
  const auto place = askers_.find(asker);
  OpenRequest next = std::move(place->second.front());
  place->second.pop_front();
  if (place->second.empty()) {
    askers_.erase(place);
  } else {
    turns_.push_back(asker);
  }
  --size_;
  ++taken_;
  return next;
}

void RequestQueue::PutBack(OpenRequest&& open) {
  const MutexLock lock(mutex_);
  Waiting& queue = QueueOf(open.request);
  queue.push_front(std::move(open));
  ++size_;
  filled_.NotifyOne();
}

void RequestQueue::Close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  filled_.NotifyAll();
}

std::size_t RequestQueue::size() const {
  const MutexLock lock(mutex_);
  return size_;
}

std::uint64_t RequestQueue::taken() const {
  const MutexLock lock(mutex_);
  return taken_;
}

}  // namespace cairn::server
