// The scene as an MJCF document, made in memory: no file of the robot's vendor is read. Names in it are indices, so
// that nothing needs escaping: links "l0", joints "j0", shapes "s0", capsules of the human "h0", and "ground".
#pragma once

#include <string>

#include "duet/backends/scene.h"

namespace duet {

// Largest numbers of contacts and of constraint rows that the scene can have; MuJoCo's buffers have these sizes.
struct MujocoSizes {
  int contacts = 0;
  int rows = 0;
};
MujocoSizes mujoco_sizes(const Scene& scene);

std::string make_mjcf(const Scene& scene);

}  // namespace duet
