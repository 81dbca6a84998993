// Tiles that a site makes only when it is asked for them: the layer of disagreement, and what one robot alone has drawn
// (desk.h).
#include <utility>

#include "server/queries/desk.h"

namespace cairn::server {
namespace {

// So many participants may have questions that wait for sites, and each of them so many questions.
constexpr std::size_t kMostAskers = 64;
constexpr int kMostOfOne = 2;

}  // namespace

// Null where too many wait. The place is free again when nobody has the result any more.
std::shared_ptr<const void> Desk::SiteQuestions::Take(std::uint64_t asker) {
  const MutexLock lock(mutex_);
  if (open_.size() >= kMostAskers && !open_.contains(asker)) return nullptr;
  int& of_asker = open_[asker];
  if (of_asker >= kMostOfOne) return nullptr;
  ++of_asker;
  return {this, [self = shared_from_this(), asker](const void* /*questions*/) {
            const MutexLock leaving(self->mutex_);
            if (--self->open_[asker] == 0) self->open_.erase(asker);
          }};
}

std::optional<Answer> Desk::AskTiles(const Request& request) {
  const bool of_robot = request.site.empty() && !request.robot.empty();
  if (!of_robot && !request.disagreement) return AnswerTiles(request, MapOf(request.site), generation_);
  if (of_robot && request.disagreement)
    return ReplyTo(request, {StatusCode::kInvalidArgument, "one robot alone does not differ from itself"});
  std::shared_ptr<Session> session;
  if (of_robot) {
    auto found = roster_.FindOrFail(request.robot);
    if (!found) return ReplyTo(request, found.error());
    session = *std::move(found);
  }
  const auto site = atlas_.Find(of_robot ? session->record().state().site : request.site);
  const Maps maps = site == nullptr ? Maps{} : Maps{site->snapshot()};
  if (auto refused = RefusesTiles(request, maps)) return *std::move(refused);
  const auto place = site_questions_->Take(request.asker);
  if (place == nullptr)
    return ReplyTo(request, {StatusCode::kResourceExhausted, "too many questions wait for their sites"});
  const auto done = [answers = answers_, place, request,
                     generation = generation_](Result<std::shared_ptr<const MapSnapshot>> map) {
    if (!map) return answers->Give(request, ReplyTo(request, map.error()));
    answers->Give(request, AnswerTiles(request, {*std::move(map)}, generation));
  };
  if (of_robot) {
    site->AskPartOf(session->id(), static_cast<int>(request.level), done);
  } else {
    site->AskDisagreement(done);
  }
  return std::nullopt;
}

}  // namespace cairn::server
