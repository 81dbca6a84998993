#include "common/sensor/log_lines.h"

namespace cairn {

LogLines::LogLines(const std::filesystem::path& path) : file_(path, std::ios::binary) {}

// Appends one block to the buffer; false at the end of the file.
bool LogLines::Fill() {
  constexpr std::size_t kBlock = 256u << 10;
  buffer_.erase(0, begin_);
  begin_ = 0;
  const std::size_t old_size = buffer_.size();
  buffer_.resize(old_size + kBlock);
  file_.read(buffer_.data() + old_size, kBlock);
  const auto count = static_cast<std::size_t>(file_.gcount());
  buffer_.resize(old_size + count);
  failed_ = failed_ || file_.bad();
  return count > 0;
}

bool LogLines::Next(std::string_view& line) {
  too_long_ = false;
  std::size_t searched = begin_;
  for (;;) {
    const std::size_t end = buffer_.find('\n', searched);
    if (end != std::string::npos) {
      line = std::string_view(buffer_).substr(begin_, end - begin_);
      begin_ = end + 1;
      break;
    }
    if (buffer_.size() - begin_ > kMaxLength) {
      too_long_ = true;
      begin_ = buffer_.size();  // Forget what was read; go on to the line's end.
    }
    const std::size_t pending = buffer_.size() - begin_;
    if (!Fill()) {
      if (pending == 0 && !too_long_) return false;
      line = std::string_view(buffer_).substr(begin_);
      begin_ = buffer_.size();
      break;
    }
    searched = pending;
  }
  if (too_long_) line = {};
  ++number_;
  return true;
}

}  // namespace cairn
