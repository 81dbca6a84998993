// Has the answers to commands sent when what they did is on the disk, so that a server that is killed right after an
// answer has not forgotten the command when it starts again. Where nothing is stored, or the disk fails, which the
// status says, they are sent at once. It also hands over answers to questions that another thread has made. The desk's
// thread sends them, like all answers, because it may wait for room.
// Thread rule: any thread.
#pragma once

#include <atomic>
#include <memory>
#include <utility>

#include "common/mutex.h"
#include "common/service/request.h"
#include "server/queries/request_queue.h"
#include "server/store/journal.h"

namespace cairn::server {

class CommandAnswers : public std::enable_shared_from_this<CommandAnswers> {
 public:
  // `journal`: null if nothing is stored. It outlives the last call of Send; `requests` outlives the call of Stop.
  CommandAnswers(RequestQueue& requests, Journal* journal) : requests_(&requests), journal_(journal) {}

  void Send(const Request& request, Reply&& reply) {
    if (journal_ == nullptr || journal_->health().disk_fails) return Give(request, std::move(reply));
    waiting_.fetch_add(1);
    journal_->WhenStored([self = shared_from_this(), request, reply = std::move(reply)] {
      self->waiting_.fetch_sub(1);
      self->Give(request, Reply(reply));
    });
  }
  // An answer to a question, which changes nothing: it is sent at once.
  void Give(const Request& request, Answer&& answer) {
    const MutexLock lock(mutex_);
    if (requests_ != nullptr) requests_->PutBack({request, ReplyParts(std::move(answer))});
  }
  // So many answers wait for the disk that no further command should be carried out.
  [[nodiscard]] bool full() const { return waiting_ >= kMostWaiting; }
  // Nothing is sent any more.
  void Stop() {
    const MutexLock lock(mutex_);
    requests_ = nullptr;
  }

 private:
  static constexpr int kMostWaiting = 1024;

  std::atomic<int> waiting_{0};
  Mutex mutex_;
  RequestQueue* requests_ CAIRN_GUARDED_BY(mutex_);
  Journal* const journal_;
};

}  // namespace cairn::server
