// A log text read whole: for tests.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/sensor/log_reader.h"
#include "tests/temp_directory.h"

namespace cairn {

struct LogContent {
  std::vector<Scan> scans;
  std::vector<Odometry> odometries;
  std::vector<LogRecord> records;
  LogSummary summary;
};

inline LogContent ReadAll(const std::filesystem::path& path, const LogReaderOptions& options = {}) {
  LogContent content;
  const auto summary = ReadLog(path, options, [&](LogRecord&& record) {
    if (const auto* scan = std::get_if<Scan>(&record)) content.scans.push_back(*scan);
    if (const auto* odometry = std::get_if<Odometry>(&record)) content.odometries.push_back(*odometry);
    content.records.push_back(std::move(record));
    return true;
  });
  if (!summary) {
    ADD_FAILURE() << summary.error().message;
  } else {
    content.summary = *summary;
  }
  return content;
}

inline LogContent ReadText(const std::string& text, const LogReaderOptions& options = {}) {
  const TempDirectory directory;
  return ReadAll(directory.Write("log.clf", text), options);
}

}  // namespace cairn
