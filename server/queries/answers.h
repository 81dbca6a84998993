// The answers to requests about robots and maps. Each is a pure function of snapshots, which were copied under
// short locks, so no answer waits for an estimator. If a request names a robot or site that the server does not
// know, the snapshots are empty and the answer is NOT_FOUND. Answers may be large: ReplyParts
// cuts them into parts for the wire. Stateless, thread-safe.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "common/service/request.h"
#include "server/maps/map_snapshot.h"
#include "server/queries/reply_parts.h"
#include "server/robots/session_snapshot.h"

namespace cairn::server {

using Sessions = std::vector<SessionSnapshot>;
using Maps = std::vector<std::shared_ptr<const MapSnapshot>>;

// An answer without content. Every other answer starts from it.
[[nodiscard]] Reply ReplyTo(const Request& request, Status status = {});

// The newest pose of the robot and its hypotheses, or its pose at a stamp, interpolated between the two nearest poses.
// UNAVAILABLE: the pose may exist later (no scan has been used, or the stamp is after the newest pose of a
// running session). OUT_OF_RANGE: the pose will never exist (the stamp is before the first pose, or after the
// last pose of an ended session). `sessions`: the robot's session, if any.
[[nodiscard]] Reply AnswerPose(const Request& request, const Sessions& sessions);

// The path of the robot: the online poses exactly as they were published, one per scan used. With `smoothed`:
// the smoothed path of the enabled map version, or of the newest version that has one. FAILED_PRECONDITION:
// no smoothing job has finished. `sessions`: the robot's session, if any; `maps`: the map of its site.
[[nodiscard]] Answer AnswerPath(const Request& request, const Sessions& sessions, const Maps& maps);

// The states, newest poses and ledgers of sessions. `sessions`: all sessions, or the robot's if the request
// names a robot. If the request names a site, only the sessions of this site are returned.
[[nodiscard]] Reply AnswerStatus(const Request& request, const Sessions& sessions);

// The landmarks of a site in an area: those of every session's best particle at its last refresh.
// INVALID_ARGUMENT: the area is not valid. `sessions`: all sessions; `maps`: the map of the site, if any.
[[nodiscard]] Reply AnswerLandmarks(const Request& request, const Sessions& sessions, const Maps& maps);

// The tiles of a level of the map, or of the layer of disagreement, in an area that changed since a version. An area of
// all zeros means everywhere. If since_epoch is not the map's epoch, or since_generation not the server's `generation`,
// the client's tiles are no longer valid, and all tiles of the area are sent. INVALID_ARGUMENT: the level or the area
// is not valid; RefusesTiles says only this. `maps`: the map of the site, if any.
[[nodiscard]] std::optional<Reply> RefusesTiles(const Request& request, const Maps& maps);
[[nodiscard]] Answer AnswerTiles(const Request& request, const Maps& maps, Generation generation);

// The state and the versions of a site's map, or of all maps. `maps`: all maps, or the site's if the request
// names a site.
[[nodiscard]] Reply AnswerMapInfo(const Request& request, const Maps& maps);

// What people have said about a site's map. `maps`: the map of the site, if any.
[[nodiscard]] Reply AnswerMapEdits(const Request& request, const Maps& maps);

}  // namespace cairn::server
