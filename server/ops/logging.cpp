#include "server/ops/logging.h"

#include <spdlog/formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <string>
#include <utility>

#include "server/ops/log_context.h"

namespace cairn::server {
namespace {

// Called on the thread that logs.
class LineFormatter final : public spdlog::formatter {
 public:
  explicit LineFormatter(LogFormat log_format) : format_(log_format) {}

  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& line) override {
    const LogSubject* const fields = LogContext::fields();
    const auto level = spdlog::level::to_string_view(message.level);
    const std::string text =
        LogLine(format_, message.time, {level.data(), level.size()}, {message.payload.data(), message.payload.size()},
                fields == nullptr ? LogSubject{} : *fields);
    line.append(text.data(), text.data() + text.size());
    line.push_back('\n');
  }
  [[nodiscard]] std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<LineFormatter>(format_);
  }

 private:
  const LogFormat format_;
};

}  // namespace

void StartLogging(LogLevel level, LogFormat format) {
  auto logger = std::make_shared<spdlog::logger>("cairnd", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_formatter(std::make_unique<LineFormatter>(format));
  logger->set_level(static_cast<spdlog::level::level_enum>(level));
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(logger));
}

}  // namespace cairn::server
