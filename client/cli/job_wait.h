// Waits for a job of the server and shows its progress.
#pragma once

#include "client/cli/program.h"
#include "common/service/job.h"

namespace cairn::client {

// Returns the job when it has ended, or as it is when the person has interrupted the waiting.
[[nodiscard]] Result<Job> WaitForEnd(Program& program, const Job& submitted);

}  // namespace cairn::client
