#include "client/sim/wall.h"

namespace cairn::sim {

void AppendWall(const Wall& wall, std::vector<Segment>* segments) {
  const double length = (wall.b_map - wall.a_map).norm(), half = wall.thickness_m / 2;
  const Eigen::Vector2d along = (wall.b_map - wall.a_map) / length, left(-along.y(), along.x());
  const auto piece = [&](double from, double to) {
    if (to <= from) return;
    const Eigen::Vector2d corners[4] = {wall.a_map + along * from - left * half, wall.a_map + along * to - left * half,
                                        wall.a_map + along * to + left * half, wall.a_map + along * from + left * half};
    for (int i = 0; i < 4; ++i) segments->push_back({corners[i], corners[(i + 1) % 4]});
  };
  double from = -half;
  for (const WallGap& gap : wall.gaps) {
    piece(from, gap.from_m);
    from = gap.to_m;
  }
  piece(from, length + half);
}

}  // namespace cairn::sim
