#include "client/web/answer_cache.h"

#include <utility>

namespace cairn::web {

AnswerCache::Body AnswerCache::Find(const std::string& question) {
  const auto now = Clock::now();
  std::erase_if(kept_, [&](const auto& entry) { return now - entry.second.at > lifetime_; });
  const auto found = kept_.find(question);
  return found == kept_.end() ? nullptr : found->second.body;
}

Result<AnswerCache::Body> AnswerCache::WaitForTurn(const std::string& question) {
  const MutexLock lock(mutex_);
  if (Body body = Find(question)) return body;
  if (waiting_ >= kMaxWaiting) {
    return Fail(StatusCode::kResourceExhausted, "too many questions wait for the server; try again later");
  }
  ++waiting_;
  while (asking_) changed_.Wait(mutex_);
  --waiting_;
  // The one who asked before may have asked the same.
  if (Body body = Find(question)) return body;
  asking_ = true;
  return Body();
}

void AnswerCache::EndTurn(const std::string& question, const Body& body) {
  const MutexLock lock(mutex_);
  asking_ = false;
  if (body && kept_.size() < most_) kept_[question] = {.at = Clock::now(), .body = body};
  changed_.NotifyAll();
}

Result<AnswerCache::Body> AnswerCache::Get(const std::string& question, const Ask& ask) {
  Result<Body> known = WaitForTurn(question);
  if (!known || *known) return known;
  Result<std::string> answer = [&] {
    try {
      return ask();
    } catch (...) {
      EndTurn(question, nullptr);  // Otherwise everybody else would wait for ever.
      throw;
    }
  }();
  const Body body = answer ? std::make_shared<const std::string>(std::move(*answer)) : nullptr;
  EndTurn(question, body);
  if (!answer) return tl::unexpected(answer.error());
  return body;
}

}  // namespace cairn::web
