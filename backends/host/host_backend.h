// An engine that runs in a process of its own, a host, in any language: duet sends it the scene once and then, for each
// step, everything that the step depends on; the host keeps nothing between two steps but the scene. Reset, kick,
// snapshot and restore are duet's alone, and the same request has the same answer. docs/extending.md, "A host".
#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "duet/backends/backend.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/host/host_process.h"

namespace duet {

// The scene as a host gets it; `options` with the defaults of those that are not set.
nlohmann::json host_scene(const Scene& scene, std::span<const EngineOption> options);

// Places in a step's request and answer, counted in doubles. n joints, L links, C capsules of a solid partner, m
// memory.
struct HostLayout {
  // `partner` counts capsules: 0 unless the partner is solid.
  HostLayout(const Scene& scene, const HostFacts& facts);

  static constexpr int kPush = 6;      // force in W, its point in the link
  static constexpr int kCapsule = 14;  // p, quat_wxyz, half length; velocities of its ends, in W
  static constexpr int kContact = 10;  // link, side, other, p_WC, f_W, depth
  int joints = 0, links = 0, capsules = 0, memory = 0, contacts = 0;
  int state = 0;    // size: p 3, quat_wxyz 4, v_WB 3, w_WB_B 3, q n, v n
  int request = 0;  // size: state, command (q_target, kp, kd, tau_ff: 4 n), 6 L, present 1, 14 C, m
  int answer = 0;   // size without contacts: outcome 1, state, torques n, m, count 1
};

// Starts the host, or takes a waiting one. Throws what HostProcess and its open() throw, and Backend's constructor.
std::unique_ptr<Backend> make_host_backend(const Scene& scene, const HostProgram& program,
                                           std::span<const EngineOption> options = {});

}  // namespace duet
