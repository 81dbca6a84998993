#include "common/log_line.h"

#include <gtest/gtest.h>

#include "common/service/request_id.h"

namespace cairn {
namespace {

constexpr std::chrono::system_clock::time_point kNoon{std::chrono::milliseconds(1738324800042)};

std::string Text(std::string_view message, const LogSubject& fields = {}) {
  return LogLine(LogFormat::kText, kNoon, "info", message, fields);
}
std::string Json(std::string_view message, const LogSubject& fields = {}) {
  return LogLine(LogFormat::kJson, kNoon, "info", message, fields);
}

TEST(LogLine, HasTimeLevelAndMessageAndWhatIsKnown) {
  EXPECT_EQ(Text("ready"), "2025-01-31T12:00:00.042Z info ready");
  EXPECT_EQ(Json("ready"), R"({"time":"2025-01-31T12:00:00.042Z","level":"info","message":"ready"})");
  LogSubject fields;
  fields.request = RequestId(0xfeedface1a2b3c4d, 7);
  fields.client = ShortClientId(0xfeedface1a2b3c4d);
  fields.robot = "r1";
  fields.site = "hall";
  fields.job = 18446744073709551615U;
  EXPECT_EQ(Text("done", fields), "2025-01-31T12:00:00.042Z info done request=1a2b3c4d-7");
  EXPECT_EQ(Json("done", fields),
            R"({"time":"2025-01-31T12:00:00.042Z","level":"info","message":"done","request":"1a2b3c4d-7",)"
            R"("client":"1a2b3c4d","robot":"r1","site":"hall","job":18446744073709551615})");
}

TEST(LogLine, ATimeBefore1970IsATimeToo) {
  const std::chrono::system_clock::time_point before{std::chrono::milliseconds(-1)};
  EXPECT_EQ(LogLine(LogFormat::kText, before, "info", ""), "1969-12-31T23:59:59.999Z info ");
}

TEST(LogLine, NothingInAMessageEndsALineOrAString) {
  struct {
    std::string message, text, json;
  } const cases[] = {
      {"a\nb\rc\td", R"(a\nb\u000dc\u0009d)", R"(a\nb\u000dc\u0009d)"},
      {"\x1b[2J\x7f", R"(\u001b[2J\u007f)", R"(\u001b[2J\u007f)"},
      {"say \"x\\y\"", R"(say "x\y")", R"(say \"x\\y\")"},
      {std::string("zero\0", 5), R"(zero\u0000)", R"(zero\u0000)"},
      // NEL, CSI, and the separators of lines and paragraphs.
      {"\xc2\x85\xc2\x9b\xe2\x80\xa8\xe2\x80\xa9", R"(\u0085\u009b\u2028\u2029)", R"(\u0085\u009b\u2028\u2029)"},
      {"K\xc3\xbc"
       "che \xe2\x82\xac \xf0\x9f\xa4\x96",
       "K\xc3\xbc"
       "che \xe2\x82\xac \xf0\x9f\xa4\x96",
       "K\xc3\xbc"
       "che \xe2\x82\xac \xf0\x9f\xa4\x96"},
  };
  for (const auto& one : cases) {
    EXPECT_EQ(Text(one.message), "2025-01-31T12:00:00.042Z info " + one.text);
    EXPECT_EQ(Json(one.message), R"({"time":"2025-01-31T12:00:00.042Z","level":"info","message":")" + one.json + "\"}");
  }
  LogSubject hostile;
  hostile.robot = "\"}\n{\"";
  EXPECT_EQ(Json("", hostile), R"({"time":"2025-01-31T12:00:00.042Z","level":"info","message":"","robot":"\"}\n{\""})");
}

TEST(LogLine, BytesThatAreNotUtf8AreReplaced) {
  const std::string replaced = "\xef\xbf\xbd";
  const auto times = [&](int count) {
    std::string all;
    for (int i = 0; i < count; ++i) all += replaced;
    return "2025-01-31T12:00:00.042Z info " + all;
  };
  EXPECT_EQ(Text("\xff"), times(1));
  EXPECT_EQ(Text("\x80\xbf"), times(2)) << "no lead byte";
  EXPECT_EQ(Text("\xc0\x8a"), times(2)) << "a line break in two bytes";
  EXPECT_EQ(Text("\xe0\x80\x8a"), times(3)) << "a line break in three bytes";
  EXPECT_EQ(Text("\xf0\x80\x80\x8a"), times(4)) << "a line break in four bytes";
  EXPECT_EQ(Text("\xed\xa0\x80"), times(3)) << "a surrogate";
  EXPECT_EQ(Text("\xf4\x90\x80\x80"), times(4)) << "beyond the last code point";
  EXPECT_EQ(Text("\xe2\x82"), times(2)) << "cut off";
  EXPECT_EQ(Text("\xc3("), times(1) + "(") << "what follows stays";
}

TEST(RequestId, IsShortAndKeepsEveryNumber) {
  EXPECT_EQ(RequestId(77, 0), "0000004d-0");
  EXPECT_EQ(RequestId(0xffffffffffffffff, INT64_MIN), "ffffffff--9223372036854775808");
}

}  // namespace
}  // namespace cairn
