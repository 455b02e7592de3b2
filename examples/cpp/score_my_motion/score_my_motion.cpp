// Scores motions of one's own: the 18 retargeting metrics of a paired motion, and the verdict of its task's detector on
// it or on a recording.
#include <fmt/format.h>

#include <exception>
#include <string>

#include "duet/archives/npy/npz.h"
#include "duet/archives/recording_file.h"
#include "duet/metrics/catalogue.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/retargeting.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_model.h"

namespace {

void print_verdict(duet::Task task, const duet::Agent& human, const duet::Agent& robot) {
  const duet::DetectorResult result = duet::detect(task, human, robot, duet::DetectorVersion::kRobot);
  fmt::print("{} {}\n", duet::to_string(task), result.success ? "detected" : "not detected");
  for (const auto& [name, margin] : result.margins) fmt::print("  margin of {} {:.4g}\n", name, margin);
}

void score(const duet::PairedMotion& motion, const duet::RobotModel& robot) {
  const std::map<std::string, double> metrics = duet::retargeting_metrics(motion, robot);
  for (const auto& [name, value] : metrics) fmt::print("{} {} {}\n", name, value, duet::metric_info(name).unit);
  print_verdict(motion.task, duet::human_agent(motion.partner.joints), duet::robot_agent(robot, motion.robot));
}

void score(const duet::Recording& recording, const duet::RobotModel& robot) {
  fmt::print("ended: {}\n", duet::to_string(recording.outcome));
  if (!recording.task) {
    fmt::print("of no task: no detector is asked\n");
    return;
  }
  print_verdict(*recording.task, duet::human_agent(recording.partner), duet::robot_agent(robot, recording.robot));
}

void score_file(const std::string& file, const duet::RobotModel& robot) {
  const duet::Npz npz = duet::Npz::load(file);
  fmt::print("{}\n", file);
  if (npz.text("schema") == "duet.recording")
    score(duet::read_recording(npz), robot);
  else
    score(duet::read_paired_motion(npz), robot);
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 2) {
    fmt::print(stderr, "usage: score_my_motion FILE.npz...\n");
    return 2;
  }
  const duet::RobotModel robot = duet::load_robot(duet::default_card_path());
  for (int i = 1; i < argc; ++i) score_file(argv[i], robot);
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "score_my_motion: {}\n", error.what());
  return 2;
}
