// A cairnd with its state on the disk, as a process of its own, and what it costs over time: memory, disk, processor
// time, and the time that another server would take to start on the same state. Throws std::runtime_error where
// something cannot be measured. The server is killed at the end.
#pragma once

#include <filesystem>
#include <memory>

#include "tests/child_process.h"
#include "tests/temp_directory.h"

namespace cairn::studies {

class SoakedServer {
 public:
  SoakedServer();  // Returns once it is ready.

  [[nodiscard]] double resident_mib() const;
  [[nodiscard]] double disk_mib() const;
  [[nodiscard]] double cpu_s() const;
  // Copies the state as a SIGKILL would leave it at this moment, and starts a server on the copy, in another domain.
  struct Restart {
    double seconds = 0.0;         // Until it is ready.
    double checkpoint_mib = 0.0;  // The main part of the first session's checkpoint, which is written anew each time.
    double pieces_mib = 0.0;      // Its pieces, each of which is written once.
  };
  [[nodiscard]] Restart RestartOnCopy() const;

 private:
  const TempDirectory directory_;
  std::unique_ptr<ChildProcess> server_;
};

}  // namespace cairn::studies
