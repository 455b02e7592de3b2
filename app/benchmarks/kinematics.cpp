#include "duet/robots/kinematics.h"

#include "duet/app/benchmarks/parts.h"
#include "duet/app/benchmarks/timer.h"

namespace duet {
namespace {

std::vector<BenchmarkFigure> time_forward(const BenchmarkOptions& options) {
  constexpr int kCalls = 100;  // a batch: one call is short against the cost of a std::function
  const RobotModel robot = load_robot(default_card_path());
  Kinematics kinematics(robot);
  Eigen::VectorXd q = robot.neutral;
  const double seconds = best_call_seconds(
      [&] {
        for (int i = 0; i < kCalls; ++i) {
          q[0] = 1e-3 * i;
          kinematics.update(Pose(), q);
        }
      },
      options.seconds);
  return {at_most("kinematics/forward", 1e6 * seconds / kCalls, "us", 2.0)};
}

}  // namespace

void add_kinematics_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"kinematics/forward", "poses of all links of the G1", time_forward});
}

}  // namespace duet
