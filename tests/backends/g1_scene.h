// The G1 on the ground, for the tests of what no small robot shows.
#pragma once

#include <array>

#include "duet/backends/scene.h"
#include "duet/robots/robot_model.h"

namespace duet::test {

inline std::shared_ptr<const RobotModel> g1() { return load_shared_robot(); }

inline Scene g1_scene(PartnerMode partner = PartnerMode::kNone) {
  Scene scene;
  scene.robot = g1();
  scene.partner = partner;
  return scene;
}

}  // namespace duet::test
