// The requests that wait for the desk. Those who ask take turns, so one with many requests, or with one whose answer is
// large, delays the others by one turn at most. Bounded: where the queue is full, the newest request of the one that
// has most waiting gives way to one of somebody who has fewer. An answer that is there does not give way. Who asks is a
// participant of the domain (Request::asker), not a client: a program can invent any number of clients. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>

#include "common/mutex.h"
#include "common/service/request.h"
#include "server/queries/reply_parts.h"

namespace cairn::server {

// A request, and what is still to be sent of its answer.
struct OpenRequest {
  Request request;
  std::optional<ReplyParts> rest;  // Nothing: not answered yet.
};

class RequestQueue {
 public:
  // `capacity` must be at least 1.
  explicit RequestQueue(std::size_t capacity) : capacity_(capacity) {}

  // Returns the request that found no place: this one or another. Nothing where there was room.
  [[nodiscard]] std::optional<Request> Push(Request&& request) CAIRN_EXCLUDES(mutex_);
  // Waits for the next one's turn. Nothing where the queue is closed and empty.
  [[nodiscard]] std::optional<OpenRequest> Pop() CAIRN_EXCLUDES(mutex_);
  // A request from Pop whose answer is not sent whole: it goes on at the next turn of the one that asked, before the
  // others of that one.
  void PutBack(OpenRequest&& open) CAIRN_EXCLUDES(mutex_);
  // Nothing more comes in, what is inside still goes out.
  void Close() CAIRN_EXCLUDES(mutex_);

  [[nodiscard]] std::size_t size() const CAIRN_EXCLUDES(mutex_);
  // How many values have left the queue so far.
  [[nodiscard]] std::uint64_t taken() const CAIRN_EXCLUDES(mutex_);

 private:
  using Waiting = std::deque<OpenRequest>;
  static std::uint64_t AskerOf(const Request& request);
  Waiting& QueueOf(const Request& request) CAIRN_REQUIRES(mutex_);

  const std::size_t capacity_;
  mutable Mutex mutex_;
  CondVar filled_;
  std::map<std::uint64_t, Waiting> askers_ CAIRN_GUARDED_BY(mutex_);  // None is empty.
  std::deque<std::uint64_t> turns_ CAIRN_GUARDED_BY(mutex_);          // Those of `askers_`, the next one first.
  std::size_t size_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::uint64_t taken_ CAIRN_GUARDED_BY(mutex_) = 0;
  bool closed_ CAIRN_GUARDED_BY(mutex_) = false;
};

}  // namespace cairn::server
