// What a thread works on. A room makes a LogContext while it works on something, and every line that this thread logs
// meanwhile carries its fields (logging.h). Contexts nest: the inner one is used until it is destroyed. It costs the
// copies of its texts, and no lock.
// Thread rule: a context is made and destroyed by one thread, and counts for this thread only.
#pragma once

#include <string>
#include <utility>

#include "common/log_line.h"

namespace cairn::server {

// For work on a robot in a site, or on a site alone.
[[nodiscard]] inline LogSubject AboutRobot(const std::string& robot, const std::string& site) {
  LogSubject fields;
  fields.robot = robot;
  fields.site = site;
  return fields;
}
[[nodiscard]] inline LogSubject AboutSite(const std::string& site) {
  return AboutRobot({}, site);
}

class LogContext {
 public:
  explicit LogContext(LogSubject fields) : fields_(std::move(fields)), outer_(std::exchange(innermost, this)) {}
  ~LogContext() { innermost = outer_; }
  LogContext(const LogContext&) = delete;
  LogContext& operator=(const LogContext&) = delete;

  // Those of the calling thread; null where it has no context.
  [[nodiscard]] static const LogSubject* fields() { return innermost == nullptr ? nullptr : &innermost->fields_; }

 private:
  static inline thread_local const LogContext* innermost = nullptr;

  const LogSubject fields_;
  const LogContext* const outer_;
};

}  // namespace cairn::server
