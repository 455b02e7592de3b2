// One clock for all tracks of a scene, in seconds since the act began, and the events on it.
import {Kinematics, Vec3} from './kinematics';
import {Columns} from './columns';
import {Track} from './replay';

export const PARTED = 0.05; // [m], as in the report's table of engines

export interface Happening {
  seconds: number;
  kind: 'act' | 'contact' | 'verdict' | 'end' | 'parted';
  text: string;
  track: number;
}

export function beginOf(track: Track): number { return -track.act[0] / track.rate; }
export function endOf(track: Track): number { return (track.frames - 1 - track.act[0]) / track.rate; }

// The nearest frame; before the first one the first, after the last one the last.
export function frameAt(track: Track, seconds: number): number {
  return Math.min(track.frames - 1, Math.max(0, Math.round(seconds * track.rate) + track.act[0]));
}

export function secondsAt(track: Track, frame: number): number { return (frame - track.act[0]) / track.rate; }

export function rangeOf(tracks: Track[]): [number, number] {
  return [Math.min(...tracks.map(beginOf)), Math.max(...tracks.map(endOf))];
}

// Where the base is, or the pelvis of the person in the robot's place: x, y and z are the first three columns.
export function baseOf(track: Track): Columns {
  return track.robot ? track.motion.position : (track.other ?? track.partner)!.joints;
}

// Where the robot's base and its partner are, by default when the act begins; without a partner a place before the robot.
export function pairOf(track: Track, seconds = 0): [Vec3, Vec3] {
  const frame = frameAt(track, seconds), base = baseOf(track), joints = track.partner?.joints;
  const at = (of: Columns): Vec3 => [0, 1, 2].map((k) => of.values[k * of.rows + Math.min(frame, of.rows - 1)]!) as Vec3;
  const robot = at(base);
  return [robot, joints && joints.rows > 0 ? at(joints) : [robot[0] + 1, robot[1], robot[2]]];
}

export function phaseAt(track: Track, frame: number): string {
  return frame < track.act[0] ? 'preparation' : frame < track.act[1] ? 'act' : 'follow-up';
}

// Whether a mask that changes at `changes` holds at a place.
export function holds(changes: number[], place: number): boolean {
  let on = false;
  for (const change of changes) {
    if (change > place) break;
    on = !on;
  }
  return on;
}

// The last of the detector's samples that looks at no more than the frames up to this one; -1 before the first.
export function sampleAt(frames: number[], frame: number): number {
  let low = -1, high = frames.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (frames[middle]! <= frame) low = middle;
    else high = middle - 1;
  }
  return low;
}

// Where a robot's base and both hands are, ten times a second; nothing of people.
export interface Trace {
  step: number; // frames
  points: Float64Array; // x, y, z of each point in turn
}

export function traceOf(track: Track): Trace {
  const step = Math.max(1, Math.round(track.rate / 10));
  if (!track.robot) return {step, points: new Float64Array(0)};
  const kinematics = new Kinematics(track.robot);
  const count = Math.ceil(track.frames / step), points = new Float64Array(9 * count).fill(NaN);
  const out: Vec3 = [0, 0, 0];
  for (let i = 0; i < count; ++i) {
    if (!kinematics.update(track.motion, i * step)) continue;
    points.set(kinematics.p[0]!, 9 * i);
    for (const [k, name] of ['lhand', 'rhand'].entries()) {
      const point = track.robot.points[name];
      if (point) points.set(kinematics.point(point.link, point.p, out), 9 * i + 3 * (k + 1));
      else points.set(kinematics.p[0]!, 9 * i + 3 * (k + 1));
    }
  }
  return {step, points};
}

// Distance of the farthest of the points, by sample of `a`; NaN where one of the two is not there.
export function distancesOf(a: Track, ta: Trace, b: Track, tb: Trace): Float64Array {
  const out = new Float64Array(tb.points.length > 0 ? ta.points.length / 9 : 0).fill(NaN);
  for (let i = 0; i < out.length; ++i) {
    const frame = Math.round((secondsAt(a, i * ta.step) + b.act[0] / b.rate) * b.rate), j = Math.round(frame / tb.step);
    if (j < 0 || 9 * j >= tb.points.length) continue;
    let far = 0;
    for (let k = 0; k < 9; k += 3)
      far = Math.max(far, Math.hypot(ta.points[9 * i + k]! - tb.points[9 * j + k]!,
                                     ta.points[9 * i + k + 1]! - tb.points[9 * j + k + 1]!,
                                     ta.points[9 * i + k + 2]! - tb.points[9 * j + k + 2]!));
    out[i] = far;
  }
  return out;
}

// Begin and end of the partner's touch; gaps of up to 0.1 s do not end it.
function touches(track: Track): [number, number][] {
  const list: [number, number][] = [], gap = 0.1 * track.rate;
  for (const contact of track.contacts) {
    const last = list[list.length - 1];
    if (last && contact.frame - last[1] <= gap) last[1] = contact.frame;
    else list.push([contact.frame, contact.frame]);
  }
  return list;
}

export function happeningsOf(track: Track, index: number): Happening[] {
  const list: Happening[] = [];
  const add = (frame: number, kind: Happening['kind'], text: string) =>
    list.push({seconds: secondsAt(track, frame), kind, text, track: index});
  if (track.act[0] > 0) add(track.act[0], 'act', 'act begins');
  if (track.act[1] < track.frames) add(track.act[1], 'act', 'act ends');
  for (const [begin, end] of touches(track)) {
    add(begin, 'contact', 'touch begins');
    add(end, 'contact', 'touch ends');
  }
  const detector = track.detectors[0];
  for (const sample of detector?.success ?? [])
    add(detector!.frames[sample]!, 'verdict', holds(detector!.success, sample) ? 'task detected' : 'no longer detected');
  if (track.outcome !== 'ok') add(track.frames - 1, 'end', track.outcome);
  return list.sort((a, b) => a.seconds - b.seconds);
}
