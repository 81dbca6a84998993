// What the parts of the study lowcost share: a log mapped online and smoothed, and what paths are compared by.
#pragma once

#include "server/slam/mapper_options.h"
#include "tests/studies/log_run.h"
#include "tests/studies/study.h"

namespace cairn::studies {

struct Mapped {
  LogRun run;
  Trajectory smoothed;
  OccupancyImage map;
};
[[nodiscard]] Mapped MapLog(const StudyContext& context, const StudyLog& log, slam::MapperOptions options);

// Odometry alone at the scans' stamps.
[[nodiscard]] Trajectory RawPath(const StudyLog& log);
// The scans with the motion that odometry shows taken out, so that all paths are judged by the same scans. `pairing`
// says the lag between both.
[[nodiscard]] StudyLog AllAtOnce(const StudyLog& log, const slam::PairingOptions& pairing = {});
// Length of a path in steps of 0.1 m, so that noise adds nothing.
[[nodiscard]] double LengthOf(const Trajectory& path);
// Root mean square distance of the positions of the path from those of the truth, in m, after the rigid motion that
// fits best (absolute trajectory error, Sturm et al. 2012); with `scaled` after the similarity that fits best (Umeyama
// 1991). `late_s`: the stamps of the path are later than those of the truth. NaN where fewer than three stamps agree.
[[nodiscard]] double TrajectoryError(const Trajectory& path, const Trajectory& truth, double late_s = 0.0,
                                     bool scaled = false);

// The part of the study on real logs.
void RunLowcostLogs(StudyContext& context);
// The same without their odometry.
void RunScansAlone(StudyContext& context);
// An office with glass fronts, with the glass and with walls or nothing in its place.
void RunGlass(StudyContext& context);
// Robots with wrong wheels and late scans, which the estimator learns while they drive.
void RunLearning(StudyContext& context);
// The same on drives whose wheels are as wrong as usual: whether what was learned of turns makes headings better.
void RunLearnedHeadings(StudyContext& context);

}  // namespace cairn::studies
