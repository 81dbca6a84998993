// Answers to questions that many viewers ask alike. The server is asked one question at a time, and what it answered is
// given again for a while, so the server's load does not grow with the number of viewers.
// Bounds: as many kept answers as the constructor says, and kMaxWaiting threads that wait for their turn; further ones
// are refused at once (kResourceExhausted), so that questions without an answer can never take all threads of the HTTP
// server. Thread rule: every method from any thread.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "common/mutex.h"
#include "common/status.h"

namespace cairn::web {

class AnswerCache {
 public:
  static constexpr int kMaxWaiting = 16;
  using Body = std::shared_ptr<const std::string>;
  using Ask = std::function<Result<std::string>()>;

  // An answer is given again until it is `lifetime` old. An error is not kept.
  AnswerCache(std::chrono::milliseconds lifetime, std::size_t most) : lifetime_(lifetime), most_(most) {}

  // `ask` runs on the calling thread. If it throws, so does this.
  [[nodiscard]] Result<Body> Get(const std::string& question, const Ask& ask);

 private:
  using Clock = std::chrono::steady_clock;
  struct Kept {
    Clock::time_point at;
    Body body;
  };
  // The kept answer, or null where the caller is to ask now and must call EndTurn afterwards.
  [[nodiscard]] Result<Body> WaitForTurn(const std::string& question);
  void EndTurn(const std::string& question, const Body& body);
  [[nodiscard]] Body Find(const std::string& question) CAIRN_REQUIRES(mutex_);

  const std::chrono::milliseconds lifetime_;
  const std::size_t most_;
  Mutex mutex_;
  CondVar changed_;
  int waiting_ CAIRN_GUARDED_BY(mutex_) = 0;
  bool asking_ CAIRN_GUARDED_BY(mutex_) = false;
  std::map<std::string, Kept> kept_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::web
