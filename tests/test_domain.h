// A DDS domain of this process's own.
#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace cairn::test {

// Another domain with each call: 1..200, held by a file lock until the process ends, so that tests run side by side.
inline std::int64_t AnotherTestDomain() {
  for (int i = 0; i < 200; ++i) {
    const int candidate = 1 + (getpid() + i) % 200;
    const std::string path = std::filesystem::temp_directory_path() / ("cairn-domain-" + std::to_string(candidate));
    const int file = open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
    if (file >= 0 && flock(file, LOCK_EX | LOCK_NB) == 0) return candidate;
    if (file >= 0) close(file);
  }
  throw std::runtime_error("all DDS test domains are in use");
}

// The same with each call.
inline std::int64_t TestDomain() {
  static const std::int64_t domain = AnotherTestDomain();
  return domain;
}

}  // namespace cairn::test
