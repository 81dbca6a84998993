// What was measured so far, kept in a file beside the report, so that the study can be made in parts and
// continued. One line a figure, appended as soon as it is known. The file knows nothing of the program:
// remove it after a change of the code. Not thread-safe.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "tests/studies/sensitivity/cases.h"

namespace cairn::studies {

class RunCache {
 public:
  // Reads FILE where it is; an empty path keeps everything in memory. Throws std::runtime_error where it is
  // not such a file.
  explicit RunCache(std::filesystem::path file);

  [[nodiscard]] const Figures* Find(const std::string& key) const;
  // Throws std::runtime_error where it cannot be written.
  void Keep(const std::string& key, const Figures& figures);

 private:
  std::filesystem::path file_;
  std::map<std::string, Figures> runs_;
};

}  // namespace cairn::studies
