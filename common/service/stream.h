// What robots stream: a scan or an odometry sample with the stream it belongs to.
#pragma once

#include <memory>

#include "common/map/tile.h"
#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"
#include "common/service/session.h"

namespace cairn {

struct StreamId {
  NameId robot_id = 0;
  NameId sensor_id = 0;
  SessionToken session = 0;  // Must be the robot's session.
};

struct ScanSample {
  StreamId stream;
  Scan scan;
};

struct OdometrySample {
  StreamId stream;
  Odometry odometry;
};

struct TileSample {
  NameId site_id = 0;
  Tile tile;
  bool deleted = false;       // The tile is no longer part of the map (tombstone; DDS dispose is not used).
  Generation generation = 0;  // Set by the server's egress.
};

}  // namespace cairn
