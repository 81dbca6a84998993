/* A simulated robot in a room: where it is at a moment, and what its laser sees from there. It drives on a circle, so
 * both are known in closed form. */
#pragma once

struct RoomPose {
  double x, y, theta;
};

/* `seconds` since it began to drive. The frame is that of the room. */
struct RoomPose TruthAt(double seconds);
/* The range from a place in the room along a direction. */
double RangeFrom(double x, double y, double direction);
/* a^-1 * b. */
struct RoomPose RelativePose(struct RoomPose a, struct RoomPose b);
