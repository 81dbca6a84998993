// What a study leaves behind: a Markdown report with its tables and pictures in one folder, and the same words and
// tables on a stream as they come; and whether what was measured is plausible. report.md links its pictures by name, so
// the folder can be moved as a whole. Not thread-safe.
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
  // An empty directory: nothing is written, only `out` gets to see it.
  Report(std::filesystem::path directory, const std::string& title, std::ostream& out);

  void Heading(const std::string& text);
  // A paragraph; Markdown.
  void Text(const std::string& text);
  // What must not be overlooked: a log that is absent, a figure worse than the printed one.
  void Warn(const std::string& text);
  // What makes the study fail; shown as a warning.
  void Fault(const std::string& why);
  // Fails, saying `otherwise`, where it does not hold.
  void Expect(bool holds, const std::string& otherwise);
  [[nodiscard]] bool failed() const { return failed_; }
  // Only for who watches: not part of the report.
  void Progress(const std::string& text);
  // Also written as NAME.csv; blanks in names become underscores.
  void Add(const Table& table, const std::string& name);
  // Written as NAME.png; the plot's title is the caption.
  void Add(const Plot& plot, const std::string& name);
  void Add(const HeatMap& map, const std::string& name);
  void AddMap(const OccupancyImage& map, const Plot& plot, const std::string& name);
  void AddPicture(const RasterImage& picture, const std::string& caption, const std::string& name);

  // Writes report.md. Says the first thing that could not be written, if any.
  [[nodiscard]] Result<void> Finish();
  [[nodiscard]] const std::filesystem::path& directory() const { return directory_; }

 private:
  void WriteFile(const std::string& name, const std::string& bytes);

  const std::filesystem::path directory_;
  std::ostream& out_;
  std::string markdown_;
  Result<void> written_;
  bool failed_ = false;
};

}  // namespace cairn::studies
