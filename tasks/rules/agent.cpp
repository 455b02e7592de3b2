#include "duet/tasks/rules/agent.h"

#include <array>

namespace duet {

void append(Tracks& tracks, const Tracks& more) { tracks.insert(tracks.end(), more.begin(), more.end()); }

Tracks hands_of(const std::string& who, const Agent& agent) {
  return {{who + ".lhand", &agent.lhand}, {who + ".rhand", &agent.rhand}};
}

Tracks direction_to(const Agent& performer, const Agent& partner) {
  if (partner.root.cols() > 0) return {{"partner.root", &partner.root}};
  return {{"performer.lshoulder", &performer.lshoulder}, {"performer.rshoulder", &performer.rshoulder}};
}

Eigen::ArrayXd distances(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) {
  return (a - b).colwise().norm().transpose().array();
}

Eigen::ArrayXd heights(const Eigen::Matrix3Xd& track, const Eigen::Matrix3Xd& root) {
  return (track.row(2) - root.row(2)).transpose().array();
}

ClosestHands closest_hands(const Agent& performer, const Agent& partner) {
  const std::array<Eigen::ArrayXd, 4> pairs = {
      distances(performer.lhand, partner.lhand), distances(performer.lhand, partner.rhand),
      distances(performer.rhand, partner.lhand), distances(performer.rhand, partner.rhand)};
  const Eigen::Index frames = pairs[0].size();
  ClosestHands closest{pairs[0], std::vector<bool>(frames), std::vector<bool>(frames)};
  for (Eigen::Index t = 0; t < frames; ++t) {
    size_t best = 0;
    for (size_t pair = 1; pair < pairs.size(); ++pair)
      if (pairs[pair][t] < pairs[best][t]) best = pair;
    closest.distance[t] = pairs[best][t];
    closest.performer_right[t] = best >= 2;
    closest.partner_right[t] = best % 2 == 1;
  }
  return closest;
}

}  // namespace duet
