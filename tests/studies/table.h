// A table of text cells, as people read it (aligned), as Markdown and as CSV. Plain value.
#pragma once

#include <string>
#include <vector>

namespace cairn::studies {

class Table {
 public:
  explicit Table(std::vector<std::string> header) : header_(std::move(header)) {}

  // A row may be shorter than the header (the rest stays empty), not longer.
  void Add(std::vector<std::string> row);

  [[nodiscard]] const std::vector<std::string>& header() const { return header_; }
  [[nodiscard]] const std::vector<std::vector<std::string>>& rows() const { return rows_; }
  [[nodiscard]] bool empty() const { return rows_.empty(); }

  [[nodiscard]] std::string Aligned() const;
  [[nodiscard]] std::string Markdown() const;
  [[nodiscard]] std::string Csv() const;

 private:
  std::vector<std::string> header_;
  std::vector<std::vector<std::string>> rows_;
};

// "3.142"; "-" for what is not a number.
[[nodiscard]] std::string Number(double value, int decimals);
[[nodiscard]] std::string Count(long long value);
// "12.3 %" of a share 0.123.
[[nodiscard]] std::string Percent(double share, int decimals = 1);

}  // namespace cairn::studies
