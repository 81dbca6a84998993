// Names of enumerators are on the wire's logs, in metrics and in JSON: all there, all different, snake_case.
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "common/service/job.h"
#include "common/service/ledger.h"
#include "common/service/pose_report.h"
#include "common/service/request.h"
#include "common/service/session.h"

namespace cairn {
namespace {

template <typename Enum>
void ExpectNamed(int count, std::string_view (*name)(Enum)) {
  std::set<std::string> names;
  for (int i = 0; i < count; ++i) {
    const std::string text(name(static_cast<Enum>(i)));
    EXPECT_FALSE(text.empty());
    EXPECT_EQ(text.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_"), std::string::npos) << text;
    EXPECT_NE(text, "unknown");
    names.insert(text);
  }
  EXPECT_EQ(static_cast<int>(names.size()), count);
  EXPECT_EQ(name(static_cast<Enum>(count)), "unknown");
  EXPECT_EQ(name(static_cast<Enum>(255)), "unknown");
}

TEST(EnumNames, AreCompleteAndDifferent) {
  ExpectNamed<JobKind>(3, JobKindName);
  ExpectNamed<JobState>(5, JobStateName);
  ExpectNamed<DropReason>(kDropReasonCount, DropReasonName);
  ExpectNamed<PoseReason>(7, PoseReasonName);
  ExpectNamed<RequestKind>(kRequestKindCount, RequestKindName);
  ExpectNamed<SessionPhase>(4, SessionPhaseName);
}

TEST(EnumNames, StandForTheirEnumerators) {
  EXPECT_EQ(DropReasonName(DropReason::kNoOdometry), "no_odometry");
  EXPECT_EQ(DropReasonName(DropReason::kSessionEnded), "session_ended");
  EXPECT_EQ(DropReasonName(DropReason::kSessionFull), "session_full");
  EXPECT_EQ(PoseReasonName(PoseReason::kWaiting), "waiting");
  EXPECT_EQ(PoseReasonName(PoseReason::kNotJoined), "not_joined");
  EXPECT_EQ(RequestKindName(RequestKind::kMapEnable), "map_enable");
  EXPECT_EQ(RequestKindName(RequestKind::kStatus), "status");
  EXPECT_EQ(JobStateName(JobState::kCancelled), "cancelled");
  EXPECT_EQ(SessionPhaseName(SessionPhase::kSuspended), "suspended");
  EXPECT_EQ(StatusCodeName(StatusCode::kDataLoss), "DATA_LOSS");
  EXPECT_EQ(StatusCodeName(static_cast<StatusCode>(99)), "UNKNOWN");
}

TEST(Ledger, DroppedTotalSumsAllReasons) {
  Ledger ledger;
  EXPECT_EQ(ledger.dropped_total(), 0u);
  for (std::size_t i = 0; i < ledger.dropped.size(); ++i) ledger.dropped[i] = i + 1;
  EXPECT_EQ(ledger.dropped_total(), 91u);
}

}  // namespace
}  // namespace cairn
