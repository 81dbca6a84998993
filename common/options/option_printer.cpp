// PrintYaml of config.h.
#include <algorithm>
#include <sstream>
#include <string>
#include <utility>

#include "common/options/config.h"
#include "common/options/option_fields.h"

namespace cairn {
namespace {

// Double-quoted YAML: any text comes back as it was, whatever it looks like.
std::string Quoted(const std::string& text) {
  constexpr const char* kHex = "0123456789ABCDEF";
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      quoted += "\\x";
      quoted += kHex[byte >> 4];
      quoted += kHex[byte & 15];
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string OneLine(std::string_view text) {
  std::string line(text);
  std::replace(line.begin(), line.end(), '\n', ' ');
  return line;
}

// Prints either the operators' fields or the experts', and no section without a field: it would read as null.
class Printer final : public OptionVisitor {
 public:
  Printer(bool for_operators, std::size_t indent) : for_operators_(for_operators), indent_(indent) {}

  void Section(std::string_view key, std::string_view help, const std::function<void()>& fields) override {
    const std::size_t before = text_.size();
    text_ += Indent() + std::string(key) + ":" + (help.empty() ? "" : "  # " + OneLine(help)) + '\n';
    const std::size_t opened = text_.size();
    indent_ += 2;
    fields();
    indent_ -= 2;
    if (text_.size() == opened) text_.resize(before);
  }
  void Real(std::string_view key, double& value, std::string_view unit, double min, double max,
            const Help& help) override {
    Field(key, ExactText(value), help, RangeText(min, max, unit));
  }
  void Integer(std::string_view key, std::int64_t& value, std::string_view unit, std::int64_t min, std::int64_t max,
               const Help& help) override {
    Field(key, std::to_string(value), help, RangeText(min, max, unit));
  }
  void Flag(std::string_view key, bool& value, const Help& help) override {
    Field(key, value ? "true" : "false", help, "");
  }
  void Text(std::string_view key, std::string& value, const Help& help) override {
    Field(key, Quoted(value), help, "");
  }
  void Choice(std::string_view key, int& value, std::span<const std::string_view> names, const Help& help) override {
    const auto index = static_cast<std::size_t>(value);
    Field(key, index < names.size() ? std::string(names[index]) : "", help, NamesText(names));
  }

  [[nodiscard]] std::string text() && { return std::move(text_); }

 private:
  [[nodiscard]] std::string Indent() const { return std::string(indent_, ' '); }

  void Field(std::string_view key, const std::string& value, const Help& help, const std::string& allowed) {
    if (help.for_operators != for_operators_) return;
    Comment(help.text);
    text_ += Indent() + std::string(key) + ": " + value + (allowed.empty() ? "" : "  # [" + allowed + "]") + '\n';
  }

  // As many lines as it takes, broken between words.
  void Comment(std::string_view text) {
    constexpr std::size_t kColumns = 110;
    std::istringstream words{std::string(text)};
    std::string line;
    for (std::string word; words >> word;) {
      if (!line.empty() && line.size() + 1 + word.size() > kColumns) text_ += std::exchange(line, {}) + '\n';
      line += (line.empty() ? Indent() + "# " : " ") + word;
    }
    if (!line.empty()) text_ += line + '\n';
  }

  const bool for_operators_;
  std::size_t indent_;
  std::string text_;
};

}  // namespace

std::string PrintYaml(const VisitOptions& visit) {
  const auto print = [&visit](bool for_operators, std::size_t indent) {
    Printer printer(for_operators, indent);
    visit(printer);
    return std::move(printer).text();
  };
  const std::string operators = print(true, 0);
  if (operators.empty()) return print(false, 0);
  return "# What a person who runs this may want to set. Every key has a default, which is shown here.\n" + operators +
         "\n# Everything else, for experts. `expert` is only a heading: a key below it has the same name as without "
         "it,\n"
         "# for example --set slam.gate.distance_m=0.5, and a file may leave the heading out.\n"
         "expert:\n" +
         print(false, 2);
}

}  // namespace cairn
