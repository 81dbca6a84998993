// How a tree of option structs shows its fields to whoever reads, checks or prints them. Each part declares its struct
// and one function `void Visit(OptionVisitor&, XOptions&)` that names every field once, with unit, range and meaning;
// the YAML reader, `--set`, `--print-config` and the range check are visitors. No look-up by string inside algorithms.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace cairn {

class OptionVisitor {
 public:
  virtual ~OptionVisitor() = default;
  // `unit` is "" or "1" where there is none; neither is printed.
  virtual void Section(std::string_view key, std::string_view help, const std::function<void()>& fields) = 0;
  virtual void Real(std::string_view key, double& value, std::string_view unit, double min, double max,
                    std::string_view help) = 0;
  virtual void Integer(std::string_view key, std::int64_t& value, std::string_view unit, std::int64_t min,
                       std::int64_t max, std::string_view help) = 0;
  virtual void Flag(std::string_view key, bool& value, std::string_view help) = 0;
  virtual void Text(std::string_view key, std::string& value, std::string_view help) = 0;
  // `value` is an index into `names`.
  virtual void Choice(std::string_view key, int& value, std::span<const std::string_view> names,
                      std::string_view help) = 0;
  // A section of the same file that another program reads: whatever it holds is accepted unread.
  virtual void Foreign(std::string_view /*key*/) {}
};

template <typename Enum>
void VisitEnum(OptionVisitor& visitor, std::string_view key, Enum& value, std::span<const std::string_view> names,
               std::string_view help) {
  int index = static_cast<int>(value);
  visitor.Choice(key, index, names, help);
  value = static_cast<Enum>(index);
}

}  // namespace cairn
