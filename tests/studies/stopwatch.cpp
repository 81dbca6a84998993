#include "tests/studies/stopwatch.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <limits>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>

namespace cairn::studies {

double UserCpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + static_cast<double>(usage.ru_utime.tv_usec) * 1e-6;
}

// Fields 14 and 15 of /proc/PID/stat (proc(5)).
double CpuSecondsOf(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string text((std::istreambuf_iterator<char>(file)), {});
  std::istringstream fields(text.substr(text.rfind(')') + 2));
  std::string skipped;
  for (int i = 3; i < 14; ++i) fields >> skipped;
  double user = 0.0, system = 0.0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

// Field VmRSS of /proc/PID/status.
double ResidentMibOf(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string word; status >> word;) {
    if (word != "VmRSS:") continue;
    double kib = 0.0;
    status >> kib;
    return kib / 1024.0;
  }
  throw std::runtime_error("process " + std::to_string(pid) + " has ended");
}

Distribution DistributionOf(std::vector<double> samples) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (samples.empty()) return {kNone, kNone, kNone, kNone, kNone, kNone};
  std::sort(samples.begin(), samples.end());
  const double n = static_cast<double>(samples.size());
  const double mean = std::accumulate(samples.begin(), samples.end(), 0.0) / n;
  double squares = 0.0;
  for (const double sample : samples) squares += (sample - mean) * (sample - mean);
  const auto at = [&](double share) {
    return samples[static_cast<std::size_t>(std::clamp(std::ceil(share * n), 1.0, n)) - 1];
  };
  return {mean, std::sqrt(squares / n), at(0.5), at(0.95), at(0.99), samples.back()};
}

}  // namespace cairn::studies
