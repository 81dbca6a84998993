// Notices robots that are not where somebody said they start. On the first metres of a robot it is compared, after each
// metre, with what others have drawn of the same place before (maps/grid_agreement.h). If they contradict each other
// twice, its start is refused: from then on the robot is a fragment like one that did not say where it starts. It is
// not localized, the map shows nothing of it, and the joiner looks for where it really is. Thread rule: Tick on one
// thread (housekeeping).
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <utility>

#include "server/jobs/jobs_options.h"
#include "server/jobs/start_judgement.h"
#include "server/maps/atlas.h"
#include "server/robots/roster.h"

namespace cairn::server {

class StartCheck {
 public:
  StartCheck(const JobsOptions& options, const Roster& roster, const Atlas& atlas)
      : options_(options), roster_(roster), atlas_(atlas) {}

  // Begins the comparisons that are due.
  void Tick();

 private:
  // Shared with the site's strand while it compares.
  struct Watched {
    double compared_at_m = 0.0;
    std::atomic<bool> comparing = false;
    StartJudgement judgement;  // On the site's strand.
  };
  // A comparison under way. It ends with what was asked of the site, also if that throws.
  class Comparing {
   public:
    explicit Comparing(std::shared_ptr<Watched> watched) : watched_(std::move(watched)) { watched_->comparing = true; }
    Comparing(const Comparing&) = delete;
    Comparing& operator=(const Comparing&) = delete;
    ~Comparing() { watched_->comparing = false; }
    [[nodiscard]] StartJudgement& judgement() const { return watched_->judgement; }

   private:
    std::shared_ptr<Watched> watched_;
  };
  void Compare(const std::shared_ptr<Session>& session, const std::shared_ptr<Watched>& watched) const;

  const JobsOptions options_;
  const Roster& roster_;
  const Atlas& atlas_;
  std::map<SessionId, std::shared_ptr<Watched>> watched_;  // Sessions on their first metres.
};

}  // namespace cairn::server
