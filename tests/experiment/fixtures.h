// Clips and suites that the bench tests share.
#pragma once

#include <memory>
#include <string>

#include "duet/experiment/suite/suite.h"
#include "duet/motion/paired_motion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/retarget/solver/pair.h"
#include "duet/robots/robot_model.h"

namespace duet::test {

inline std::shared_ptr<const RobotModel> g1() { return load_shared_robot(); }

inline PairedMotion paired(Task task, const RobotModel& robot) { return retarget(synthesize(task, {}), robot); }

// One engine without physics, one clip of two tasks: quick and exact.
inline Suite playback_suite() {
  return parse_suite(
      "schema: duet.suite/1\nname: test\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave, handshake]\n"
      "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\n",
      "test.yaml");
}

// One item of a suite's list of perturbations.
inline Perturbation perturbation(const std::string& yaml) {
  return parse_suite(
             "schema: duet.suite/1\nname: p\nversion: 1\nclips: {synth: {per_task: 1}}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nperturbations: [" +
                 yaml + "]\n",
             "p.yaml")
      .perturbations.front();
}

}  // namespace duet::test
