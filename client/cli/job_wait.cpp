#include "client/cli/job_wait.h"

#include <fmt/format.h>

#include <chrono>

#include "client/cli/interrupt.h"
#include "client/cli/progress_line.h"
#include "client/cli/text_output.h"

namespace cairn::client {

Result<Job> WaitForEnd(Program& program, const Job& submitted) {
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  ProgressLine progress(program.err(), ErrorIsTerminal(), program.options.json);
  auto job = program.Ask([&](QueryClient& server) {
    return server.WaitForJob(submitted.id, [&](const Job& now) {
      progress.Show(seconds(), now.progress, FormatJob(now));
      return !Interrupted();
    });
  });
  // What became of it is printed by whoever waits.
  if (job) progress.Finish(seconds(), job->progress, fmt::format("job {}: {}", job->id, JobStateName(job->state)));
  return job;
}

}  // namespace cairn::client
