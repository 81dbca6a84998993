#include "server/queries/request_queue.h"

#include <algorithm>
#include <utility>

namespace cairn::server {

RequestQueue::Waiting& RequestQueue::QueueOf(ClientId client) {
  const auto [place, added] = clients_.try_emplace(client);
  if (added) turns_.push_back(client);
  return place->second;
}

std::optional<Request> RequestQueue::Push(Request&& request) {
  const MutexLock lock(mutex_);
  if (closed_) return std::move(request);
  std::optional<Request> refused;
  if (size_ >= capacity_) {
    const auto longest = std::max_element(clients_.begin(), clients_.end(), [](const auto& a, const auto& b) {
      return a.second.size() < b.second.size();
    });
    const auto own = clients_.find(request.client);
    const std::size_t waiting = own == clients_.end() ? 0 : own->second.size();
    if (longest->second.size() < waiting + 2) return std::move(request);
    refused = std::move(longest->second.back().request);
    longest->second.pop_back();
    --size_;
  }
  Waiting& queue = QueueOf(request.client);
  queue.push_back({std::move(request), std::nullopt});
  ++size_;
  filled_.NotifyOne();
  return refused;
}

std::optional<OpenRequest> RequestQueue::Pop() {
  const MutexLock lock(mutex_);
  while (size_ == 0 && !closed_) filled_.Wait(mutex_);
  if (size_ == 0) return std::nullopt;
  const ClientId client = turns_.front();
  turns_.pop_front();
  const auto place = clients_.find(client);
  OpenRequest next = std::move(place->second.front());
  place->second.pop_front();
  if (place->second.empty()) {
    clients_.erase(place);
  } else {
    turns_.push_back(client);
  }
  --size_;
  ++taken_;
  return next;
}

void RequestQueue::PutBack(OpenRequest&& open) {
  const MutexLock lock(mutex_);
  QueueOf(open.request.client).push_front(std::move(open));
  ++size_;
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
