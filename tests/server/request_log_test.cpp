// The log of the whole server, without DDS: every line can be read by a program whatever strangers send, and the id of
// a request leads from its reply to all lines about it.
#include "server/queries/request_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "common/service/request_id.h"
#include "tests/server/support/captured_log.h"
#include "tests/server/support/whole_server.h"

namespace cairn::server::testing {
namespace {

using nlohmann::json;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::SizeIs;

constexpr ClientId kRider = 7;

// A line of its own, the end of a JSON string, what clears a terminal, and bytes that are not UTF-8.
const std::string kHostile =
    "r1\n2025-01-31T12:00:00.000Z critical forged\r{\"level\":\"critical\"}\x1b[2J\"\\\xc3(\xff\xe2\x80\xa8";

Request AboutSite(RequestKind kind, const std::string& site) {
  Request request;
  request.kind = kind;
  request.site = site;
  return request;
}

std::string IdOf(const Reply& reply) {
  return RequestId(reply.client, reply.sequence);
}

std::vector<json> About(const std::vector<json>& lines, const std::string& id) {
  std::vector<json> found;
  std::copy_if(lines.begin(), lines.end(), std::back_inserter(found),
               [&id](const json& line) { return line.value("request", "") == id; });
  return found;
}

TEST(RequestLog, LeadsFromTheReplyToItsLinesWhateverStrangersSend) {
  CapturedLog log(LogLevel::kDebug, LogFormat::kJson);
  Reply asked, saved, submitted;
  Job job;
  {
    WholeServer house;
    house.Open("r1", kRider);
    EXPECT_TRUE(house.WaitPhase("r1", kRider, SessionPhase::kActive));
    house.Open(kHostile, kRider + 1, kHostile);
    Request pose = AboutSite(RequestKind::kPose, "");
    pose.robot = kHostile;
    asked = house.Ask(pose);
    Request save = AboutSite(RequestKind::kSiteSave, kHostile);
    save.saved = kHostile;
    saved = house.Ask(save);
    submitted = house.Ask(AboutSite(RequestKind::kJobSubmit, "lab"));
    if (!submitted.jobs.empty()) job = house.WaitJob(submitted.jobs[0].id);
    spdlog::warn("{}", kHostile);
  }
  const auto lines = log.TakeObjects();
  for (const json& line : lines) {
    EXPECT_THAT(line.value("time", ""),
                MatchesRegex("[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{3}Z"));
    EXPECT_NE(line.value("message", ""), "");
    EXPECT_NE(line.value("level", ""), "critical") << line;
  }
  EXPECT_EQ(std::count_if(lines.begin(), lines.end(),
                          [](const json& line) { return line.value("message", "").starts_with("r1\n2025-01-31"); }),
            1);

  EXPECT_EQ(asked.status.code, StatusCode::kNotFound);
  const auto question = About(lines, IdOf(asked));
  ASSERT_THAT(question, SizeIs(1));
  EXPECT_EQ(question[0]["level"], "debug");
  EXPECT_THAT(question[0]["message"].get<std::string>(), HasSubstr("question pose (robot 'r1\n2025"));
  EXPECT_THAT(question[0]["robot"].get<std::string>(), EndsWith("\"\\\xef\xbf\xbd(\xef\xbf\xbd\xe2\x80\xa8"));

  EXPECT_EQ(saved.status.code, StatusCode::kFailedPrecondition) << "it keeps no state";
  const auto refused = About(lines, IdOf(saved));
  ASSERT_THAT(refused, SizeIs(1));
  EXPECT_EQ(refused[0]["level"], "info");
  EXPECT_THAT(refused[0]["message"].get<std::string>(), HasSubstr("command site_save (site 'r1\n"));
  EXPECT_THAT(refused[0]["message"].get<std::string>(), HasSubstr(": FAILED_PRECONDITION, "));

  // The command, and the start and the end of its job.
  EXPECT_NE(job.id, 0U);
  const auto work = About(lines, IdOf(submitted));
  ASSERT_THAT(work, SizeIs(3));
  for (const json& line : work) {
    EXPECT_EQ(line["level"], "info");
    EXPECT_EQ(line["site"], "lab");
  }
  EXPECT_EQ(std::count_if(work.begin(), work.end(), [&](const json& line) { return line.value("job", 0U) == job.id; }),
            2);
}

TEST(RequestLog, QuestionsDoNotFillTheLogAndEachCommandIsALine) {
  CapturedLog log(LogLevel::kInfo, LogFormat::kText);
  Reply refused;
  {
    WholeServer house;
    for (int i = 0; i < 20; ++i) {
      for (const RequestKind kind : {RequestKind::kPing, RequestKind::kPose, RequestKind::kSavedList})
        house.Ask(AboutSite(kind, kHostile));
    }
    Request cancel = AboutSite(RequestKind::kJobCancel, "");
    cancel.job = 999;
    refused = house.Ask(cancel);
  }
  EXPECT_EQ(refused.status.code, StatusCode::kNotFound);
  auto lines = log.Take();
  std::erase_if(lines, [](const std::string& line) { return line.find(" request=") == std::string::npos; });
  ASSERT_THAT(lines, SizeIs(1));
  EXPECT_THAT(lines[0], HasSubstr(" info command job_cancel (job 999) of client " + ShortClientId(refused.client) +
                                  ": NOT_FOUND, no job 999 after "));
  EXPECT_THAT(lines[0], EndsWith(" ms request=" + IdOf(refused)));
}

}  // namespace
}  // namespace cairn::server::testing
