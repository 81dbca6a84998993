// What a study is and where the program finds it. A study measures something for people: it prints tables,
// writes plots and a Markdown report, and says whether what it measured is plausible. It is not a test: it may take
// minutes and is not part of the normal test run. Each study's file ends with one line that registers it:
//
//   const Registration kRegistered{"thesis-a", "line extraction, matching, FastSLAM beside thesis A", RunThesisA};
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tests/studies/report.h"

namespace cairn::studies {

struct StudyContext {
  Report& report;          // Tables, plots and words go here; also printed as they come.
  bool quick = false;      // Seconds instead of minutes: fewer trials, shorter logs, same tables.
  std::uint64_t seed = 1;  // Seed of every random engine. The same seed gives the same figures (except times).
  std::vector<std::filesystem::path> logs{};  // --log: instead of the study's own choice.

  std::string
      only{};  // --only: of a study in named parts or of named systems, those whose name contains this; empty: all.

  // --seconds, --hours and --runs, for a study that names them: how long it measures, how much simulated time, and how
  // often. 0: the study's own choice.
  double seconds = 0.0;
  double hours = 0.0;
  int runs = 0;

  [[nodiscard]] bool Wants(const std::string& name) const { return name.find(only) != std::string::npos; }

  // The larger number, or the smaller one of a quick run.
  template <typename T>
  [[nodiscard]] T Pick(T full, T small) const {
    return quick ? small : full;
  }
};

// Report::Expect and Report::Fault tell where a figure is not plausible or the study could not be made.
using RunStudy = std::function<void(StudyContext&)>;

struct Study {
  std::string name;  // As on the command line.
  std::string help;  // One line.
  RunStudy run;
};

// All registered studies by name.
[[nodiscard]] std::vector<Study> AllStudies();

struct Registration {
  Registration(std::string name, std::string help, RunStudy run);
};

}  // namespace cairn::studies
