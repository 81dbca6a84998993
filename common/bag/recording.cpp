#include "common/bag/recording.h"

#include <system_error>

#include "common/bag/bag_file.h"
#include "common/bag/bag_reader.h"

namespace cairn {

Result<LogSummary> ReadRecording(const std::filesystem::path& path, const LogReaderOptions& options,
                                 const std::function<bool(LogRecord&&)>& sink) {
  std::error_code error;
  const bool is_bag = std::filesystem::is_directory(path, error) || bag::KindOf(path) != bag::FileKind::kNone;
  return is_bag ? bag::ReadBag(path, options, sink) : ReadLog(path, options, sink);
}

}  // namespace cairn
