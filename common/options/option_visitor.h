// The interface through which a tree of option structs is read, checked and printed. Each part declares its struct
// and one function `void Visit(OptionVisitor&, XOptions&)` that names every field once, with unit, range and meaning;
// the YAML reader, `--set`, `--print-config`, the range check and the check of rules between fields are visitors. The
// text given here is the only explanation of a field. No look-up by string inside algorithms.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace cairn {

// What a field means: plain full sentences that say what it is and what its growth changes. A text alone is for
// experts; ForOperators marks the fields that a person who runs the system may want to set, and they are printed first.
struct Help {
  // Converting, so that a call holds the text alone.
  Help(const char* explanation) : text(explanation) {}       // NOLINT(google-explicit-constructor)
  Help(std::string_view explanation) : text(explanation) {}  // NOLINT(google-explicit-constructor)

  std::string_view text;
  bool for_operators = false;
};
[[nodiscard]] inline Help ForOperators(Help help) {
  help.for_operators = true;
  return help;
}

class OptionVisitor {
 public:
  virtual ~OptionVisitor() = default;
  // `unit` is "" or "1" where there is none; neither is printed.
  virtual void Section(std::string_view key, std::string_view help, const std::function<void()>& fields) = 0;
  virtual void Real(std::string_view key, double& value, std::string_view unit, double min, double max,
                    const Help& help) = 0;
  virtual void Integer(std::string_view key, std::int64_t& value, std::string_view unit, std::int64_t min,
                       std::int64_t max, const Help& help) = 0;
  virtual void Flag(std::string_view key, bool& value, const Help& help) = 0;
  virtual void Text(std::string_view key, std::string& value, const Help& help) = 0;
  // `value` is an index into `names`.
  virtual void Choice(std::string_view key, int& value, std::span<const std::string_view> names, const Help& help) = 0;
  // A section of the same file that another program reads: whatever it holds is accepted unread.
  virtual void Foreign(std::string_view /*key*/) {}
  // A rule between two fields that were visited before it: where `holds` is false, "`key` (value) `must` `other`
  // (value)" is the error. Keys are relative to the section the rule stands in.
  virtual void Require(bool /*holds*/, std::string_view /*key*/, std::string_view /*must*/,
                       std::string_view /*other*/) {}
};

template <typename Enum>
void VisitEnum(OptionVisitor& visitor, std::string_view key, Enum& value, std::span<const std::string_view> names,
               const Help& help) {
  int index = static_cast<int>(value);
  visitor.Choice(key, index, names, help);
  value = static_cast<Enum>(index);
}

}  // namespace cairn
