// The exit codes of the program. Scripts may rely on these numbers.
#pragma once

namespace cairn::client {

enum class ExitCode : int {
  kOk = 0,
  kFailed = 1,  // The command was understood but failed: refused, not found, no server, unexplained scans.
  kUsage = 2,   // The command line is wrong.
};

}  // namespace cairn::client
