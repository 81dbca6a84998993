#include "server/queries/jobs.h"

#include "server/queries/answer.h"

namespace cairn::server {

Reply AnswerJob(const Request& request, const Result<Job>& job) {
  if (!job) return ReplyTo(request, job.error());
  return AnswerJobs(request, {*job});
}

Reply AnswerJobs(const Request& request, const std::vector<Job>& jobs) {
  Reply reply = ReplyTo(request);
  reply.jobs = jobs;
  return reply;
}

}  // namespace cairn::server
