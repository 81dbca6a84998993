#include "common/bag/recording.h"

#include <system_error>
#include <utility>

#include "common/bag/bag_file.h"

namespace cairn {

Result<LogSummary> ReadRecording(const std::filesystem::path& path, const LogReaderOptions& options,
                                 const std::function<bool(LogRecord&&)>& sink) {
  return ReadLidars(path, options, [&](LogRecord&& record, std::size_t) { return sink(std::move(record)); });
}

Result<LogSummary> ReadLidars(const std::filesystem::path& path, const LogReaderOptions& options,
                              const bag::RecordingSink& sink) {
  std::error_code error;
  const bool is_bag = std::filesystem::is_directory(path, error) || bag::KindOf(path) != bag::FileKind::kNone;
  if (is_bag) return bag::ReadBag(path, options, sink);
  return ReadLog(path, options, [&](LogRecord&& record) { return sink(std::move(record), 0); });
}

}  // namespace cairn
