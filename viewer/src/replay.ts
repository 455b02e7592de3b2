// The data of a page, schema `duet.replay/1` (replay/replay_header.h), and how it is read from the page.
import {Block, Columns, readColumns} from './columns';

export interface Robot {
  name: string;
  links: {name: string; parent: number; p: number[]; quat_wxyz: number[]; axis: number[]}[];
  shapes: {link: number; p: number[]; quat_wxyz: number[]; radius: number; half_length: number}[];
  points: Record<string, {link: number; p: number[]}>;
  outline: {hulls: Hull[]; bars: {links: [number, number]; from: number[]; to: number[]; radius: number}[]};
}

// The convex hull of spheres that a link carries: a foot, or a block of the trunk. Drawn in the place of its shapes.
export interface Hull {
  link: number;
  spheres: [number, number, number, number][]; // x, y, z and radius, in the axes of the link [m]
  shapes: number[];
  foot: boolean;
}

export interface Capsule {
  name: string;
  region: string;
  a: number;
  b: number;
  radius: number;
  begin: number;
  end: number;
}

export interface Partner {
  joints: Columns; // x, y, z of each joint in turn [m]
  capsules: Capsule[];
}

export interface Motion {
  position: Columns; // of the base [m]
  turn: Columns; // w, x, y, z
  q: Columns; // [rad]
}

export interface Contact {
  frame: number;
  link: number;
  capsule: number;
  point: [number, number, number]; // [m]
  force: [number, number, number]; // of the partner on the link [N]
  newton: number;
}

export interface DetectorTrace {
  version: string;
  set: string;
  evidence: number[]; // frames at which the mask changes
  success: number[]; // samples at which the verdict changes
  names: string[];
  thresholds: number[];
  units: string[];
  frames: number[]; // of the samples
  margins: Columns; // as parts of their thresholds
}

export interface Verdict {
  version: string;
  thresholds: string;
  success: boolean;
  parts: Record<string, boolean>;
  margins: Record<string, number | null>;
}

export interface Row {
  key: string;
  engine: string;
  engine_version: string;
  controller: string;
  policy: string;
  arm: string;
  seed: number;
  success: boolean | null;
  verdicts: Verdict[];
  state_hash: string;
  controller_digest: string;
  policy_digest: string;
  robot_digest: string;
  late_plans: number;
  policy_faults?: {late: number; invalid: number};
}

export interface Track {
  name: string;
  repeat: string;
  origin: string;
  robot: Robot | null; // null: people alone
  partner: Partner | null;
  other: Partner | null; // the person in the robot's place, where people are shown
  rate: number;
  frames: number;
  act: [number, number];
  outcome: string;
  message: string;
  contacts: Contact[];
  forces: Float64Array; // of the partner, summed over contacts, a frame [N]
  detectors: DetectorTrace[];
  motion: Motion;
  reference: Motion;
  row: Row | null;
}

export interface Scene {
  id: string;
  name: string;
  task: string;
  perturbation: string;
  successes: number;
  judged: number;
  disagreement: number;
  tracks: Track[];
}

export interface Limits {
  name: string;
  mark: string;
  regions: Record<string, {newton: number; kind: string}>;
}

export interface Replay {
  title: string;
  notes: string[];
  episodes_of_run: number;
  limits: Limits;
  scenes: Scene[];
}

/* eslint-disable @typescript-eslint/no-explicit-any */
type Json = any;

export const SCHEMA = 'duet.replay/1';

async function inflated(base64: string): Promise<Uint8Array> {
  const packed = Uint8Array.from(atob(base64.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Made when it is first asked for: a page has more tracks than are looked at.
function lazily<T extends object, K extends keyof T>(object: T, name: K, make: () => T[K]): void {
  Object.defineProperty(object, name, {
    configurable: true,
    enumerable: true,
    get(): T[K] {
      const value = make();
      Object.defineProperty(object, name, {value});
      return value;
    },
  });
}

class Reader {
  constructor(private readonly bytes: Uint8Array, private readonly header: Json,
              private readonly partners: Partner[]) {}

  columns(block: Block): Columns { return readColumns(this.bytes, block); }

  motion(json: Json): Motion {
    return {position: this.columns(json.position), turn: this.columns(json.turn), q: this.columns(json.q)};
  }

  contacts(json: Json): Contact[] {
    const where = this.columns(json.where), points = this.columns(json.points), forces = this.columns(json.forces);
    const at = (block: Columns, i: number, k: number) => block.values[k * block.rows + i]!;
    const list: Contact[] = [];
    for (let i = 0; i < where.rows; ++i) {
      const force: [number, number, number] = [at(forces, i, 0), at(forces, i, 1), at(forces, i, 2)];
      list.push({
        frame: Math.round(at(where, i, 0)),
        link: Math.round(at(where, i, 1)),
        capsule: Math.round(at(where, i, 2)),
        point: [at(points, i, 0), at(points, i, 1), at(points, i, 2)],
        force,
        newton: Math.hypot(...force),
      });
    }
    return list;
  }

  track(json: Json): Track {
    const track = {
      name: json.name,
      repeat: json.repeat,
      origin: json.origin,
      robot: json.robot < 0 ? null : this.header.robots[json.robot],
      partner: json.partner < 0 ? null : this.partners[json.partner]!,
      other: json.other_person < 0 ? null : this.partners[json.other_person]!,
      rate: json.rate_hz,
      frames: json.frames,
      act: json.act,
      outcome: json.outcome,
      message: json.message,
      row: json.row ?? null,
    } as Track;
    lazily(track, 'contacts', () => this.contacts(json.contacts));
    lazily(track, 'forces', () => {
      const forces = new Float64Array(track.frames);
      for (const contact of track.contacts) forces[contact.frame]! += contact.newton;
      return forces;
    });
    lazily(track, 'detectors', () => json.detectors.map((d: Json) => ({...d, margins: this.columns(d.margins)})));
    lazily(track, 'motion', () => this.motion(json.motion));
    lazily(track, 'reference', () => this.motion(json.reference));
    return track;
  }
}

// Throws an Error whose message is for people where the page is of another schema or damaged.
export async function readReplay(base64: string): Promise<Replay> {
  let all: Uint8Array;
  try {
    all = await inflated(base64);
  } catch {
    throw new Error('the data of this page is damaged');
  }
  const size = new DataView(all.buffer, all.byteOffset).getUint32(0, true);
  const header: Json = JSON.parse(new TextDecoder().decode(all.subarray(4, 4 + size)));
  if (header.schema !== SCHEMA)
    throw new Error(`this page holds data of schema ${JSON.stringify(header.schema)}, and its viewer reads ${SCHEMA}`);
  const bytes = all.subarray(4 + size);
  const partners: Partner[] = header.partners.map((p: Json) => {
    const partner = {capsules: p.capsules} as Partner;
    lazily(partner, 'joints', () => readColumns(bytes, p.joints));
    return partner;
  });
  const reader = new Reader(bytes, header, partners);
  return {
    title: header.title,
    notes: header.notes,
    episodes_of_run: header.episodes_of_run,
    limits: header.limits,
    scenes: header.scenes.map((scene: Json) => ({...scene, tracks: scene.tracks.map((t: Json) => reader.track(t))})),
  };
}
