// Lines of a text file of any size in bounded memory: a line longer than the bound is reported, not stored.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace cairn {

class LogLines {
 public:
  static constexpr std::size_t kMaxLength = 4u << 20;

  explicit LogLines(const std::filesystem::path& path);
  [[nodiscard]] bool is_open() const { return file_.is_open(); }

  // The next line without its end; false at the end of the file. The view lives until the next call.
  [[nodiscard]] bool Next(std::string_view& line);
  [[nodiscard]] int number() const { return number_; }       // 1-based, of the line last returned.
  [[nodiscard]] bool too_long() const { return too_long_; }  // The line last returned was cut: do not parse it.
  [[nodiscard]] bool failed() const { return failed_; }      // Reading failed, e.g. because the path is a directory.

 private:
  bool Fill();

  std::ifstream file_;
  std::string buffer_;
  std::size_t begin_ = 0;
  int number_ = 0;
  bool too_long_ = false;
  bool failed_ = false;
};

}  // namespace cairn
