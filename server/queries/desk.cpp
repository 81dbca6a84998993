#include "server/queries/desk.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <stdexcept>
#include <utility>

#include "common/service/request_id.h"
#include "common/service/start_pose.h"
#include "common/version.h"
#include "common/wall_clock.h"
#include "server/ops/log_context.h"
#include "server/queries/answers.h"
#include "server/queries/request_log.h"

namespace cairn::server {
namespace {

Reply JobReply(const Request& request, Result<Job> job) {
  if (!job) return ReplyTo(request, job.error());
  Reply reply = ReplyTo(request);
  reply.jobs.push_back(*std::move(job));
  return reply;
}

// New data is not stored, or something was not restored; empty if neither.
std::string WhyDegraded(const Journal& journal) {
  const JournalHealth health = journal.health();
  std::string why = health.degraded ? health.reason + "; new data is not stored" : std::string();
  if (health.over_budget)
    why += (why.empty() ? "" : "; ") + std::string("the store is larger than store.max_gib, and all of it is needed");
  const std::string not_restored = journal.set_aside().text();
  if (!why.empty() && !not_restored.empty()) why += "; ";
  constexpr std::size_t kLongest = 1000;  // The wire takes 1,024 bytes.
  return (why + not_restored).substr(0, kLongest);
}

}  // namespace

Desk::Desk(std::size_t capacity, Outbound& outbound, Roster& roster, Atlas& atlas, JobList& jobs, JobWorker& worker,
           SavedSites& saved_sites, Generation generation, Journal* journal)
    : outbound_(outbound),
      roster_(roster),
      atlas_(atlas),
      jobs_(jobs),
      worker_(worker),
      saved_sites_(saved_sites),
      generation_(generation),
      journal_(journal),
      requests_(capacity),
      answers_(std::make_shared<CommandAnswers>(requests_, journal)) {}

Desk::~Desk() {
  Stop();
  answers_->Stop();
}

void Desk::Start() {
  thread_ = std::jthread([this] {
    while (auto open = requests_.Pop()) Serve(*std::move(open));
  });
}

void Desk::Take(Request&& request) {
  request.received = std::chrono::steady_clock::now();
  const auto refused = requests_.Push(std::move(request));
  if (!refused) return;
  const Status busy{StatusCode::kResourceExhausted, "too many requests are waiting; try again later"};
  LogRefused(*refused, busy);
  outbound_.Send(ReplyTo(*refused, busy));
}

void Desk::Stop() {
  requests_.Close();
  if (thread_.joinable()) thread_.join();
}

void Desk::Serve(OpenRequest&& open) {
  std::optional<LogContext> context;  // Also of what is logged about an exception.
  try {
    context.emplace(FieldsOf(open.request));
    if (!open.rest) {
      auto answer = AnswerTo(open.request);
      if (!answer) return;
      open.rest.emplace(*std::move(answer));
    }
    Send(open);
  } catch (const std::exception& error) {
    spdlog::error("a request of kind {} failed with an exception: {}", RequestKindName(open.request.kind),
                  error.what());
    try {
      outbound_.Send(
          ReplyTo(open.request, {StatusCode::kInternal, "internal error of the server; see its log for the cause"}));
    } catch (const std::exception& unsent) {  // The client asks again.
      spdlog::error("the failure of a request of kind {} could not be answered because of an exception: {}",
                    RequestKindName(open.request.kind), unsent.what());
    }
  }
}

void Desk::Send(OpenRequest& open) {
  constexpr int kPartsPerTurn = 4;
  for (int i = 0; i < kPartsPerTurn; ++i) {
    auto part = open.rest->Next();
    if (!part) return;
    const bool last = part->last;
    const Status status = last ? part->status : Status{};
    outbound_.SendPatiently(*std::move(part));
    if (!last) continue;
    return LogAnswered(open.request, status);
  }
  requests_.PutBack(std::move(open));
}

std::optional<Answer> Desk::AnswerTo(const Request& request) {
  if (IsCommand(request.kind) && answers_->full())
    return ReplyTo(request, {StatusCode::kResourceExhausted, "too many commands wait for the disk; try again later"});
  switch (request.kind) {
    case RequestKind::kPing: {
      Reply reply = ReplyTo(request);
      reply.server_version = kVersion;
      return reply;
    }
    case RequestKind::kPose:
      return AnswerPose(request, SessionOf(request.robot));
    case RequestKind::kPath: {
      const Sessions sessions = SessionOf(request.robot);
      return AnswerPath(request, sessions, sessions.empty() ? Maps{} : MapOf(sessions.front().status.session.site));
    }
    case RequestKind::kTiles:
      return AskTiles(request);
    case RequestKind::kLandmarks:
      return AnswerLandmarks(request, AllSessions(), MapOf(request.site));
    case RequestKind::kMapInfo:
      return AnswerMapInfo(request, request.site.empty() ? AllMaps() : MapOf(request.site));
    case RequestKind::kStatus:
      return StatusReply(request);
    case RequestKind::kJobSubmit:
      return AnswerAboutJob(request, SubmitJob(request));
    case RequestKind::kJobGet:
      return JobReply(request, jobs_.Find(request.job));
    case RequestKind::kJobCancel:
      return AnswerAboutJob(request, jobs_.Cancel(request.job));
    case RequestKind::kJobList: {
      Reply reply = ReplyTo(request);
      reply.jobs = jobs_.OfSite(request.site);
      return reply;
    }
    case RequestKind::kSessionEnd:
      return Order(request, [&](const auto& receipt) { return roster_.End(request.robot, receipt); });
    case RequestKind::kRelocalise:
      return Relocalise(request);
    case RequestKind::kLocalise:
    case RequestKind::kMap:
      return Order(request, [&](const auto& receipt) {
        return roster_.Localise(request.robot, request.kind == RequestKind::kLocalise, receipt);
      });
    case RequestKind::kMapEnable:
      return EnableMap(request);
    case RequestKind::kMapEdits:
      return AnswerMapEdits(request, MapOf(request.site));
    case RequestKind::kMapEditAdd:
    case RequestKind::kMapEditRemove:
      return EditMap(request);
    case RequestKind::kSavedList:
    case RequestKind::kSiteSave:
    case RequestKind::kSiteLoad:
    case RequestKind::kSiteDelete:
      saved_sites_.Take(Request(request));
      return std::nullopt;
    case RequestKind::kRos2:
      return Ros2Reply(request);
  }
  throw std::logic_error("the request has an unknown kind");
}

template <typename Give>
std::optional<Answer> Desk::Order(const Request& request, const Give& give, const std::function<void(Reply&)>& then) {
  const auto receipt = std::make_shared<Receipt>([answers = answers_, request, then](bool taken) {
    Reply reply =
        ReplyTo(request, taken ? Status{}
                               : Status{StatusCode::kFailedPrecondition,
                                        "the session has ended, or the robot's place in the map is not known"});
    if (taken && then) then(reply);
    answers->Send(request, std::move(reply));
  });
  const Result<void> given = give(receipt);
  if (given) return std::nullopt;
  receipt->Cancel();
  return ReplyTo(request, given.error());
}

std::optional<Answer> Desk::AnswerAboutJob(const Request& request, Result<Job> job) {
  if (!job) return ReplyTo(request, job.error());
  answers_->Send(request, JobReply(request, std::move(job)));
  return std::nullopt;
}

void Desk::SetRefusals(const Refusals& refusals) {
  const MutexLock lock(mutex_);
  refusals_ = refusals;
}

void Desk::SetLoad(const ServerLoad& load) {
  const MutexLock lock(mutex_);
  load_ = load;
}

void Desk::SetRos2(Ros2Report&& report) {
  const MutexLock lock(mutex_);
  ros2_ = std::move(report);
}

Reply Desk::Ros2Reply(const Request& request) {
  Reply reply = ReplyTo(request);
  const MutexLock lock(mutex_);
  reply.ros2 = {ros2_.door};
  reply.ros2_namespaces = ros2_.namespaces;
  return reply;
}

Reply Desk::StatusReply(const Request& request) {
  Reply reply = AnswerStatus(request, request.robot.empty() ? AllSessions() : SessionOf(request.robot));
  if (reply.status.ok() && journal_ != nullptr) reply.status.message = WhyDegraded(*journal_);
  const MutexLock lock(mutex_);
  reply.refused = {refusals_};
  reply.load = {load_};
  return reply;
}

// Where somebody says where the robot is, its session looks at that place in its own map with the next scan. In both
// cases a job looks for it in the map of its site, from when the session knows that it is lost: near the place given
// first, which others may have mapped. Of one that is lost already, what it has seen since counts. Where no job can be
// submitted and no place was given, the session is not told either, because then the robot would be lost without being
// looked for. A job also joins a robot that is not joined with the map of its site at the place given.
std::optional<Answer> Desk::Relocalise(const Request& request) {
  const auto session = roster_.FindOrFail(request.robot);
  if (!session) return ReplyTo(request, session.error());
  const SessionRecord& record = (*session)->record();
  const std::string site = record.state().site;
  const std::string id = RequestId(request.client, request.sequence);
  const PoseReport pose = record.snapshot().status.pose;
  // In its own map it knows where it is; asked is where it is in that of its site.
  const bool fragment = record.joining().fragment && !record.localises();
  const bool joins = request.T_map_robot && fragment;
  const bool lost = !request.T_map_robot && !pose.localized && pose.reason == PoseReason::kLost;
  if ((fragment || lost) && record.begun() && !(*session)->ending()) {
    JobSubject about{request.robot};
    if (joins) {
      if (auto valid = ValidateStart(*request.T_map_robot); !valid) return ReplyTo(request, valid.error());
      about.places = {{0, *request.T_map_robot, 1.0}};
    }
    return AnswerAboutJob(request, worker_.Submit(site, JobKind::kRelocalise, true, id, about));
  }
  const auto order = [&](const auto& receipt) {
    return roster_.Relocalise(request.robot, request.T_map_robot, receipt);
  };
  const bool said = request.T_map_robot.has_value();
  const auto room = worker_.CheckRoomToLook();
  if (!room && !said) return ReplyTo(request, room.error());
  // One that is only localised looks for itself in the map of its site.
  if (said && (!room || record.localises())) return Order(request, order);
  return Order(request, order, [&worker = worker_, site, robot = request.robot, id, said](Reply& reply) {
    auto job = worker.Submit(site, JobKind::kRelocalise, true, id, {robot});
    if (job) {
      reply.jobs = {*std::move(job)};
    } else {  // Others have taken the room meanwhile. The robot looks for itself in its own map.
      spdlog::warn("robot {}: no job looks for it: {}", robot, job.error().message);
      if (!said) reply.status = job.error();
    }
  });
}

Result<Job> Desk::SubmitJob(const Request& request) {
  if (request.job_kind == JobKind::kRelocalise)
    return Fail(StatusCode::kInvalidArgument, "a job that looks for a robot is submitted by the request RELOCALISE");
  if (atlas_.Find(request.site) == nullptr) return Fail(StatusCode::kNotFound, "no site '" + request.site + "'");
  return worker_.Submit(request.site, request.job_kind, request.enable, RequestId(request.client, request.sequence));
}

std::optional<Answer> Desk::EnableMap(const Request& request) {
  const auto site = atlas_.Find(request.site);
  if (site == nullptr) return ReplyTo(request, {StatusCode::kNotFound, "no site '" + request.site + "'"});
  site->Enable(request.map_version, [answers = answers_, request](Result<std::uint32_t> enabled) {
    const LogContext context(FieldsOf(request));
    Reply reply = ReplyTo(request, enabled ? Status{} : enabled.error());
    if (enabled) spdlog::info("site {}: map version {} is enabled", request.site, *enabled);
    answers->Send(request, std::move(reply));
  });
  return std::nullopt;
}

std::optional<Answer> Desk::EditMap(const Request& asked) {
  const auto site = atlas_.Find(asked.site);
  if (site == nullptr) return ReplyTo(asked, {StatusCode::kNotFound, "no site '" + asked.site + "'"});
  Request request = asked;
  request.edit.made = WallClock();
  const auto answer = [answers = answers_, request](Result<std::uint64_t> edited) {
    const LogContext context(FieldsOf(request));
    Reply reply = ReplyTo(request, edited ? Status{} : edited.error());
    if (!edited) return answers->Send(request, std::move(reply));
    const bool added = request.kind == RequestKind::kMapEditAdd;
    spdlog::info("site {}: edit {} of the map is {}", request.site, added ? *edited : request.edit.id,
                 added ? "made" : "removed");
    if (added) reply.edits = {request.edit};
    if (added) reply.edits.front().id = *edited;
    answers->Send(request, std::move(reply));
  };
  if (request.kind == RequestKind::kMapEditRemove) {
    site->RemoveEdit(request.edit.id, answer);
  } else {
    site->AddEdit(MapEdit(request.edit), answer);
  }
  return std::nullopt;
}

Sessions Desk::SessionOf(const std::string& robot) const {
  const auto session = roster_.Find(robot);
  return session ? Sessions{session->record().snapshot()} : Sessions{};
}

Sessions Desk::AllSessions() const {
  Sessions snapshots;
  for (const auto& session : roster_.All()) snapshots.push_back(session->record().snapshot());
  return snapshots;
}

Maps Desk::MapOf(const std::string& name) const {
  const auto site = atlas_.Find(name);
  return site ? Maps{site->snapshot()} : Maps{};
}

Maps Desk::AllMaps() const {
  Maps snapshots;
  for (const auto& site : atlas_.All()) snapshots.push_back(site->snapshot());
  return snapshots;
}

}  // namespace cairn::server
