#include "tests/studies/fleet/large_site.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <thread>
#include <utility>

#include "client/lib/map_client.h"
#include "client/web/web_page.h"
#include "common/http/http_server.h"
#include "tests/must.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/stopwatch.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

using Clock = std::chrono::steady_clock;
using test::Must;

constexpr double kMostJoinS = 2.0;
constexpr double kMostPictureS = 1.0;
constexpr int kTiles = 10000;  // Of the finest level.
constexpr int kCoarsest = kPyramidLevels - 1;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// A square yard with short walls, and a way along lanes from which all of it is seen.
std::string YardText(int side_m) {
  constexpr int kLane = 170, kEdge = 80;
  std::string text = fmt::format(
      "cairn-world: 1\nname: yard\nlines:\n"
      "  - {{points: [[0, 0], [{0}, 0], [{0}, {0}], [0, {0}]], closed: true}}\nwalls:\n",
      side_m);
  for (int x = 5; x < side_m; x += 25) {
    for (int y = 5; y < side_m; y += 25) {
      const bool lies = (x + y) / 5 % 2 == 0;
      text += fmt::format("  - {{from: [{}, {}], to: [{}, {}]}}\n", x, y, x + (lies ? 3 : 0), y + (lies ? 0 : 3));
    }
  }
  text += "routes:\n  - name: lanes\n    points: [";
  int from = kEdge, to = side_m - kEdge;
  for (int y = kEdge; y <= side_m - kEdge; y += kLane, std::swap(from, to)) {
    text += fmt::format("{}[{}, {}], [{}, {}]", y == kEdge ? "" : ", ", from, y + 5, to, y + 5);
  }
  return text + "]\n";
}

// The site `yard`, as large as wanted or, in a quick run, a small part of it.
MapInfo DrawYard(StudyContext& context, const LiveServer& server, client::QueryClient& queries) {
  const TempDirectory directory;
  const std::string world = (directory / "yard.yaml").string();
  std::ofstream(world) << YardText(context.Pick(680, 180));
  context.report.Progress("a robot draws the yard, which takes minutes");
  const std::string seconds = context.quick ? "30" : "900";
  std::vector<std::string> line = {"sim", "--site", "yard", "--robots", "1", "--fast", "--world", world};
  for (const char* word : {"--hz", "1", "--odometry-hz", "20", "--speed", "3", "--slip", "0", "--wheel-spread", "0",
                           "--range", "100", "--fov", "360", "--beams", "720", "--seconds"}) {
    line.emplace_back(word);
  }
  line.push_back(seconds);
  server.Run(line);
  // What was streamed faster than it can be drawn is drawn afterwards: until nothing has changed four times in a row.
  MapInfo site = Must(queries.Map("yard"));
  for (int still = 0; still < 4; std::this_thread::sleep_for(std::chrono::seconds(3))) {
    const std::uint64_t before = std::exchange(site, Must(queries.Map("yard"))).version;
    still = site.version == before ? still + 1 : 0;
  }
  return site;
}

// A client of its own each time, as one that has just been started.
std::unique_ptr<wire::Bus> NewBus() {
  wire::WireOptions options;
  options.domain = test::TestDomain();
  return Must(wire::Bus::Create(options, "late"));
}

struct Joined {
  double seconds = 0.0;
  std::size_t bytes = 0;
};

// Of all levels; MapClient::WaitComplete waits for those of the finest only.
std::size_t CountTiles(const MapInfo& site, client::QueryClient& queries) {
  std::size_t count = site.tile_count;
  for (std::uint32_t level = 1; level < kPyramidLevels; ++level) {
    count += Must(queries.Tiles({.site = "yard", .area = {}, .level = level})).tiles.size();
  }
  return count;
}

Joined JoinLate(std::size_t count) {
  const auto began = Clock::now();
  const auto bus = NewBus();
  const auto map = Must(client::MapClient::Create(*bus, "yard"));
  Must(map->WaitComplete(60.0));
  client::TileChanges::Place place;
  for (std::size_t here = 0; here < count; std::this_thread::sleep_for(std::chrono::milliseconds(5))) {
    const client::TileChanges changes = map->ChangesSince(place);
    place = changes.now;
    here = (changes.whole ? 0 : here) + changes.changed.size();
    if (SecondsSince(began) > 60.0) throw std::runtime_error(Count(static_cast<long long>(here)) + " tiles came");
  }
  Joined joined{.seconds = SecondsSince(began)};
  for (const Tile& tile : map->tiles()) joined.bytes += tile.bytes.size();
  return joined;
}

// The coarsest level, asked for and decoded.
double AskForPicture() {
  const auto began = Clock::now();
  const auto bus = NewBus();
  const auto queries = Must(client::QueryClient::Create(*bus, {.timeout_s = 20.0}));
  const auto answer = Must(queries->Tiles({.site = "yard", .area = {}, .level = kCoarsest}));
  for (const Tile& tile : answer.tiles) (void)Must(DecodeCells(tile.bytes, tile.encoding));
  return SecondsSince(began);
}

// A connection to the page, which is kept from one request to the next, as a browser does.
class HttpConnection {
 public:
  explicit HttpConnection(int port) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
      close(socket_);
      throw std::runtime_error("the page takes no connection");
    }
  }
  ~HttpConnection() { close(socket_); }
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  // The status of the answer, after all of it has come.
  int Get(const std::string& path) {
    const std::string request = "GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n";
    if (send(socket_, request.data(), request.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(request.size()))
      throw std::runtime_error("the page has closed the connection");
    const std::string head = ReadHead();
    constexpr std::string_view kLength = "\r\nContent-Length: ";
    const std::size_t length = head.find(kLength);
    if (length == std::string::npos) throw std::runtime_error("an answer without a length: " + head);
    const std::size_t end = head.find("\r\n\r\n") + 4 + std::stoul(head.substr(length + kLength.size()));
    while (received_.size() < end) Read();
    received_.erase(0, end);
    return std::stoi(head.substr(head.find(' ')));
  }

 private:
  std::string ReadHead() {
    std::size_t end = std::string::npos;
    while ((end = received_.find("\r\n\r\n")) == std::string::npos) Read();
    return received_.substr(0, end + 4);
  }
  void Read() {
    std::array<char, 65536> buffer{};
    const ssize_t count = recv(socket_, buffer.data(), buffer.size(), 0);
    if (count <= 0) throw std::runtime_error("the page does not answer");
    received_.append(buffer.data(), static_cast<std::size_t>(count));
  }

  const int socket_;
  std::string received_;
};

// A page that has been running, at whose map nobody has looked: from the first request to a picture of each of the
// coarsest tiles, over HTTP on loopback.
double LookAtPage(const std::vector<Tile>& coarsest) {
  const auto bus = NewBus();
  const auto page = Must(web::WebPage::Create(*bus, {}));
  const auto server = Must(HttpServer::Start({}, [&](const HttpRequest& request) { return page->Answer(request); }));
  while (page->watch().view()->Sites().count("yard") == 0) (void)page->watch().WaitForNewer(0, std::chrono::seconds(1));
  const auto began = Clock::now();
  HttpConnection connection(server->port());
  for (const Tile& tile : coarsest) {
    const auto path = fmt::format("/api/sites/yard/tiles/{}/{}/{}.png", tile.key.level, tile.key.x, tile.key.y);
    while (connection.Get(path) != 200) {
      if (SecondsSince(began) > 60.0) throw std::runtime_error("the page shows no map");
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  return SecondsSince(began);
}

// Nearest rank, as DistributionOf.
double NinetiethOf(std::vector<double> samples) {
  std::sort(samples.begin(), samples.end());
  return samples[static_cast<std::size_t>(std::ceil(0.9 * static_cast<double>(samples.size()))) - 1];
}

void AddRow(Report& report, Table& table, const std::string& what, const std::vector<double>& seconds, double most) {
  const Distribution times = DistributionOf(seconds);
  const double p90 = NinetiethOf(seconds);
  table.Add({what, Count(static_cast<long long>(seconds.size())), Number(times.median, 2), Number(p90, 2),
             Number(times.max, 2), Number(most, 1)});
  report.Expect(times.median <= most && p90 <= most, what + ": p50 " + Number(times.median, 2) + " s, p90 " +
                                                         Number(p90, 2) + " s, wanted at most " + Number(most, 1));
}

}  // namespace

void StudyLargeSite(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Who comes late to a large site");
  // A beam shows what is free up to 100 m, so that a drive of 3 km sees it all.
  LiveServer server({"--set", "slam.grid.max_ray_m=100", "--set", "slam.grid.no_return_free_m=100"});
  const MapInfo site = DrawYard(context, server, server.queries());
  if (!context.quick)
    report.Expect(site.tile_count >= kTiles, "the site has only " + Count(site.tile_count) + " tiles");
  const std::vector<Tile> coarsest =
      Must(server.queries().Tiles({.site = "yard", .area = {}, .level = kCoarsest})).tiles;
  const int runs = context.runs > 0 ? context.runs : context.Pick(10, 5);
  const std::size_t count = CountTiles(site, server.queries());
  std::vector<double> joined_s, asked_s, page_s;
  Joined joined;
  for (int run = 0; run < runs; ++run) {
    joined = JoinLate(count);
    joined_s.push_back(joined.seconds);
    asked_s.push_back(AskForPicture());
    page_s.push_back(LookAtPage(coarsest));
  }
  report.Text(
      fmt::format("A site of {} tiles, with the coarser levels {}, of {:.1f} KiB on average, through the "
                  "middleware on loopback; the robot stands still. Each time with a new participant.",
                  site.tile_count, count, static_cast<double>(joined.bytes) / 1024.0 / static_cast<double>(count)));
  Table table({"from nothing to", "times", "p50 (s)", "p90 (s)", "max (s)", "wanted at most"});
  AddRow(report, table, "every tile at a client that joins late", joined_s, kMostJoinS);
  AddRow(report, table, "a picture of the whole site, asked for by a new client", asked_s, kMostPictureS);
  AddRow(report, table, "a picture of the whole site from a page that nobody has looked at", page_s, kMostPictureS);
  report.Add(table, "large_site");
}

}  // namespace cairn::studies
