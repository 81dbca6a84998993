// The output of a study: a Markdown report with tables and pictures in one folder, and the same text and
// tables on a stream while the study runs. It also records whether the figures are plausible. report.md links
// its pictures by relative names, so the folder can be moved. Not thread-safe.
#pragma once

#include <filesystem>
#include <ostream>
#include <string>

#include "common/status.h"
#include "tests/studies/plot.h"
#include "tests/studies/table.h"

namespace cairn::studies {

class Report {
 public:
  // An empty directory name: no file is written; the output goes only to `out`.
  Report(std::filesystem::path directory, const std::string& title, std::ostream& out);

  void Heading(const std::string& text);
  // A paragraph; Markdown.
  void Text(const std::string& text);
  // Adds a warning, for example that a log is absent or that a figure is worse than the printed one.
  void Warn(const std::string& text);
  // Records a failure of the study, shown as a warning.
  void Fault(const std::string& why);
  // Records the failure `otherwise` if the condition does not hold.
  void Expect(bool holds, const std::string& otherwise);
  [[nodiscard]] bool failed() const { return failed_; }
  // Whether it has no table and no picture.
  [[nodiscard]] bool empty() const { return empty_; }
  // Prints progress on the stream only; it is not part of the report.
  void Progress(const std::string& text);
  // Also written as NAME.csv; blanks in names become underscores.
  void Add(const Table& table, const std::string& name);
  // Written as NAME.png; the plot's title is the caption.
  void Add(const Plot& plot, const std::string& name);
  void Add(const HeatMap& map, const std::string& name);
  void AddMap(const OccupancyImage& map, const Plot& plot, const std::string& name);
  void AddPicture(const RasterImage& picture, const std::string& caption, const std::string& name);

  // Writes report.md. Returns the first file that could not be written, if any.
  [[nodiscard]] Result<void> Finish();
  [[nodiscard]] const std::filesystem::path& directory() const { return directory_; }

 private:
  void WriteFile(const std::string& name, const std::string& bytes);

  const std::filesystem::path directory_;
  std::ostream& out_;
  std::string markdown_;
  Result<void> written_;
  bool failed_ = false;
  bool empty_ = true;
};

}  // namespace cairn::studies
