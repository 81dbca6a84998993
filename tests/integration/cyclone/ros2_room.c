#include "tests/integration/cyclone/ros2_room.h"

#include <math.h>

static const double kHalfTurn = 3.14159265358979323846;
static const double kRadius = 1.5;
static const double kTurnRate = 0.3; /* rad/s */

/* Walls as segments: the room, and two boxes in it that leave no symmetry. */
struct Wall {
  double x0, y0, x1, y1;
};
static const struct Wall kWalls[] = {
    {-4, -3, 4, -3},
    {4, -3, 4, 3},
    {4, 3, -4, 3},
    {-4, 3, -4, -3},
    {2.5, 1.5, 3.0, 1.5},
    {3.0, 1.5, 3.0, 2.2},
    {3.0, 2.2, 2.5, 2.2},
    {2.5, 2.2, 2.5, 1.5},
    {-3.4, -2.4, -2.8, -2.4},
    {-2.8, -2.4, -2.8, -1.2},
    {-2.8, -1.2, -3.4, -1.2},
    {-3.4, -1.2, -3.4, -2.4},
};

struct RoomPose TruthAt(double seconds) {
  const double angle = -kHalfTurn / 2 + kTurnRate * seconds;
  const struct RoomPose pose = {kRadius * cos(angle), kRadius * sin(angle),
                                remainder(angle + kHalfTurn / 2, 2 * kHalfTurn)};
  return pose;
}

double RangeFrom(double x, double y, double direction) {
  const double dx = cos(direction), dy = sin(direction);
  double nearest = INFINITY;
  for (unsigned i = 0; i < sizeof(kWalls) / sizeof(kWalls[0]); ++i) {
    const struct Wall* wall = &kWalls[i];
    const double wx = wall->x1 - wall->x0, wy = wall->y1 - wall->y0;
    const double cross = dx * wy - dy * wx;
    if (fabs(cross) < 1e-12) continue;
    const double ox = wall->x0 - x, oy = wall->y0 - y;
    const double range = (ox * wy - oy * wx) / cross;
    const double along = (ox * dy - oy * dx) / cross;
    if (range > 0 && along >= 0 && along <= 1 && range < nearest) nearest = range;
  }
  return nearest;
}

struct RoomPose RelativePose(struct RoomPose a, struct RoomPose b) {
  const double dx = b.x - a.x, dy = b.y - a.y;
  const struct RoomPose relative = {cos(a.theta) * dx + sin(a.theta) * dy, -sin(a.theta) * dx + cos(a.theta) * dy,
                                    remainder(b.theta - a.theta, 2 * kHalfTurn)};
  return relative;
}
