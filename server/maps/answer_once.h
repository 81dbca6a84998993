// Answers exactly once: with the result, or with INTERNAL where there was none because the work ended with an
// exception. Thread rule: as the function that is answered.
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "common/status.h"

namespace cairn::server {

template <typename Value>
using Answered = std::function<void(Result<Value>)>;

template <typename Value>
class AnswerOnce {
 public:
  explicit AnswerOnce(Answered<Value> answered) : answered_(std::move(answered)) {}
  AnswerOnce(const AnswerOnce&) = delete;
  AnswerOnce& operator=(const AnswerOnce&) = delete;
  ~AnswerOnce() {
    if (answered_) answered_(Fail(StatusCode::kInternal, "internal error of the server; see its log for the cause"));
  }
  void Give(Result<Value> result) { std::exchange(answered_, nullptr)(std::move(result)); }

 private:
  Answered<Value> answered_;
};

// The same function, for work that may be copied and dropped.
template <typename Value>
Answered<Value> Once(Answered<Value> answered) {
  return [answer = std::make_shared<AnswerOnce<Value>>(std::move(answered))](Result<Value> result) {
    answer->Give(std::move(result));
  };
}

}  // namespace cairn::server
