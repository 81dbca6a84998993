// cairn-web: shows a Cairn server in the browser. Reads the options, joins the domain, serves the page until a signal.
// Exit codes: 0 stopped on request; 1 could not start; 2 wrong command line.
#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "client/web/web_page.h"
#include "common/log_line.h"
#include "common/version.h"
#include "common/wire/wire_arguments.h"

namespace cairn::web {
namespace {

struct Arguments {
  HttpOptions http;
  wire::WireArguments wire;
  wire::WireOptions wire_options;
  std::vector<std::string> token;  // Empty: no option; "": one is drawn.
  std::string log_format = "text";
};

LogFormat FormatOf(const Arguments& arguments) {
  return arguments.log_format == kLogFormats[1] ? LogFormat::kJson : LogFormat::kText;
}

std::string NewToken() {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyz234567";
  std::random_device random;
  std::string token(26, ' ');  // 130 bits.
  for (char& letter : token) letter = kLetters[random() % kLetters.size()];
  return token;
}

std::string AddressText(const HttpOptions& options, int port) {
  const std::string host = options.address == "0.0.0.0" ? "127.0.0.1" : options.address;
  return "http://" + host + ":" + std::to_string(port) + "/";
}

// From any thread: a line is written at once.
void Log(LogFormat format, std::string_view level, std::string_view message, const LogSubject& fields = {}) {
  std::cerr << LogLine(format, std::chrono::system_clock::now(), level, message, fields) + "\n";
}

int Refuse(const std::string& why, int code) {
  std::cerr << "cairn-web: " << why << "\n";
  return code;
}

// With --log-format json, also the line that says why the start failed is an object.
int FailStart(const Arguments& arguments, const Status& why) {
  constexpr int kFailed = 1;
  if (FormatOf(arguments) == LogFormat::kText) return Refuse(why.message, kFailed);
  Log(LogFormat::kJson, "critical", "cannot start: " + why.message);
  return kFailed;
}

void AddOptions(CLI::App& app, Arguments& arguments) {
  app.set_version_flag("--version", std::string("cairn-web ") + kVersion);
  app.add_option("--address", arguments.http.address,
                 "Address to listen on; others than loopback are open to the network")
      ->capture_default_str();
  arguments.http.port = 8420;
  app.add_option("--port", arguments.http.port, "Port to listen on; 0: any that is free")
      ->capture_default_str()
      ->check(CLI::Range(0, 65535));
  app.add_option("--host", arguments.http.hosts, "Name under which browsers reach this machine, besides its addresses")
      ->allow_extra_args(false);
  app.add_option("--token", arguments.token,
                 "Allow commands to who has the token. Without TEXT, CAIRN_WEB_TOKEN is used, or else one is drawn and "
                 "shown on\n"
                 "the terminal")
      ->type_name("TEXT")
      ->expected(0, 1);
  app.add_option("--log-format", arguments.log_format, "How commands are logged on standard error: text or json")
      ->capture_default_str()
      ->check(CLI::IsMember(std::vector<std::string>(kLogFormats.begin(), kLogFormats.end())));
  app.add_option("--domain", arguments.wire.domain, "DDS domain of server and robots [CAIRN_DOMAIN, or 0]");
  app.add_option("--set", arguments.wire.assignments,
                 "Set any option of the section wire, e.g. wire.interfaces=192.168.1.5")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  app.footer(
      "Without --token the page is read-only. Commands need no more than the token, and it travels unencrypted: "
      "beyond\n"
      "this machine, put a reverse proxy with TLS before the page.\n"
      "EXAMPLES\n  cairn-web\n  cairn-web --token --domain 7 --port 0");
}

// Empty: none was given, so that one has to be drawn.
std::string GivenToken(const std::vector<std::string>& given) {
  if (!given.empty() && !given.front().empty()) return given.front();
  const char* const of_environment = std::getenv("CAIRN_WEB_TOKEN");
  return of_environment != nullptr ? of_environment : "";
}

int Serve(const Arguments& arguments, bool commands) {
  const std::string given = GivenToken(arguments.token);
  // What a service prints is kept in a log, which more people may read than may send commands.
  if (commands && given.empty() && isatty(STDOUT_FILENO) == 0)
    return Refuse("a token is drawn only where a terminal shows it; give one: --token=TEXT or CAIRN_WEB_TOKEN", 2);
  // Before any thread starts, so that none of them takes the signals.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);

  auto bus = wire::Bus::Create(arguments.wire_options, "cairn-web");
  if (!bus) return FailStart(arguments, bus.error());
  WebOptions options;
  if (commands) options.token = given.empty() ? NewToken() : given;
  options.log = [format = FormatOf(arguments)](const std::string& message, const LogSubject& fields) {
    Log(format, "info", message, fields);
  };
  auto page = WebPage::Create(**bus, options);
  if (!page) return FailStart(arguments, page.error());
  auto server = HttpServer::Start(arguments.http, [&](const HttpRequest& request) { return (*page)->Answer(request); });
  if (!server) return FailStart(arguments, server.error());
  // A page that gets the token this way does not ask for it. The part after # is not sent to any server. A token that
  // was given is not printed.
  std::cout << "cairn-web: " << AddressText(arguments.http, (*server)->port())
            << (commands && given.empty() ? "#token=" + options.token : std::string()) << std::endl;
  int signal_number = 0;
  sigwait(&signals, &signal_number);
  return 0;
}

int Run(int argc, char** argv) {
  CLI::App app("Shows the robots, maps and jobs of a Cairn server in the browser.", "cairn-web");
  Arguments arguments;
  AddOptions(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  const VisitOptions visit = [&](OptionVisitor& visitor) {
    visitor.Section("wire", "The DDS side.", [&] { Visit(visitor, arguments.wire_options); });
  };
  auto valid = Apply(arguments.wire, visit);
  if (valid) valid = Validate(arguments.wire_options);
  if (!valid) return Refuse(valid.error().message, 2);
  return Serve(arguments, app.count("--token") > 0);
}

}  // namespace
}  // namespace cairn::web

int main(int argc, char** argv) {
  try {
    return cairn::web::Run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "cairn-web: " << error.what() << "\n";
    return 1;
  }
}
