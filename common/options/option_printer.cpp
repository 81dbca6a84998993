// PrintYaml of config.h.
#include <algorithm>
#include <string>

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

class Printer final : public OptionVisitor {
 public:
  void Section(std::string_view key, std::string_view help, const std::function<void()>& fields) override {
    Line(key, "", help, "");
    const std::size_t before = text_.size();
    indent_ += 2;
    fields();
    indent_ -= 2;
    // An empty section would read as null, which is no section.
    if (text_.size() == before) text_.insert(before - 1, "  # (empty)");
  }
  void Real(std::string_view key, double& value, std::string_view unit, double min, double max,
            std::string_view help) override {
    Line(key, ExactText(value), help, RangeText(min, max, unit));
  }
  void Integer(std::string_view key, std::int64_t& value, std::string_view unit, std::int64_t min, std::int64_t max,
               std::string_view help) override {
    Line(key, std::to_string(value), help, RangeText(min, max, unit));
  }
  void Flag(std::string_view key, bool& value, std::string_view help) override {
    Line(key, value ? "true" : "false", help, "");
  }
  void Text(std::string_view key, std::string& value, std::string_view help) override {
    Line(key, Quoted(value), help, "");
  }
  void Choice(std::string_view key, int& value, std::span<const std::string_view> names,
              std::string_view help) override {
    const auto index = static_cast<std::size_t>(value);
    Line(key, index < names.size() ? std::string(names[index]) : "", help, NamesText(names));
  }

  [[nodiscard]] std::string text() && { return std::move(text_); }

 private:
  void Line(std::string_view key, const std::string& value, std::string_view help, const std::string& allowed) {
    std::string comment(help);
    if (!allowed.empty()) comment += (comment.empty() ? "[" : " [") + allowed + "]";
    std::replace(comment.begin(), comment.end(), '\n', ' ');
    text_ += std::string(static_cast<std::size_t>(indent_), ' ') + std::string(key) + ":";
    if (!value.empty()) text_ += " " + value;
    if (!comment.empty()) text_ += "  # " + comment;
    text_ += '\n';
  }

  std::string text_;
  int indent_ = 0;
};

}  // namespace

std::string PrintYaml(const VisitOptions& visit) {
  Printer printer;
  visit(printer);
  return std::move(printer).text();
}

}  // namespace cairn
