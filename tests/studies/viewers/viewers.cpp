// cairn-study viewers: what people who look at the page cost. Runs tests/system/web/viewers.py: two robots at 10 Hz, a
// server and cairn-web; processor time of both without a viewer, with a browser (where there is Chromium) and with 50
// viewers, and what each of them receives. Viewers must cost the server next to nothing, however many there are, and no
// scan may be dropped because of them. --seconds: how long each is measured (20).
#include <filesystem>
#include <string>

#include "tests/studies/fleet/live_server.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

using nlohmann::json;

constexpr int kViewers = 50;
constexpr double kMostServer = 5.0;  // Per cent of a core, more than without a viewer.

void StudyViewers(StudyContext& context) {
  Report& report = context.report;
  const double seconds = context.seconds > 0.0 ? context.seconds : context.Pick(20.0, 8.0);
  report.Heading("Two robots at 10 Hz, 360 beams, and those who look at them");
  const std::string programs = std::filesystem::path(ProgramPath("cairn-web")).parent_path().string();
  const json figures = PrintedBy(ChildProcess({"/usr/bin/env", "python3", CAIRN_VIEWERS, programs, "--viewers",
                                               std::to_string(kViewers), "--seconds", std::to_string(seconds)})
                                     .Wait(LiveServer::kDeadline));
  Table table({"who looks", "server, share of a core", "cairn-web", "received by each (kB/s)"});
  const auto share = [](const json& part, const char* program) {
    return Percent(part.at(program).get<double>() / 100.0);
  };
  const json &alone = figures.at("alone"), &browser = figures.at("browser"), &many = figures.at("many");
  table.Add({"nobody", share(alone, "server"), share(alone, "web"), "-"});
  if (browser.is_null()) {
    report.Warn("there is no Chromium on this machine: no browser has looked");
  } else {
    table.Add({"one browser", share(browser, "server"), share(browser, "web"), Number(browser.at("kb_s"), 1)});
    report.Text("The browser showed its first map after " + Number(browser.at("first_s"), 2) + " s and " +
                Number(browser.at("first_kb"), 0) + " kB, with the start of the page.");
  }
  table.Add({Count(kViewers) + " viewers", share(many, "server"), share(many, "web"), Number(many.at("kb_s"), 1)});
  report.Add(table, "viewers");
  const double more = many.at("server").get<double>() - alone.at("server").get<double>();
  report.Text("Scans used: " + Count(figures.at("used").get<long long>()) +
              ", dropped: " + Count(figures.at("dropped").get<long long>()) + ".");
  report.Expect(more <= kMostServer, Count(kViewers) + " viewers cost the server " + Number(more, 1) +
                                         " % of a core, wanted at most " + Number(kMostServer, 1));
  report.Expect(figures.at("dropped").get<long long>() == 0, "scans were dropped");
  report.Expect(many.at("kb_s").get<double>() > 0.0, "the viewers have received nothing");
}

const Registration kViewersStudy("viewers", "what people who look at the page cost the server, and what they receive",
                                 StudyViewers);

}  // namespace
}  // namespace cairn::studies
