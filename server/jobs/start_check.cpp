#include "server/jobs/start_check.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "server/ops/log_context.h"

namespace cairn::server {

void StartCheck::Tick() {
  if (!options_.check_starts) return;
  std::map<SessionId, std::shared_ptr<Watched>> watched;
  for (const auto& session : roster_.All()) {
    const SessionRecord::Joining joining = session->record().joining();
    if (joining.fragment || joining.driven_m > StartJudgement::kFirstM || session->ending()) continue;
    const auto known = watched_.find(session->id());
    const auto one = known == watched_.end() ? std::make_shared<Watched>() : known->second;
    watched.emplace(session->id(), one);
    if (joining.driven_m < one->compared_at_m + StartJudgement::kEveryM || one->comparing) continue;
    one->compared_at_m = joining.driven_m;
    Compare(session, one);
  }
  watched_ = std::move(watched);
}

void StartCheck::Compare(const std::shared_ptr<Session>& session, const std::shared_ptr<Watched>& watched) const {
  const auto now = session->record().snapshot();
  const auto site = atlas_.Find(now.status.session.site);
  if (site == nullptr || !now.status.pose.localized || now.path.blocks() == 0) return;
  const auto ask = [session, way_m = watched->compared_at_m,
                    comparing = std::make_shared<Comparing>(watched)](const GridAgreement& agreement) {
    if (!comparing->judgement().Refuses(agreement, way_m)) return false;
    const std::string why = fmt::format(
        "its start contradicts the map: {:.0f} % of the compared walls stand where the other side has seen free space",
        100.0 * agreement.contradicted_share());
    const LogContext context(AboutRobot(session->record().state().robot, session->record().state().site));
    spdlog::warn("robot {}: {}. It is not localized, and not shown, until it is joined with the map",
                 session->record().state().robot, why);
    session->RefuseStart(why);
    return true;
  };
  site->CheckStart(session->id(), now.path.block(0).front().T_map_robot, ask);
}

}  // namespace cairn::server
