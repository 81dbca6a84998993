// The manual pages that the packages install, against what --help says.
#include "client/cli/manual_pages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>

#include "client/cli/program.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string OutputOf(const std::vector<std::string>& arguments) {
  std::ostringstream out, err;
  EXPECT_EQ(RunCairn(arguments, out, err), ExitCode::kOk) << err.str();
  return out.str();
}

// A hyphen as roff has it.
std::string WithHyphens(const std::string& text) {
  return std::regex_replace(text, std::regex("-"), "\\-");
}

// Whether the page has an option of exactly this name. Its names are bold and separated by commas; a flag may have a
// value after its name.
bool HasOption(const std::string& page, const std::string& name) {
  const std::string roff = WithHyphens(name);
  for (std::size_t at = page.find(roff); at != std::string::npos; at = page.find(roff, at + 1)) {
    const std::string after = page.substr(at + roff.size(), 2);
    if (after == "\\f" || after.starts_with(',') || after.starts_with('{')) return true;
  }
  return false;
}

int MatchesOf(const std::string& text, const std::regex& pattern) {
  return static_cast<int>(std::distance(std::sregex_iterator(text.begin(), text.end(), pattern), {}));
}

class ManualPagesTest : public ::testing::Test {
 protected:
  void SetUp() override { EXPECT_EQ(OutputOf({"--manual-pages", (directory_ / "man").string()}), ""); }
  [[nodiscard]] std::string PageOf(const std::string& name) const { return directory_.Read("man/" + name + ".1"); }

  TempDirectory directory_;
};

TEST_F(ManualPagesTest, HoldEveryOptionOfACommandAndOfItsSubcommands) {
  const std::vector<std::vector<std::string>> commands = {
      {"replay"}, {"top"}, {"eval"}, {"sim"}, {"pose"}, {"map", "draw"}, {"map", "edit", "erase"}, {"site", "merge"}};
  const std::regex option("\n +(?:-[A-Za-z],)?(--[a-z][a-z0-9-]*)");
  for (const auto& command : commands) {
    std::vector<std::string> words = command;
    words.emplace_back("--help");
    const std::string help = OutputOf(words), page = PageOf("cairn-" + command[0]);
    int options = 0;
    for (std::sregex_iterator found(help.begin(), help.end(), option), end; found != end; ++found) {
      if ((*found)[1] == "--help") continue;
      EXPECT_TRUE(HasOption(page, (*found)[1])) << command[0] << " " << (*found)[1];
      ++options;
    }
    EXPECT_GE(options, 2) << command[0];
  }
  EXPECT_TRUE(HasOption(PageOf("cairn-replay"), "--window"));
  EXPECT_TRUE(HasOption(PageOf("cairn"), "--timeout"));
  EXPECT_FALSE(HasOption(PageOf("cairn"), "--window"));
}

TEST_F(ManualPagesTest, AreOnePerCommandAndTheirTableOfContents) {
  std::set<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(directory_ / "man"))
    names.insert(file.path().stem().string());
  for (const char* name : {"cairn", "cairn-status", "cairn-map", "cairn-check-log", "cairn-sim"})
    EXPECT_EQ(names.count(name), 1U) << name;
  const std::string contents = PageOf("cairn");
  for (const std::string& name : names) {
    if (name == "cairn") continue;
    EXPECT_THAT(contents, HasSubstr(WithHyphens(name) + "(1)"));
  }
  const int commands = MatchesOf(OutputOf({"--help"}), std::regex("\n  [a-z][a-z0-9-]*  "));
  EXPECT_GT(commands, 10);
  EXPECT_EQ(static_cast<int>(names.size()), commands + 1) << "a command without a page";
  EXPECT_THAT(contents, Not(HasSubstr("manual\\-pages"))) << "that option is for packages only";
}

TEST_F(ManualPagesTest, HaveNameUsageAndExamplesOnce) {
  const std::string page = PageOf("cairn-map");
  EXPECT_THAT(page, HasSubstr(".SH \"NAME\"\ncairn\\-map \\- "));
  EXPECT_THAT(page, HasSubstr("\ncairn map edit erase [OPTIONS]\n"));
  EXPECT_THAT(page, HasSubstr(".SS \"cairn map draw\"\n"));
  const std::string example = "cairn map edit list \\-\\-site hall\n";
  const std::size_t first = page.find(example);
  ASSERT_NE(first, std::string::npos);
  EXPECT_GT(first, page.find(".SH \"EXAMPLES\"\n"));
  EXPECT_EQ(page.find(example, first + 1), std::string::npos) << "subcommands repeat what is said above them";
  EXPECT_THAT(PageOf("cairn-ping"), Not(HasSubstr("EXAMPLES")));
}

TEST_F(ManualPagesTest, TextIsNoCommandOfRoff) {
  CLI::App app("All.", "cairn");
  auto* command = app.add_subcommand("odd", "Odd");
  command->footer(".TH is a macro, \\fB too\n'and this'");
  const auto pages = ManualPages(app);
  ASSERT_EQ(pages.size(), 2U);
  EXPECT_EQ(pages[1].name, "cairn-odd");
  EXPECT_THAT(pages[1].text, HasSubstr("\n\\&.TH is a macro, \\efB too\n\\(aqand this\\(aq\n"));
}

TEST_F(ManualPagesTest, ADirectoryThatCannotBeMadeIsAnError) {
  const std::string file = directory_.Write("file", "").string();
  std::ostringstream out, err;
  EXPECT_EQ(RunCairn({"--manual-pages", file + "/man"}, out, err), ExitCode::kUsage);
  EXPECT_THAT(err.str(), HasSubstr("file/man"));
}

}  // namespace
}  // namespace cairn::client
