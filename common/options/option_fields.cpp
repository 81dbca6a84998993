#include "common/options/option_fields.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

namespace cairn {
namespace {

// Levenshtein's distance: insertions, deletions and replacements that lead from a to b.
std::size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row.back();
}

std::string_view LastPart(std::string_view key) {
  const std::size_t dot = key.rfind('.');
  return dot == std::string_view::npos ? key : key.substr(dot + 1);
}

// The known key most like a wrong one: same last part in another section, or few typing errors away. Else empty.
std::string NearestKey(const std::string& key, const std::set<std::string>& keys) {
  constexpr std::size_t kLongest = 200;  // The distance costs the product of the lengths.
  if (key.size() > kLongest) return {};
  std::string nearest;
  std::size_t best = std::max<std::size_t>(2, key.size() / 4) + 1;
  for (const std::string& known : keys) {
    const std::size_t distance = LastPart(known) == LastPart(key) ? 1 : EditDistance(known, key);
    if (distance < best) {
      best = distance;
      nearest = known;
    }
  }
  return nearest;
}

// Visits the tree once: checks (and where `write`, sets) the fields that have an assignment, and learns all keys.
class Assigner final : public SectionVisitor {
 public:
  Assigner(const std::map<std::string, const Assignment*>& assignments, bool write)
      : assignments_(assignments), write_(write) {}

  void Real(std::string_view key, double& value, std::string_view unit, double min, double max,
            const Help& /*help*/) override {
    Number(key, value, "a number", min, max, unit);
  }
  void Integer(std::string_view key, std::int64_t& value, std::string_view unit, std::int64_t min, std::int64_t max,
               const Help& /*help*/) override {
    Number(key, value, "a whole number", min, max, unit);
  }
  void Flag(std::string_view key, bool& value, const Help& /*help*/) override {
    const Assignment* given = Find(key);
    if (given == nullptr) return;
    if (given->text != "true" && given->text != "false")
      return Complain(*given, "is not a truth value", "true or false");
    if (write_) value = given->text == "true";
  }
  void Text(std::string_view key, std::string& value, const Help& /*help*/) override {
    const Assignment* given = Find(key);
    if (given == nullptr) return;
    if (!given->text) return Complain(*given, "", "a text; an empty one is \"\"");
    if (write_) value = *given->text;
  }
  void Choice(std::string_view key, int& value, std::span<const std::string_view> names,
              const Help& /*help*/) override {
    const Assignment* given = Find(key);
    if (given == nullptr) return;
    const auto found = std::find(names.begin(), names.end(), given->text);
    if (found == names.end()) return Complain(*given, "is not a choice", NamesText(names));
    if (write_) value = static_cast<int>(found - names.begin());
  }

  void Foreign(std::string_view key) override { foreign_.insert(FullKey(key)); }

  [[nodiscard]] const std::set<std::string>& keys() const { return keys_; }
  [[nodiscard]] bool IsForeign(const std::string& key) const {
    return foreign_.count(key.substr(0, key.find('.'))) > 0;
  }
  [[nodiscard]] const std::set<std::string>& sections() const { return sections_; }
  [[nodiscard]] const std::map<std::string, std::string>& problems() const { return problems_; }

 private:
  void OnSection(const std::string& full_key) override { sections_.insert(full_key); }

  const Assignment* Find(std::string_view key) {
    const auto inserted = keys_.insert(FullKey(key)).first;
    const auto found = assignments_.find(*inserted);
    return found == assignments_.end() ? nullptr : found->second;
  }

  template <typename Value>
  void Number(std::string_view key, Value& value, const std::string& what, Value min, Value max,
              std::string_view unit) {
    const Assignment* given = Find(key);
    if (given == nullptr) return;
    Value parsed{};
    std::string_view text = given->text ? std::string_view(*given->text) : "";
    if (text.size() > 1 && text.front() == '+') text.remove_prefix(1);
    if (!ParseNumber(text, parsed)) return Complain(*given, "is not " + what, RangeText(min, max, unit));
    if (!(parsed >= min && parsed <= max)) return Complain(*given, "is out of range", RangeText(min, max, unit));
    if (write_) value = parsed;
  }

  void Complain(const Assignment& given, const std::string& problem, const std::string& allowed) {
    constexpr std::size_t kLongest = 60;
    const std::string what = given.text ? "'" + given.text->substr(0, kLongest) + "' " + problem : "has no value";
    problems_[given.key] = what + " (allowed: " + allowed + ")";
  }

  const std::map<std::string, const Assignment*>& assignments_;
  const bool write_;
  std::set<std::string> keys_, sections_, foreign_;
  std::map<std::string, std::string> problems_;
};

std::string ProblemOf(const Assignment& assignment, const Assigner& checked) {
  const std::string& key = assignment.key;
  if (const auto found = checked.problems().find(key); found != checked.problems().end()) return found->second;
  if (checked.keys().count(key) > 0 || checked.IsForeign(key)) return {};
  if (checked.sections().count(key) > 0) return assignment.text ? "is a section, not a single value" : "";
  const std::string nearest = NearestKey(key, checked.keys());
  return "unknown key" + (nearest.empty() ? "" : " (did you mean " + nearest + "?)");
}

std::string WithUnit(const std::string& text, std::string_view unit) {
  return unit.empty() || unit == "1" ? text : text + " " + std::string(unit);
}

}  // namespace

void SectionVisitor::Section(std::string_view key, std::string_view /*help*/, const std::function<void()>& fields) {
  OnSection(FullKey(key));
  const std::size_t length = prefix_.size();
  prefix_ += std::string(key) + ".";
  fields();
  prefix_.resize(length);
}

Result<void> Assign(const std::vector<Assignment>& assignments, const VisitOptions& visit) {
  std::map<std::string, const Assignment*> by_key;
  for (const Assignment& assignment : assignments) by_key[assignment.key] = &assignment;
  Assigner check(by_key, false);
  visit(check);
  for (const Assignment& assignment : assignments) {
    const std::string problem = ProblemOf(assignment, check);
    if (!problem.empty()) {
      return Fail(StatusCode::kInvalidArgument, assignment.place + ": " + assignment.key + ": " + problem);
    }
  }
  Assigner write(by_key, true);
  visit(write);
  return {};
}

std::string RangeText(double min, double max, std::string_view unit) {
  return WithUnit(ExactText(min) + ".." + ExactText(max), unit);
}

std::string RangeText(std::int64_t min, std::int64_t max, std::string_view unit) {
  return WithUnit(std::to_string(min) + ".." + std::to_string(max), unit);
}

std::string NamesText(std::span<const std::string_view> names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " or " : ", ";
    text += names[i];
  }
  return text;
}

}  // namespace cairn
