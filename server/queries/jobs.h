// "How is this job, and which jobs are there?" Pure functions of copies.
#pragma once

#include <vector>

#include "common/service/request.h"

namespace cairn::server {

[[nodiscard]] Reply AnswerJob(const Request& request, const Result<Job>& job);
[[nodiscard]] Reply AnswerJobs(const Request& request, const std::vector<Job>& jobs);

}  // namespace cairn::server
