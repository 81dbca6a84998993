// CheckRules of config.h.
#include <map>
#include <string>

#include "common/options/config.h"
#include "common/options/option_fields.h"

namespace cairn {
namespace {

// Remembers the values it passes, and the first rule that they break.
class RuleChecker final : public SectionVisitor {
 public:
  void Real(std::string_view key, double& value, std::string_view, double, double, const Help&) override {
    Keep(key, ExactText(value));
  }
  void Integer(std::string_view key, std::int64_t& value, std::string_view, std::int64_t, std::int64_t,
               const Help&) override {
    Keep(key, std::to_string(value));
  }
  void Flag(std::string_view key, bool& value, const Help&) override { Keep(key, value ? "true" : "false"); }
  void Text(std::string_view key, std::string& value, const Help&) override { Keep(key, "\"" + value + "\""); }
  void Choice(std::string_view key, int& value, std::span<const std::string_view> names, const Help&) override {
    Keep(key, std::string(names[static_cast<std::size_t>(value)]));
  }

  void Require(bool holds, std::string_view key, std::string_view must, std::string_view other) override {
    const std::string first = WithValue(key), second = WithValue(other);  // Also of rules that hold: keys must exist.
    if (problem_.empty() && !holds) problem_ = first + " " + std::string(must) + " " + second;
  }

  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  void Keep(std::string_view key, std::string value) { values_[FullKey(key)] = std::move(value); }

  std::string WithValue(std::string_view key) {
    const auto found = values_.find(FullKey(key));
    if (found == values_.end()) problem_ = "a rule names a key that no field before it has: " + FullKey(key);
    return found == values_.end() ? "" : found->first + " (" + found->second + ")";
  }

  std::map<std::string, std::string> values_;
  std::string problem_;
};

}  // namespace

Result<void> CheckRules(const VisitOptions& visit) {
  RuleChecker checker;
  visit(checker);
  if (!checker.problem().empty()) return Fail(StatusCode::kInvalidArgument, checker.problem());
  return {};
}

}  // namespace cairn
