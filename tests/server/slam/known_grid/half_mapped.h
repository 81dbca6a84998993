// A drive through the world `building`, of which the first half has been mapped, and robots that are only localised in
// that map.
#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/known_grid_of.h"
#include "tests/server/slam/simulated_drive.h"

namespace cairn::slam::test {

// A robot that has mapped the first half of a drive, and the records of the second.
struct HalfMapped {
  Drive drive = SimulatedDrive(240.0);
  MapperOptions options;
  std::shared_ptr<const KnownGrid> map;
  std::size_t half = 0;

  HalfMapped() {
    options.filter.particles = 30;
    ScanPipeline first(options, drive.T_map_robot_start, SerialFor,
                       {.used = [](const Scan&, const ScanOutcome&) {}, .dropped = [](const Scan&, DropReason) {}});
    half = drive.records.size() / 2;
    for (std::size_t i = 0; i < half; ++i) AddTo(first, i);
    map = KnownGridOf(first.mapper().grid());
  }
  void AddTo(ScanPipeline& pipeline, std::size_t record) const {
    if (const auto* odometry = std::get_if<Odometry>(&drive.records[record])) return pipeline.Add(*odometry);
    pipeline.Add(std::make_shared<const Scan>(std::get<Scan>(drive.records[record])));
  }
};

inline const HalfMapped& Mapped() {
  static const HalfMapped mapped;
  return mapped;
}

struct Localised {
  std::vector<ScanOutcome> outcomes;
  ScanPipeline pipeline;

  explicit Localised(const Pose2& start = {}, const MapperOptions& options = Mapped().options)
      : pipeline(options, start, SerialFor,
                 {.used = [this](const Scan&, const ScanOutcome& outcome) { outcomes.push_back(outcome); },
                  .dropped = [](const Scan&, DropReason) {}}) {}
  void Add(std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) Mapped().AddTo(pipeline, i);
  }
  [[nodiscard]] std::size_t localized() const {
    return static_cast<std::size_t>(
        std::count_if(outcomes.begin(), outcomes.end(), [](const ScanOutcome& one) { return one.localized; }));
  }
};

// All records, mapped: for comparison.
inline const std::vector<ScanOutcome>& MappedOutcomes() {
  static const std::vector<ScanOutcome> outcomes = [] {
    Localised mapping(Mapped().drive.T_map_robot_start);
    mapping.Add(0, Mapped().drive.records.size());
    return mapping.outcomes;
  }();
  return outcomes;
}

}  // namespace cairn::slam::test
