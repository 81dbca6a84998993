#include "tests/studies/report.h"

#include <fstream>
#include <system_error>
#include <utility>

namespace cairn::studies {
namespace {

// Markdown links break at blanks, file systems at slashes.
std::string FileStem(std::string name) {
  for (char& c : name)
    if (c == ' ' || c == '/') c = '_';
  return name;
}

}  // namespace

Report::Report(std::filesystem::path directory, const std::string& title, std::ostream& out)
    : directory_(std::move(directory)), out_(out) {
  markdown_ = "# " + title + "\n";
  out_ << "== " << title << '\n';
  if (directory_.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(directory_, error);
  if (error) written_ = Fail(StatusCode::kUnavailable, "cannot make " + directory_.string() + ": " + error.message());
}

void Report::Heading(const std::string& text) {
  markdown_ += "\n## " + text + "\n";
  out_ << "\n-- " << text << '\n' << std::flush;
}

void Report::Text(const std::string& text) {
  markdown_ += "\n" + text + "\n";
  out_ << text << '\n' << std::flush;
}

void Report::Warn(const std::string& text) {
  markdown_ += "\n> **Mind:** " + text + "\n";
  out_ << "!! " << text << '\n' << std::flush;
}

void Report::Fault(const std::string& why) {
  failed_ = true;
  Warn(why);
}

void Report::Expect(bool holds, const std::string& otherwise) {
  if (!holds) Fault(otherwise);
}

void Report::Progress(const std::string& text) {
  out_ << "   " << text << '\n' << std::flush;
}

void Report::Add(const Table& table, const std::string& name) {
  empty_ = false;
  markdown_ += "\n" + table.Markdown();
  out_ << '\n' << table.Aligned() << '\n' << std::flush;
  WriteFile(FileStem(name) + ".csv", table.Csv());
}

void Report::Add(const Plot& plot, const std::string& name) {
  AddPicture(DrawPlot(plot), plot.title, name);
}

void Report::Add(const HeatMap& map, const std::string& name) {
  AddPicture(DrawHeatMap(map), map.title, name);
}

void Report::AddMap(const OccupancyImage& map, const Plot& plot, const std::string& name) {
  AddPicture(DrawMap(map, plot), plot.title, name);
}

void Report::AddPicture(const RasterImage& picture, const std::string& caption, const std::string& name) {
  empty_ = false;
  const auto png = EncodeImage(picture, ".png", 6);
  if (!png) {
    if (written_) written_ = tl::unexpected<Status>(png.error());
    return;
  }
  WriteFile(FileStem(name) + ".png", std::string(png->begin(), png->end()));
  markdown_ += "\n![" + caption + "](" + FileStem(name) + ".png)\n";
  if (!directory_.empty()) out_ << "   " << (directory_ / (FileStem(name) + ".png")).string() << '\n' << std::flush;
}

Result<void> Report::Finish() {
  WriteFile("report.md", markdown_);
  if (!directory_.empty() && written_) out_ << "\nreport: " << (directory_ / "report.md").string() << '\n';
  return written_;
}

void Report::WriteFile(const std::string& name, const std::string& bytes) {
  if (directory_.empty() || !written_) return;
  std::ofstream file(directory_ / name, std::ios::binary);
  file << bytes;
  if (!file.flush()) written_ = Fail(StatusCode::kUnavailable, "cannot write " + (directory_ / name).string());
}

}  // namespace cairn::studies
