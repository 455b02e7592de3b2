// A metric of one's own beside the 18: how fast the robot's faster hand ever moves.
#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <string>
#include <vector>

#include "duet/metrics/catalogue.h"
#include "duet/robots/kinematics.h"

namespace {

// Largest speed of a wrist between two frames. [m/s]
double peak_hand_speed(const duet::PairedMotion& motion, const duet::RobotModel& robot) {
  const std::vector<int> hands = {robot.track_frame("lhand"), robot.track_frame("rhand")};
  const duet::PointTracks tracks = duet::frame_tracks(robot, motion.robot, hands);
  double fastest = 0.0;
  for (int t = 1; t < tracks.frames(); ++t)
    for (int hand = 0; hand < tracks.points(); ++hand)
      fastest = std::max(fastest, (tracks.at(t, hand) - tracks.at(t - 1, hand)).norm() * motion.robot.rate_hz);
  return fastest;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) {
    fmt::print(stderr, "usage: my_metric PAIRED_MOTION.npz\n");
    return 2;
  }
  duet::register_metric({.name = "peak_hand_speed",
                         .unit = "m/s",
                         .direction = duet::Direction::kNone,
                         .group = duet::MetricGroup::kRetargeting,
                         .title = "Peak hand speed",
                         .source = "examples/cpp/my_metric"},
                        peak_hand_speed);
  const duet::RobotModel robot = duet::load_robot(duet::default_card_path());
  const std::map<std::string, double> scores = duet::score_motion(duet::load_paired_motion(argv[1]), robot);
  for (const duet::MetricInfo& info : duet::motion_metric_infos())
    fmt::print("{:<24} {:>10.4g} {}\n", info.name, scores.at(std::string(info.name)), info.unit);
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "my_metric: {}\n", error.what());
  return 2;
}
