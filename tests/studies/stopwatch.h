// Time used, as wall-clock time and as processor time. Studies are often run on machines that do other work at the same
// time; then only the processor time of this process can be compared, so both are printed.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <ctime>
#include <vector>

namespace cairn::studies {

class Stopwatch {
 public:
  Stopwatch() { Restart(); }
  void Restart() {
    wall_ = std::chrono::steady_clock::now();
    cpu_ = CpuNow();
  }
  [[nodiscard]] double WallMs() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - wall_).count();
  }
  // Of all threads of this process.
  [[nodiscard]] double CpuMs() const { return CpuNow() - cpu_; }

 private:
  static double CpuNow() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
  }
  std::chrono::steady_clock::time_point wall_;
  double cpu_ = 0.0;
};

// Processor time in user mode of the whole process so far.
[[nodiscard]] double UserCpuSeconds();
// Processor time that another process has used so far. REQUIRES: there is such a process.
[[nodiscard]] double CpuSecondsOf(pid_t pid);

// Memory of another process that is in RAM now. Throws std::runtime_error if there is no such process.
[[nodiscard]] double ResidentMibOf(pid_t pid);

struct Distribution {
  double mean = 0.0, deviation = 0.0, median = 0.0, p95 = 0.0, p99 = 0.0, max = 0.0;
};
// Nearest rank; NaN without samples.
[[nodiscard]] Distribution DistributionOf(std::vector<double> samples);

}  // namespace cairn::studies
