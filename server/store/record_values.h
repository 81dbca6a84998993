// Conversions of the small values that several records contain. Inside this room only. Stateless.
#pragma once

#include "cairn/record.pb.h"
#include "server/store/records.h"

namespace cairn::server {

void Fill(record::Pose& to, const Pose2& from);
void Fill(record::Stream& to, const StreamId& from);
void Fill(record::Status& to, const Status& from);
void Fill(record::SessionRequest& to, const SessionRequest& from);
void Fill(record::Grid& to, const StoredGrid& from);

[[nodiscard]] Pose2 ValueOf(const record::Pose& from);
[[nodiscard]] StreamId ValueOf(const record::Stream& from);
[[nodiscard]] Status ValueOf(const record::Status& from);
[[nodiscard]] SessionRequest ValueOf(const record::SessionRequest& from);
[[nodiscard]] Result<StoredGrid> ValueOf(const record::Grid& from);

// The error of every record that cannot be read.
[[nodiscard]] inline tl::unexpected<Status> Unreadable(const std::string& what) {
  return Fail(StatusCode::kDataLoss, "the store holds " + what + " that no server writes");
}

}  // namespace cairn::server
