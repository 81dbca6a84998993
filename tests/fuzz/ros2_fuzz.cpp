// The server's door for ROS 2: pieces, each a number and a sample that a program of ROS 2 sends: scans, odometry,
// transforms of its own and shared ones, initial poses, requests of services in both conventions; or the name of a
// topic. What is decoded goes into the stream of a robot; only what an estimator may rely on comes out of it.
#include "common/wire/ros2/convert.h"
#include "common/wire/ros2/message_types.h"
#include "common/wire/ros2/service_endpoint.h"
#include "server/ros2/robot_stream.h"
#include "server/ros2/shared_frames.h"
#include "tests/fuzz/fuzz_target.h"

namespace cairn::fuzz {
namespace {

using Clock = server::RobotStream::Clock;

template <typename Message>
std::optional<Message> Decoded(std::string_view bytes) {
  typename ros2::MessageType<Message>::Type type;
  wire::Sample<typename ros2::MessageType<Message>::Wire> sample;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  Must(type.deserialize(&payload, &sample), "no sample is refused by the middleware");
  if (sample.decoding != wire::Decoding::kDecoded) return std::nullopt;
  auto message = ros2::FromWire(std::move(sample.value));
  return message ? std::optional(*std::move(message)) : std::nullopt;
}

// Whether the bytes are a request of the service, as they come from the middleware.
template <typename S>
bool IsRequest(std::string_view bytes, bool of_cyclone) {
  ros2::RequestType<S> type;
  ros2::RequestBytes sample;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  Must(type.deserialize(&payload, &sample), "no request is refused by the middleware");
  ros2::Caller caller;
  caller.in_message = of_cyclone;
  const auto request = ros2::DecodeRequest<S>(sample.bytes, caller);
  if constexpr (std::is_same_v<S, ros2::SaveMap>)
    Must(!request || request->name.size() <= ros2::kMaxServiceText, "names are short");
  return request.has_value();
}

template <typename Message>
std::string Encoded(const Message& message) {
  typename ros2::MessageType<Message>::Type type;
  wire::Sample<typename ros2::MessageType<Message>::Wire> sample;
  sample.value = ros2::ToWire(message);
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&sample)());
  Must(type.serialize(&sample, &payload), "a message can be serialised");
  return {reinterpret_cast<const char*>(payload.data), payload.length};
}

class Door {
 public:
  Door() { robot_.SetPublishers(true, true, now_); }

  bool Send(std::uint8_t kind, std::string_view bytes) {
    now_ += std::chrono::milliseconds(50);
    const ros2::Origin origin{{kind}, ++sent_};
    switch (kind) {
      case 0:
        return With<ros2::LaserScan>(bytes,
                                     [&](auto&& message) { robot_.Take("scan", std::move(message), origin, now_); });
      case 1:
        return With<ros2::Odometry>(bytes, [&](auto&& message) { robot_.Take(std::move(message), origin, now_); });
      case 2:
        return With<ros2::Transforms>(bytes, [&](auto&& message) {
          robot_.SeeMapToOdom(message, false, origin.writer, now_);
          robot_.Take(message, origin, now_);
        });
      case 3:
        return With<ros2::Transforms>(bytes, [&](auto&& message) {
          robot_.SeeMapToOdom(message, true, origin.writer, now_);
          robot_.TakeShared(shared_.Take(message, origin.writer, false), true, origin, now_);
        });
      case 4:
        return With<ros2::PoseWithCovariance>(bytes, [&](auto&& message) { robot_.TakeStart(message, now_); });
      case 6:
      case 7: {
        const bool saves = IsRequest<ros2::SaveMap>(bytes, kind == 7);  // All three, whatever the first one says.
        const bool gets = IsRequest<ros2::GetMap>(bytes, kind == 7);
        const bool resets = IsRequest<ros2::Reset>(bytes, kind == 7);
        return saves || gets || resets;
      }
      default:
        break;
    }
    const auto name = server::NamespaceOf(bytes, "scan");
    if (!name) return false;
    if (const auto place = rules_.PlaceOf(*name)) {
      Must(ValidateName("robot", place->robot) && ValidateName("site", place->site), "rules make names only");
    }
    return true;
  }

  void Check() {
    Must(robot_.Problems(now_, kNanosPerSecond, {{2}, {3}}).size() < 16, "what it says of itself is short");
    while (inbound_.size() > 0) {
      const auto value = inbound_.Pop();
      if (const auto* const scan = std::get_if<server::ScanArrival>(&*value))
        Must(scan->refused || ValidateScan(*scan->scan), "only valid scans come in");
      if (const auto* const odometry = std::get_if<server::OdometryArrival>(&*value))
        Must(odometry->refused || ValidateOdometry(odometry->odometry), "only valid odometry comes in");
      if (const auto* const request = std::get_if<SessionRequest>(&*value))
        Must(request->T_map_robot_start.IsFinite(), "a session begins somewhere");
    }
  }

 private:
  template <typename Message, typename Use>
  bool With(std::string_view bytes, const Use& use) {
    auto message = Decoded<Message>(bytes);
    if (!message) return false;
    use(*std::move(message));
    return true;
  }

  std::int64_t sent_ = 0;
  Clock::time_point now_ = Clock::time_point() + std::chrono::hours(1);
  server::Inbound inbound_{256};
  server::SharedFrames shared_;
  server::NamespaceRules rules_ = *server::NamespaceRules::Parse("/{site}/{robot},/{robot}", "lab");
  server::RobotStream robot_{{"r1", "lab"}, {}, shared_.tree(), inbound_};
};

bool RunRos2(std::string_view input) {
  constexpr std::size_t kMostRos2Pieces = 64;
  Door door;
  bool accepted = false;
  std::size_t sent = 0;
  for (Pieces pieces(input); !pieces.empty() && sent < kMostRos2Pieces; ++sent) {
    const std::uint8_t kind = pieces.Take() % 8;
    accepted |= door.Send(kind, pieces.TakePiece());
  }
  door.Check();
  return accepted;
}

std::string PieceOf(char kind, std::string_view bytes) {
  return std::string(1, kind) + Piece(bytes);
}

std::vector<std::string> SeedsOfRos2() {
  ros2::LaserScan scan;
  scan.header = {kNanosPerSecond, "laser"};
  scan.angle_increment = 0.5;
  scan.time_increment = 0.001;
  scan.range_max = 10.0;
  scan.ranges = {1.0F, 2.0F, 3.0F};
  ros2::Odometry odometry;
  odometry.header = {kNanosPerSecond, "odom"};
  odometry.child_frame = "base_link";
  ros2::Transform link;
  link.header.frame = "base_link";
  link.child_frame = "laser";
  ros2::Transforms transforms;
  transforms.transforms = {link};
  ros2::PoseWithCovariance start;
  start.header.frame = "map";
  const std::string drive = PieceOf(1, Encoded(odometry)) + PieceOf(2, Encoded(transforms)) + PieceOf(0, Encoded(scan));
  return {PieceOf(0, Encoded(scan)),
          PieceOf(1, Encoded(odometry)),
          PieceOf(3, Encoded(transforms)),
          PieceOf(4, Encoded(start)),
          PieceOf(5, "rt/hall/r1/scan"),
          PieceOf(6, std::string("\0\1\0\0\5\0\0\0maps\0", 13)),
          PieceOf(7, std::string("\0\1\0\0ABCDEFGH\1\0\0\0\0\0\0\0\5\0\0\0maps\0", 29)),
          drive,
          drive + PieceOf(4, Encoded(start)) + drive};
}

const bool kRos2Target = Register({"ros2", &RunRos2, &SeedsOfRos2});

}  // namespace
}  // namespace cairn::fuzz
