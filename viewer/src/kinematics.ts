// Forward kinematics of a robot's tree (robots/kinematics.h): poses of links from a root's pose and joint angles.
// Quaternions are (w, x, y, z).
import {Motion, Robot} from './replay';

export type Vec3 = [number, number, number];
export type Quat = [number, number, number, number];

export function multiply(a: ArrayLike<number>, b: ArrayLike<number>, out: Quat): Quat {
  const aw = a[0]!, ax = a[1]!, ay = a[2]!, az = a[3]!, bw = b[0]!, bx = b[1]!, by = b[2]!, bz = b[3]!;
  out[0] = aw * bw - ax * bx - ay * by - az * bz;
  out[1] = aw * bx + ax * bw + ay * bz - az * by;
  out[2] = aw * by - ax * bz + ay * bw + az * bx;
  out[3] = aw * bz + ax * by - ay * bx + az * bw;
  return out;
}

export function rotate(q: ArrayLike<number>, v: ArrayLike<number>, out: Vec3): Vec3 {
  const w = q[0]!, x = q[1]!, y = q[2]!, z = q[3]!, vx = v[0]!, vy = v[1]!, vz = v[2]!;
  const tx = 2 * (y * vz - z * vy), ty = 2 * (z * vx - x * vz), tz = 2 * (x * vy - y * vx);
  out[0] = vx + w * tx + y * tz - z * ty;
  out[1] = vy + w * ty + z * tx - x * tz;
  out[2] = vz + w * tz + x * ty - y * tx;
  return out;
}

// The turn that takes z to the direction of `d`.
export function turnOfZ(d: ArrayLike<number>, out: Quat): Quat {
  const length = Math.hypot(d[0]!, d[1]!, d[2]!) || 1;
  const x = d[0]! / length, y = d[1]! / length, z = d[2]! / length;
  if (z < -0.999999) return Object.assign(out, [0, 1, 0, 0]) as Quat;
  const w = 1 + z, norm = Math.hypot(w, -y, x);
  out[0] = w / norm;
  out[1] = -y / norm;
  out[2] = x / norm;
  out[3] = 0;
  return out;
}

export class Kinematics {
  readonly p: Vec3[];
  readonly R: Quat[];

  constructor(readonly robot: Robot) {
    this.p = robot.links.map(() => [0, 0, 0]);
    this.R = robot.links.map(() => [1, 0, 0, 0]);
  }

  // Frame t of a motion. False where it is not there or not finite.
  update(motion: Motion, t: number): boolean {
    const {position, turn, q} = motion;
    if (t < 0 || t >= position.rows) return false;
    const root = this.p[0]!, R = this.R[0]!;
    for (let k = 0; k < 3; ++k) root[k] = position.values[k * position.rows + t]!;
    for (let k = 0; k < 4; ++k) R[k] = turn.values[k * turn.rows + t]!;
    const norm = Math.hypot(...R);
    if (!(norm > 0) || !Number.isFinite(root[0] + root[1] + root[2])) return false;
    for (let k = 0; k < 4; ++k) R[k]! /= norm;
    const turned: Quat = [1, 0, 0, 0], hinge: Quat = [1, 0, 0, 0], offset: Vec3 = [0, 0, 0];
    for (let i = 1; i < this.robot.links.length; ++i) {
      const link = this.robot.links[i]!, parent = link.parent;
      const angle = q.values[(i - 1) * q.rows + t]!, s = Math.sin(angle / 2);
      if (!Number.isFinite(angle)) return false;
      rotate(this.R[parent]!, link.p, offset);
      for (let k = 0; k < 3; ++k) this.p[i]![k] = this.p[parent]![k]! + offset[k]!;
      hinge[0] = Math.cos(angle / 2);
      for (let k = 0; k < 3; ++k) hinge[k + 1] = s * link.axis[k]!;
      multiply(link.quat_wxyz, hinge, turned);
      multiply(this.R[parent]!, turned, this.R[i]!);
    }
    return true;
  }

  point(link: number, p: ArrayLike<number>, out: Vec3): Vec3 {
    rotate(this.R[link]!, p, out);
    for (let k = 0; k < 3; ++k) out[k]! += this.p[link]![k]!;
    return out;
  }
}
