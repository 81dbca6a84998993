// Handles all requests on one thread: it answers queries from snapshots and passes commands (submit, cancel,
// end, enable) to their room. The switch over all kinds of request is only here. Clients take turns, also with the
// parts of large answers. The queue is bounded: when it is full, requests are answered RESOURCE_EXHAUSTED at once,
// first those of the client that has most waiting. A request to enable a map version is answered when the switch is
// complete; the thread does not wait for it. If handling a request ends with an exception, the request is answered
// INTERNAL and the thread continues. Each answer that was sent is logged with the id of its request (request_log.h).
// Thread rule: Take from any thread; Start and Stop from one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "common/mutex.h"
#include "server/jobs/job_worker.h"
#include "server/maps/atlas.h"
#include "server/ops/heartbeat.h"
#include "server/outbound.h"
#include "server/queries/answers.h"
#include "server/queries/command_answers.h"
#include "server/queries/request_queue.h"
#include "server/queries/saved_sites.h"
#include "server/robots/roster.h"
#include "server/store/journal.h"

namespace cairn::server {

class Desk {
 public:
  Desk(std::size_t capacity, Outbound& outbound, Roster& roster, Atlas& atlas, JobList& jobs, JobWorker& worker,
       SavedSites& saved_sites, Generation generation, Journal* journal = nullptr);
  ~Desk();

  void Start();
  void Take(Request&& request);
  // What the next answers about the status say. From any thread.
  void SetRefusals(const Refusals& refusals);
  void SetLoad(const ServerLoad& load);
  void SetRos2(Ros2Report&& report);
  // Answers the waiting requests, then returns.
  void Stop();
  // Thread rule: any thread.
  [[nodiscard]] Pulse pulse() const { return {requests_.taken(), requests_.size() > 0}; }

 private:
  // Counts the questions for tiles that sites have not answered yet. Thread-safe; may outlive the desk.
  class SiteQuestions : public std::enable_shared_from_this<SiteQuestions> {
   public:
    [[nodiscard]] std::shared_ptr<const void> Take(std::uint64_t asker);

   private:
    Mutex mutex_;
    std::map<std::uint64_t, int> open_ CAIRN_GUARDED_BY(mutex_);  // By asker; none is 0.
  };

  // Sends a few parts of the answer; what is left waits for the client's next turn.
  void Serve(OpenRequest&& open);
  void Send(OpenRequest& open);
  Reply StatusReply(const Request& request);
  Reply Ros2Reply(const Request& request);
  // Returns nothing if the answer is sent later.
  std::optional<Answer> AnswerTo(const Request& request);
  Result<Job> SubmitJob(const Request& request);
  std::optional<Answer> Relocalise(const Request& request);
  std::optional<Answer> EnableMap(const Request& request);
  std::optional<Answer> EditMap(const Request& request);
  std::optional<Answer> AskTiles(const Request& request);
  // Where the order is taken, the answer is sent when it is on the disk. `then` is called before, on the session's
  // strand.
  template <typename Give>
  std::optional<Answer> Order(const Request& request, const Give& give, const std::function<void(Reply&)>& then = {});
  std::optional<Answer> AnswerAboutJob(const Request& request, Result<Job> job);
  // Both return one snapshot, or none if there is no such robot or site.
  [[nodiscard]] Sessions SessionOf(const std::string& robot) const;
  [[nodiscard]] Maps MapOf(const std::string& site) const;
  [[nodiscard]] Sessions AllSessions() const;
  [[nodiscard]] Maps AllMaps() const;

  Outbound& outbound_;
  Roster& roster_;
  Atlas& atlas_;
  JobList& jobs_;
  JobWorker& worker_;
  SavedSites& saved_sites_;
  const Generation generation_;
  Journal* const journal_;  // Null if nothing is stored.
  Mutex mutex_;
  Refusals refusals_ CAIRN_GUARDED_BY(mutex_);
  ServerLoad load_ CAIRN_GUARDED_BY(mutex_);
  Ros2Report ros2_ CAIRN_GUARDED_BY(mutex_);
  RequestQueue requests_;
  const std::shared_ptr<CommandAnswers> answers_;
  const std::shared_ptr<SiteQuestions> site_questions_ = std::make_shared<SiteQuestions>();
  std::jthread thread_;  // The last member, because it uses the members above.
};

}  // namespace cairn::server
