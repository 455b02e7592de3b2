// Bodies on the floor at an instant: robots, their partner, forces, the reference.
import {Bodies, Colour, Layer} from './renderer';
import {Kinematics, Quat, Vec3, multiply, rotate, turnOfZ} from './kinematics';
import {Contact, Limits, Motion, Partner, Robot, Track} from './replay';
import {frameAt} from './timeline';

const SKIN: Colour = [0.86, 0.72, 0.56];
const HOT: Colour = [0.85, 0.1, 0.12];
const REFERENCE: Colour = [0.62, 0.64, 0.68];
const ARROW: Colour = [0.86, 0.16, 0.14];
const METRES_A_NEWTON = 0.005;

export interface Label {
  at: Vec3;
  text: string;
}

function mix(a: Colour, b: Colour, part: number): Colour {
  return [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2])];
}

export function contactsAt(track: Track, frame: number): Contact[] {
  let low = 0, high = track.contacts.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (track.contacts[middle]!.frame < frame) low = middle + 1;
    else high = middle;
  }
  const list: Contact[] = [];
  for (; low < track.contacts.length && track.contacts[low]!.frame === frame; ++low) list.push(track.contacts[low]!);
  return list;
}

// Feet and blocks, the shapes outside of them, and what joins them.
function addRobot(kinematics: Kinematics, robot: Robot, colour: Colour, to: Bodies): void {
  const p: Vec3 = [0, 0, 0], q: Vec3 = [0, 0, 0], R: Quat = [1, 0, 0, 0], dark = mix(colour, [0, 0, 0], 0.32);
  const inside = new Set(robot.outline.hulls.flatMap((hull) => hull.shapes));
  for (const [i, shape] of robot.shapes.entries()) {
    if (inside.has(i)) continue;
    kinematics.point(shape.link, shape.p, p);
    multiply(kinematics.R[shape.link]!, shape.quat_wxyz, R);
    to.add(p, R, shape.radius, shape.half_length, 1, colour);
  }
  for (const hull of robot.outline.hulls)
    to.addHull(hull, kinematics.p[hull.link]!, kinematics.R[hull.link]!, hull.foot ? dark : colour);
  for (const bar of robot.outline.bars) {
    kinematics.point(bar.links[0], bar.from, p);
    kinematics.point(bar.links[1], bar.to, q);
    const axis: Vec3 = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
    for (let k = 0; k < 3; ++k) p[k] = (p[k]! + q[k]!) / 2;
    to.add(p, turnOfZ(axis, R), bar.radius, Math.hypot(...axis) / 2, 1, dark);
  }
}

// The pictures of one track, made again when its frame or colour changes.
export class Actor {
  readonly kinematics: Kinematics | null;
  readonly bodies = new Bodies();
  readonly reference = new Bodies();
  readonly partner = new Bodies();
  readonly other = new Bodies();
  readonly arrows = new Bodies();
  labels: Label[] = [];
  frame = -1;
  private made = '';
  private referenceMade = false;
  private readonly held = new Map<number, number>(); // largest force over limit of a capsule so far

  constructor(readonly track: Track, private readonly limits: Limits) {
    this.kinematics = track.robot && new Kinematics(track.robot);
  }

  update(seconds: number, colour: Colour, hold: boolean): void {
    const frame = frameAt(this.track, seconds), made = `${frame} ${colour.join()} ${hold}`;
    if (made === this.made) return;
    this.made = made;
    this.frame = frame;
    if (this.kinematics) this.poseOf(this.track.motion, this.bodies, colour);
    this.referenceMade = false;
    const contacts = contactsAt(this.track, frame);
    this.touch(contacts);
    this.touched(contacts, hold);
    this.person(this.track.partner, this.partner, (capsule) => mix(SKIN, HOT, this.tintOf(capsule)));
    this.person(this.track.other, this.other, () => mix(colour, [1, 1, 1], 0.25));
  }

  layers(ghost: boolean, reference: boolean, person: boolean): Layer[] {
    const layers: Layer[] = [];
    if (person || !this.track.robot) {
      for (const bodies of [this.partner, this.other]) layers.push({bodies, alpha: ghost ? 0.42 : 1, shadow: !ghost});
    }
    if (!ghost) layers.push({bodies: this.arrows, alpha: 1, shadow: false});
    if (reference && !this.referenceMade) {
      this.referenceMade = true;
      this.poseOf(this.track.reference, this.reference, REFERENCE);
    }
    if (reference) layers.push({bodies: this.reference, alpha: 0.4, shadow: false});
    layers.push({bodies: this.bodies, alpha: ghost ? 0.42 : 1, shadow: !ghost});
    return layers;
  }

  private poseOf(motion: Motion, to: Bodies, colour: Colour): void {
    to.clear();
    if (this.kinematics?.update(motion, this.frame)) addRobot(this.kinematics, this.track.robot!, colour, to);
  }

  private touch(contacts: Contact[]): void {
    this.arrows.clear();
    this.labels = [];
    const R: Quat = [1, 0, 0, 0], half: Vec3 = [0, 0, 0], p: Vec3 = [0, 0, 0];
    for (const contact of [...contacts].sort((a, b) => b.newton - a.newton)) {
      if (contact.newton < 0.05) continue;
      const length = Math.min(0.9, 0.06 + METRES_A_NEWTON * contact.newton), head = 0.05;
      turnOfZ(contact.force, R);
      rotate(R, [0, 0, 1], half);
      const along = (d: number): Vec3 => {
        for (let k = 0; k < 3; ++k) p[k] = contact.point[k]! + d * half[k]!;
        return p;
      };
      this.arrows.add(along(length / 2 - head / 2), R, 0.009, length / 2 - head / 2, 1, ARROW);
      this.arrows.add(along(length - head / 2), R, 0.026, head / 2, 0.05, ARROW);
      if (this.labels.length >= 6) continue;
      const region = this.track.partner?.capsules[contact.capsule]?.region ?? '';
      this.labels.push({at: [...along(length)], text: `${contact.newton.toFixed(1)} N ${region.replaceAll('_', ' ')}`});
    }
  }

  // How close to its limit the force on each capsule of the partner is, or was at most.
  private touched(contacts: Contact[], hold: boolean): void {
    const forces = new Map<number, number>();
    for (const contact of contacts) forces.set(contact.capsule, (forces.get(contact.capsule) ?? 0) + contact.newton);
    if (!hold) this.held.clear();
    for (const [i, force] of forces) {
      const limit = this.limits.regions[this.track.partner?.capsules[i]?.region ?? '']?.newton;
      this.held.set(i, Math.max(limit ? force / limit : 0, this.held.get(i) ?? 0));
    }
  }

  private tintOf(capsule: number): number {
    const ratio = this.held.get(capsule) ?? 0;
    return ratio > 0 ? Math.min(1, 0.25 + 0.75 * ratio) : 0;
  }

  private person(of: Partner | null, to: Bodies, colourOf: (capsule: number) => Colour): void {
    to.clear();
    if (!of || this.frame >= of.joints.rows) return;
    const rows = of.joints.rows, R: Quat = [1, 0, 0, 0], middle: Vec3 = [0, 0, 0], axis: Vec3 = [0, 0, 0];
    for (const [i, capsule] of of.capsules.entries()) {
      for (let k = 0; k < 3; ++k) {
        const a = of.joints.values[(3 * capsule.a + k) * rows + this.frame]!;
        const b = of.joints.values[(3 * capsule.b + k) * rows + this.frame]!;
        axis[k] = (capsule.end - capsule.begin) * (b - a);
        middle[k] = a + capsule.begin * (b - a) + axis[k]! / 2;
      }
      to.add(middle, turnOfZ(axis, R), capsule.radius, Math.hypot(...axis) / 2, 1, colourOf(i));
    }
  }
}
