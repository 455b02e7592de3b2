// Where the numbers of a step are (docs/extending.md, "A host").

/** Places in a request and an answer, counted in doubles; as HostLayout of backends/host/host_backend.h has them. */
export function layoutOf(scene, memory) {
  const n = scene.robot.joints.length, links = scene.robot.links.length, capsules = scene.capsules.length;
  const state = 13 + 2 * n;
  const pushes = state + 4 * n, present = pushes + 6 * links, human = present + 1;
  return {
    n, links, capsules, memory,
    in: {q: 13, v: 13 + n, qTarget: state, kp: state + n, kd: state + 2 * n, tau: state + 3 * n,
         pushes, present, capsules: human, memory: human + 14 * capsules, size: human + 14 * capsules + memory},
    out: {state: 1, q: 14, v: 14 + n, torques: 1 + state, memory: 1 + state + n, count: 1 + state + n + memory,
          contacts: 2 + state + n + memory},
  };
}
