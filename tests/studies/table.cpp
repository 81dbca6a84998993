#include "tests/studies/table.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <functional>
#include <utility>

namespace cairn::studies {
namespace {

// Characters, not bytes: cells may hold a degree sign or a sigma.
std::size_t WidthOf(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char byte) { return (static_cast<unsigned char>(byte) & 0xC0) != 0x80; }));
}

std::vector<std::size_t> WidthsOf(const Table& table) {
  std::vector<std::size_t> widths;
  for (const std::string& cell : table.header()) widths.push_back(WidthOf(cell));
  for (const auto& row : table.rows())
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], WidthOf(row[i]));
  return widths;
}

bool LooksLikeNumber(const std::string& cell) {
  return !cell.empty() && (std::isdigit(static_cast<unsigned char>(cell[0])) != 0 || cell[0] == '-' || cell[0] == '+');
}

// First column to the left, numbers to the right.
std::string Padded(const std::string& cell, std::size_t width, bool right) {
  const std::string blanks(width - WidthOf(cell), ' ');
  return right ? blanks + cell : cell + blanks;
}

std::string Quoted(const std::string& cell) {
  if (cell.find_first_of(",\"\n") == std::string::npos) return cell;
  std::string quoted = "\"";
  for (const char c : cell) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

std::string Escaped(const std::string& cell) {
  std::string escaped;
  for (const char c : cell) escaped += c == '|' ? std::string("\\|") : std::string(1, c);
  return escaped;
}

std::string Line(const std::vector<std::string>& row, const std::vector<std::size_t>& widths, const std::string& start,
                 const std::string& between, const std::string& end,
                 const std::function<std::string(const std::string&)>& of) {
  std::string line = start;
  for (std::size_t i = 0; i < row.size(); ++i) {
    const std::string cell = of(row[i]);
    const std::size_t width = std::max(widths[i], WidthOf(cell));
    line += (i == 0 ? "" : between) + Padded(cell, width, i > 0 && LooksLikeNumber(cell));
  }
  line += end;
  while (!line.empty() && line.back() == ' ') line.pop_back();
  return line + '\n';
}

}  // namespace

void Table::Add(std::vector<std::string> row) {
  row.resize(header_.size());
  rows_.push_back(std::move(row));
}

std::string Table::Aligned() const {
  const auto widths = WidthsOf(*this);
  const auto same = [](const std::string& cell) { return cell; };
  std::string text = Line(header_, widths, "  ", "  ", "", same);
  std::size_t total = 2 * (widths.empty() ? 0 : widths.size() - 1);
  for (const std::size_t width : widths) total += width;
  text += "  " + std::string(total, '-') + '\n';
  for (const auto& row : rows_) text += Line(row, widths, "  ", "  ", "", same);
  return text;
}

std::string Table::Markdown() const {
  const auto widths = WidthsOf(*this);
  std::string text = Line(header_, widths, "| ", " | ", " |", Escaped) + "|";
  for (std::size_t i = 0; i < widths.size(); ++i) text += std::string(widths[i] + 1, '-') + (i == 0 ? "-|" : ":|");
  text += '\n';
  for (const auto& row : rows_) text += Line(row, widths, "| ", " | ", " |", Escaped);
  return text;
}

std::string Table::Csv() const {
  std::string text;
  const auto add = [&text](const std::vector<std::string>& row) {
    for (std::size_t i = 0; i < row.size(); ++i) text += (i == 0 ? "" : ",") + Quoted(row[i]);
    text += '\n';
  };
  add(header_);
  for (const auto& row : rows_) add(row);
  return text;
}

std::string Number(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

std::string Count(long long value) {
  return std::to_string(value);
}

std::string Percent(double share, int decimals) {
  return std::isfinite(share) ? Number(100.0 * share, decimals) + " %" : "-";
}

}  // namespace cairn::studies
