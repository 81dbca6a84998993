// The server's side: pieces, each a number and a sample that a peer sends: session requests, scans, odometry, questions
// and commands, and news of who is alive. They go through the door into the rooms of a server. Every question has its
// answer, and everything that the server sends fits the wire.
#include "server/ingress/admission.h"
#include "tests/fuzz/rooms.h"
#include "tests/fuzz/wire_bytes.h"
#include "tests/server/support/room_world.h"

namespace cairn::fuzz {
namespace {

constexpr ClientId kRobotClient = 7;
constexpr std::size_t kMostPieces = 64;
constexpr std::size_t kMostRanges = 512;

template <typename Value>
void MustFitTheWire(const Value& value) {
  Must(wire::CheckBounds(wire::ToWire(value)).has_value(), "what the server sends is within the bounds of the wire");
}
void MustFitTheWire(const TileSample& value) {
  Must(wire::FitsTileKey(value.tile.key), "the place of a tile fits its key");
  Must(wire::CheckBounds(wire::ToWire(value)).has_value(), "a tile is within the bounds of the wire");
}
void MustFitTheWire(const server::Retired& /*value*/) {}

class Peer {
 public:
  // What the door of the server does with each kind (ingress.cpp).
  void Send(std::uint8_t kind, std::string_view bytes) {
    if (kind == 0) return With<SessionRequest>(bytes, [&](auto&& value) { rooms_.roster().Take(value); });
    if (kind == 1)
      return With<ScanSample>(bytes, [&](auto&& value) {
        if (value.scan.ranges_m.size() <= kMostRanges) rooms_.roster().Take(server::Admit(std::move(value), {}));
      });
    if (kind == 2)
      return With<OdometrySample>(bytes, [&](auto&& value) { rooms_.roster().Take(server::Admit(std::move(value))); });
    if (kind == 3) return With<Request>(bytes, [&](auto&& value) { rooms_.Ask(std::move(value)); });
    Pieces news(bytes);
    const auto client = news.Take<ClientId>();
    const auto robot_id = news.Take<NameId>();
    rooms_.roster().Take(server::ClientLiveliness{client, robot_id, news.Take() % 2 == 1});
  }
  void Finish() { rooms_.Finish(); }
  [[nodiscard]] bool accepted() const { return accepted_; }

 private:
  template <typename Value, typename Use>
  void With(std::string_view bytes, const Use& use) {
    auto value = Received<Value>(bytes);
    if (!value) return;
    accepted_ = true;
    use(std::move(*value));
  }

  bool accepted_ = false;
  Rooms rooms_{
      [](server::OutboundValue&& value) { std::visit([](const auto& sent) { MustFitTheWire(sent); }, value); }};
};

bool RunDoor(std::string_view input) {
  Peer peer;
  std::size_t sent = 0;
  for (Pieces pieces(input); !pieces.empty() && sent < kMostPieces; ++sent) {
    const std::uint8_t kind = pieces.Take() % 5;
    peer.Send(kind, pieces.TakePiece());
  }
  peer.Finish();
  return peer.accepted();
}

template <typename Value>
std::string Sent(char kind, const Value& value) {
  return std::string(1, kind) + Piece(Serialized(value));
}

std::string OpenSession(const std::string& robot, bool end = false) {
  return Sent(0, SessionRequest{.robot = robot,
                                .site = "lab",
                                .sensors = {"laser"},
                                .client = kRobotClient,
                                .has_start = true,
                                .T_map_robot_start = kStart,
                                .end = end,
                                .session = 9});
}

std::string Drive(const std::string& robot, int steps) {
  std::string sent;
  for (int step = 0; step < steps; ++step) {
    OdometrySample odometry{{HashName(robot), HashName("odometry"), 9}, server::testing::RoomOdometry(step)};
    ScanSample scan{{HashName(robot), HashName("laser"), 9}, server::testing::RoomScan(step)};
    auto& ranges = scan.scan.ranges_m;  // Every sixth beam.
    for (std::size_t i = 0; 6 * i < ranges.size(); ++i) ranges[i] = ranges[6 * i];
    ranges.resize(ranges.size() / 6 + 1);
    scan.scan.angle_step_rad *= 6.0;
    sent += Sent(2, odometry) + Sent(1, scan);
  }
  return sent;
}

std::string Question(RequestKind kind) {
  Request request;
  request.kind = kind;
  request.site = "lab";
  request.robot = "r1";
  request.map_version = 1;
  request.job = 1;
  return Sent(3, request);
}

std::vector<std::string> SeedsOfPeers() {
  const std::string gone = std::string(1, 4) + Piece(std::string("\x07\0\0\0\0\0\0\0\0", 9));
  std::string questions;
  std::vector<std::string> seeds;
  for (int kind = 0; kind <= static_cast<int>(RequestKind::kMapEnable); ++kind) {
    const std::string question = Question(static_cast<RequestKind>(kind));
    seeds.push_back(OpenSession("r1") + question);
    questions += question;
  }
  seeds.push_back(OpenSession("r1") + Drive("r1", 2));
  seeds.push_back(OpenSession("r1") + Drive("r1", 4) + questions);
  seeds.push_back(OpenSession("r1") + OpenSession("r2") + Drive("r1", 1) + Drive("r2", 1) + OpenSession("r1", true));
  seeds.push_back(Drive("r1", 1) + OpenSession("r1") + gone + Drive("r1", 1) + OpenSession("r1"));
  return seeds;
}

const bool kDoorTarget = Register({"door", &RunDoor, &SeedsOfPeers});

}  // namespace
}  // namespace cairn::fuzz
