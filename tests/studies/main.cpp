// cairn-study runs measurements for people: `cairn-study list`, `cairn-study NAME [--out DIR] [--quick]
// [--seed N] [--log F] [--only TEXT] [--seconds S] [--hours H] [--runs N]`.
// Exit codes: 0 done and plausible, 1 the study failed or a figure is not plausible, 2 wrong command line.
#include <CLI/CLI.hpp>
#include <exception>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <string>
#include <vector>

#include "common/version.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

int ListStudies() {
  std::size_t widest = 0;
  for (const Study& study : AllStudies()) widest = std::max(widest, study.name.size());
  for (const Study& study : AllStudies())
    std::cout << std::left << std::setw(static_cast<int>(widest) + 2) << study.name << study.help << '\n';
  return 0;
}

int RunNamed(const Study& study, StudyContext context) {
  Report& report = context.report;
  const std::string& only = context.only;
  const bool quick = context.quick;
  if (!only.empty()) report.Warn("only what is called *" + only + "*");
  if (quick) report.Warn("a quick run: fewer trials and shorter logs than the study is meant for");
  try {
    study.run(context);
  } catch (const std::exception& error) {
    report.Fault(std::string("the study ended early: ") + error.what());
  }
  if (!only.empty() && report.empty()) report.Fault("no part is called *" + only + "*: nothing was measured");
  if (const auto written = report.Finish(); !written) {
    std::cerr << "cairn-study: " << written.error().message << '\n';
    return 1;
  }
  if (report.failed()) std::cerr << "cairn-study: " << study.name << " FAILED; lines that start with !! say why\n";
  return report.failed() ? 1 : 0;
}

int Main(int argc, char** argv) {
  std::string name;
  std::filesystem::path out;
  std::vector<std::filesystem::path> logs;
  std::string only;
  bool quick = false;
  std::uint64_t seed = 1;
  double seconds = 0.0, hours = 0.0;
  int runs = 0;
  CLI::App app{"Measures the estimators and draws the figures: tables, plots, a Markdown report."};
  app.set_version_flag("--version", std::string("cairn-study ") + kVersion);
  app.add_option("NAME", name, "`list` prints the studies")->required();
  app.add_option("--out", out, "Folder for report.md, tables and pictures; without it only text is printed");
  app.add_flag("--quick", quick, "Fewer trials and shorter logs: takes seconds instead of minutes");
  app.add_option("--seed", seed, "Seed of every random engine");
  app.add_option("--log", logs, "A log instead of the study's own choice; repeatable")->check(CLI::ExistingFile);
  app.add_option("--only", only, "For a study with several parts: run only those whose name contains this text");
  app.add_option("--seconds", seconds, "How long to measure, for a study that lets you choose")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--hours", hours, "How much simulated time, for a study that lets you choose")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--runs", runs, "How often to measure, for a study that lets you choose")
      ->check(CLI::NonNegativeNumber);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (name == "list") return ListStudies();
  for (const Study& study : AllStudies()) {
    if (study.name != name) continue;
    Report report(out, "cairn-study " + name, std::cout);
    return RunNamed(study, {report, quick, seed, logs, only, seconds, hours, runs});
  }
  std::cerr << "cairn-study: no study is called '" << name << "'; `cairn-study list` prints them\n";
  return 2;
}

}  // namespace
}  // namespace cairn::studies

int main(int argc, char** argv) {
  return cairn::studies::Main(argc, argv);
}
