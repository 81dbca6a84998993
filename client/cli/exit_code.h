// What the program tells its caller: scripts may rely on these numbers.
#pragma once

namespace cairn::client {

enum class ExitCode : int {
  kOk = 0,
  kFailed = 1,  // The question was clear, the answer is no: refused, not found, no server, unexplained scans.
  kUsage = 2,   // The command line makes no sense.
};

}  // namespace cairn::client
