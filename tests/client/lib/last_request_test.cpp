#include "client/lib/last_request.h"

#include <gtest/gtest.h>

#include <thread>

namespace cairn::client {
namespace {

void Note(RequestKind kind, std::int64_t sequence) {
  Request request;
  request.client = 0x1a2b3c4d;
  request.sequence = sequence;
  request.kind = kind;
  NoteRequest(request);
}

TEST(LastRequest, IsTheLastCommandOrElseTheLastQuestion) {
  EXPECT_EQ(TakeLastRequest(), "");
  Note(RequestKind::kPing, 1);
  Note(RequestKind::kStatus, 2);
  EXPECT_EQ(TakeLastRequest(), "1a2b3c4d-2");
  EXPECT_EQ(TakeLastRequest(), "");
  Note(RequestKind::kMapInfo, 3);
  Note(RequestKind::kMapEnable, 4);
  Note(RequestKind::kMapInfo, 5);
  EXPECT_EQ(TakeLastRequest(), "1a2b3c4d-4");
  Note(RequestKind::kMapInfo, 6);
  EXPECT_EQ(TakeLastRequest(), "1a2b3c4d-6");
}

TEST(LastRequest, IsThatOfTheCallingThread) {
  Note(RequestKind::kPing, 1);
  std::string of_other = "not taken";
  std::thread([&of_other] { of_other = TakeLastRequest(); }).join();
  EXPECT_EQ(of_other, "");
  EXPECT_EQ(TakeLastRequest(), "1a2b3c4d-1");
}

}  // namespace
}  // namespace cairn::client
