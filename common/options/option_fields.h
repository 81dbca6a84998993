// The options tree flattened: every field under its full dotted key, and assignments of texts to them. What YAML files
// and `--set` share. Not thread-safe.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/options/config.h"
#include "common/options/number_text.h"

namespace cairn {

struct Assignment {
  std::string place;                // For errors: "cairnd.yaml:12" or "--set".
  std::string key;                  // Full dotted key.
  std::optional<std::string> text;  // Nothing if the key has no value, which is allowed for sections only.
};

// Assigns all, or nothing if one is in error. Later assignments of a key win.
[[nodiscard]] Result<void> Assign(const std::vector<Assignment>& assignments, const VisitOptions& visit);

// "2..10 m", "true or false", "a, b or c".
[[nodiscard]] std::string RangeText(double min, double max, std::string_view unit);
[[nodiscard]] std::string RangeText(std::int64_t min, std::int64_t max, std::string_view unit);
[[nodiscard]] std::string NamesText(std::span<const std::string_view> names);

// A visitor that keeps the dotted prefix of the section it is in.
class SectionVisitor : public OptionVisitor {
 public:
  void Section(std::string_view key, std::string_view help, const std::function<void()>& fields) override;

 protected:
  [[nodiscard]] std::string FullKey(std::string_view key) const { return prefix_ + std::string(key); }
  virtual void OnSection(const std::string& /*full_key*/) {}

 private:
  std::string prefix_;
};

}  // namespace cairn
