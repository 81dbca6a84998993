#include <fmt/format.h>

#include <condition_variable>
#include <deque>
#include <mutex>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"
#include "common/sensor/stamp_text.h"

namespace cairn::client {
namespace {

struct PoseArguments {
  std::string robot;
  std::optional<Stamp> at;
  bool follow = false;
  int count = 0;  // 0: until interrupted.
};

ExitCode AskPose(Program& program, const PoseArguments& arguments) {
  Request request;
  request.kind = RequestKind::kPose;
  request.robot = arguments.robot;
  request.latest = !arguments.at.has_value();
  request.stamp = arguments.at.value_or(0);
  const auto reply = program.Ask(request);
  if (!reply) return program.Refuse(reply.error());
  if (reply->poses.empty()) return program.Refuse({StatusCode::kInternal, "the server's answer holds no pose"});
  return program.Print(FormatPose(reply->poses.front()) + "\n", ToJson(reply->poses.front()));
}

// Poses as they are published, handed from the DDS thread to ours. When full, the oldest goes: newer ones say more.
class PoseInbox {
 public:
  void Push(PoseReport&& pose) {
    const std::lock_guard lock(mutex_);
    if (poses_.size() >= kMost) poses_.pop_front();
    poses_.push_back(std::move(pose));
    arrived_.notify_one();
  }
  std::optional<PoseReport> Pop(std::chrono::milliseconds wait) {
    std::unique_lock lock(mutex_);
    if (!arrived_.wait_for(lock, wait, [this] { return !poses_.empty(); })) return std::nullopt;
    PoseReport pose = std::move(poses_.front());
    poses_.pop_front();
    return pose;
  }

 private:
  static constexpr std::size_t kMost = 4096;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<PoseReport> poses_;
};

ExitCode FollowPose(Program& program, const PoseArguments& arguments) {
  const auto bus = program.bus();
  if (!bus) return program.Refuse(bus.error());
  PoseInbox inbox;
  const auto subscription = (*bus)->Subscribe<PoseReport>([&inbox, &arguments](PoseReport&& pose) {
    if (pose.robot == arguments.robot) inbox.Push(std::move(pose));
  });
  if (!subscription) return program.Refuse(subscription.error());
  const auto start = std::chrono::steady_clock::now();
  int seen = 0;
  while (!Interrupted() && (arguments.count == 0 || seen < arguments.count)) {
    const auto pose = inbox.Pop(std::chrono::milliseconds(100));
    if (pose) {
      ++seen;
      program.Print(FormatPose(*pose) + "\n", ToJson(*pose));
    } else if (seen == 0 && std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() >
                                program.options.timeout_s) {
      return program.Refuse({StatusCode::kDeadlineExceeded,
                             fmt::format("no pose of '{}' within {:g} s", arguments.robot, program.options.timeout_s)});
    }
  }
  return ExitCode::kOk;
}

Result<std::optional<Stamp>> ReadStamp(const std::string& text) {
  const auto stamp = ParseStamp(text);
  if (!stamp) return Fail(StatusCode::kInvalidArgument, "'" + text + "' is not a stamp in seconds, e.g. 976052890.25");
  return std::optional<Stamp>(*stamp);
}

}  // namespace

void AddPose(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("pose", "Where a robot is, or was");
  command->footer(
      "The pose is the robot's in the site's map frame: metres, radians in (-pi, pi].\n"
      "A stamp after the last scan used answers UNAVAILABLE (not yet), one before the first OUT_OF_RANGE (never).\n"
      "EXAMPLES\n  cairn pose robot1\n  cairn pose robot1 --at 976052890.25 --json\n  cairn pose robot1 --follow");
  auto arguments = std::make_shared<PoseArguments>();
  command->add_option("robot", arguments->robot, "The robot's name")->required();
  auto* at = AddParsed(*command, "--at", arguments->at, ReadStamp, "At this stamp of the robot's clock (interpolated)",
                       "SECONDS");
  auto* follow =
      command->add_flag("-f,--follow", arguments->follow, "Print every pose as it is published")->excludes(at);
  command->add_option("-n,--count", arguments->count, "With --follow: end after so many poses")
      ->needs(follow)
      ->check(CLI::PositiveNumber);
  command->callback([&program, arguments] {
    program.action = [&program, arguments] {
      return arguments->follow ? FollowPose(program, *arguments) : AskPose(program, *arguments);
    };
  });
}

}  // namespace cairn::client
